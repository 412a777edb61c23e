use super::*;

#[test]
fn a_fault_has_a_location_and_a_kind() {
    assert_eq!("3=missing".parse(), Ok(ArmFault::Servo(Joint::ALL[2], ServoFault::Missing)));
    assert!(matches!("7=late=5".parse(), Ok(ArmFault::Servo(_, ServoFault::Late(_)))));
    for text in [
        "3=missing",
        "7=late=5",
        "2=wall=60",
        "2=wall=60.5/500",
        "2=push=-300",
        "7=thing=30",
        "bus=echo",
        "supply=off",
        "supply=volts=5.5",
        "flash=fails",
        "flash=full",
        "line=loss=1%",
        "line=delay=20",
        "arm=supported",
        "arm=goal-starts-torque",
    ] {
        let fault = text.parse::<ArmFault>().unwrap();
        assert_eq!(fault.to_string(), text);
        let (location, _) = text.split_once('=').unwrap();
        assert_eq!(location.parse(), Ok(fault.location()));
    }
    for wrong in ["arm=missing", "missing", "0=missing", "8=missing", "x=missing", "bus=missing", ""] {
        assert_eq!(wrong.parse::<ArmFault>(), Err(UnknownArmFault::Location), "{wrong}");
    }
    assert!(matches!("2=wall".parse::<ArmFault>(), Err(UnknownArmFault::Obstacle(_))));
    assert_eq!("6=thing=30".parse::<ArmFault>(), Err(UnknownArmFault::NoClaw));
    assert!(matches!("3=echo".parse::<ArmFault>(), Err(UnknownArmFault::Kind(_))));
    assert_eq!("supply=on".parse::<ArmFault>(), Err(UnknownArmFault::Supply(UnknownSupplyFault)));
    assert_eq!("line=on".parse::<ArmFault>(), Err(UnknownArmFault::Line(UnknownLineFault)));
}

#[test]
fn a_servo_has_one_fault_and_a_line_one_of_each_kind() {
    let replaces = |new: &str, old: &str| new.parse::<ArmFault>().unwrap().replaces(old.parse().unwrap());
    assert!(replaces("3=late", "3=missing") && !replaces("4=late", "3=missing"));
    assert!(replaces("3=wall=60", "3=wall=50") && !replaces("3=wall=60", "3=push=50"));
    assert!(!replaces("3=wall=60", "4=wall=60") && !replaces("3=stuck", "3=wall=60"));
    assert!(replaces("supply=off", "supply=dips=500"));
    assert!(replaces("line=loss=2%", "line=loss=1%") && !replaces("line=loss=2%", "line=delay=5"));
    assert!(!replaces("flash=full", "flash=fails") && !replaces("arm=supported", "arm=goal-starts-torque"));
}

#[test]
fn a_report_says_that_a_fault_never_took_effect() {
    let fault = "3=garbled=10".parse().unwrap();
    let report =
        |effects| FaultReport { fault, until: None, count: Some(FaultCount { effects, occasions: 14 }) };
    assert_eq!(report(1).to_string(), "3=garbled=10: 1 of 14 answers");
    assert_eq!(report(0).to_string(), "3=garbled=10: 0 of 14 answers: it never took effect");
    let uncounted = FaultReport { fault: ArmFault::Supported, until: None, count: None };
    assert_eq!(uncounted.to_string(), "arm=supported");
}
