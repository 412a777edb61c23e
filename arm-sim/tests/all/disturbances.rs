//! Disturbances of a running arm: faults and how often they took effect, the supply, a weight, and the power switch.

use arm_sim::faults::{ArmFault, FaultLocation, FaultReport};
use arm_sim::request::Request;
use arm_sim::{Duration, Joint, Simulation};
use motion_core::servo_bus::Torque;
use protocol_core::registers::map::{
    DEVICE_ID, EEPROM_LOCK, FAULTS, FRAMES_REFUSED, MISSING_SERVOS, PRESENT_POSITION, PROTECTION, SPEED,
    SUPPLY_VOLTAGE, TARGET_POSITION, fault,
};

const FOREARM: Joint = Joint::ALL[2];

fn millis(millis: u64) -> Duration {
    Duration::from_millis(millis)
}

/// An arm that holds the standard pose.
fn ready() -> Simulation {
    let mut arm = Simulation::default();
    arm.advance(millis(2_000));
    arm
}

fn fault(text: &str) -> ArmFault {
    text.parse().unwrap()
}

fn write(arm: &mut Simulation, address: u8, values: &[u8]) {
    arm.send_request(&Request::Write { address, values });
    arm.advance(millis(50));
}

/// The only fault of an arm.
fn only(arm: &mut Simulation) -> FaultReport {
    let [report] = arm.faults().try_into().unwrap();
    report
}

#[test]
fn a_fault_ends_by_itself_at_its_time() {
    let mut arm = ready();
    arm.set_fault(fault("3=missing"), Some(millis(500)));
    arm.advance(millis(499));
    assert_eq!(arm.registers().get(MISSING_SERVOS.address), 0b100);
    assert_eq!(only(&mut arm).remaining(arm.now()), Some(millis(1)));
    assert!(arm.take_ended_faults().is_empty());
    arm.advance(millis(1));
    let ended = arm.take_ended_faults();
    assert!(ended.len() == 1 && !ended[0].had_no_effect(), "{ended:?}");
    assert!(arm.faults().is_empty() && arm.take_ended_faults().is_empty());
    arm.advance(millis(1_500));
    assert_eq!(arm.registers().get(MISSING_SERVOS.address), 0);
}

#[test]
fn the_end_of_a_fault_does_not_depend_on_how_often_time_advances() {
    let run = |step: u64| {
        let mut arm = ready();
        arm.set_fault(fault("3=restarting=300"), Some(millis(1_000)));
        arm.set_fault(fault("supply=dips=170"), Some(millis(777)));
        for _ in 0..3_000 / step {
            arm.advance(millis(step));
        }
        (Joint::ALL.map(|joint| arm.plant().angle(joint)), arm.take_ended_faults())
    };
    let once = run(3_000);
    assert_eq!(once.1.len(), 2);
    assert_eq!(run(1), once);
    assert_eq!(run(100), once);
}

#[test]
fn each_fault_counts_its_effects() {
    for (text, most) in [
        ("3=missing", 99_999),
        ("3=late", 9_999),
        ("3=garbled", 9_999),
        ("bus=echo", 9_999_999),
        ("supply=off", 99_999),
    ] {
        let mut arm = ready();
        arm.set_fault(fault(text), None);
        arm.advance(millis(1_000));
        let count = only(&mut arm).count.unwrap();
        assert!((1..most).contains(&count.effects) && count.effects == count.occasions, "{text}: {count:?}");
    }
    let mut arm = ready();
    arm.set_fault(fault("3=restarting=300"), None);
    arm.set_fault(fault("supply=dips=400"), None);
    arm.advance(millis(1_000));
    let reports: Vec<String> = arm.faults().iter().map(ToString::to_string).collect();
    assert_eq!(reports, ["3=restarting=300: 3 of 3 restarts", "supply=dips=400: 2 of 2 dips"]);
    arm.set_fault(fault("3=garbled=1000000"), None);
    arm.advance(millis(1_000));
    let [dips, garbled] = arm.end_faults(None).try_into().unwrap();
    assert!(!dips.had_no_effect() && garbled.had_no_effect(), "{garbled}");
    assert!(garbled.count.unwrap().occasions > 0, "{garbled}");
}

#[test]
fn a_stuck_joint_counts_only_while_it_would_turn() {
    let mut arm = ready();
    let base = fault("1=stuck");
    arm.set_fault(base, None);
    arm.advance(millis(1_000));
    assert!(only(&mut arm).had_no_effect(), "{}", only(&mut arm));
    write(&mut arm, TARGET_POSITION.address, &[120]);
    arm.advance(millis(300));
    assert!((100..=350).contains(&only(&mut arm).count.unwrap().effects), "{}", only(&mut arm));
}

#[test]
fn a_new_fault_of_a_servo_replaces_the_old_one() {
    let mut arm = ready();
    assert_eq!(arm.set_fault(fault("3=missing"), None), None);
    arm.set_fault(fault("4=late"), None);
    let replaced = arm.set_fault(fault("3=garbled"), None).unwrap();
    assert_eq!(replaced.fault, fault("3=missing"));
    let ended = arm.end_faults(Some(FaultLocation::Joint(Joint::ALL[3])));
    assert_eq!(ended[0].fault, fault("4=late"));
    assert_eq!(only(&mut arm).fault, fault("3=garbled"));
}

#[test]
fn a_low_supply_is_measured_and_reported_and_a_lower_one_frees_the_arm() {
    let mut arm = ready();
    arm.set_fault(fault("supply=volts=4.8"), None);
    arm.advance(millis(200));
    assert!((46..=48).contains(&arm.registers().get(SUPPLY_VOLTAGE.address)));
    assert_ne!(arm.registers().get(FAULTS.address) & fault::SERVO_BUS, 0, "a wrong voltage");
    arm.set_fault(fault("supply=volts=4.4"), None);
    let before = arm.plant().angle(FOREARM);
    arm.advance(millis(500));
    assert_eq!(arm.plant().torque(FOREARM), None);
    assert!(arm.plant().angle(FOREARM) > before + 5_000, "it falls");
    assert_eq!(arm.registers().get(MISSING_SERVOS.address), 0x7F);
    arm.end_faults(None);
    arm.advance(millis(2_000));
    assert_eq!(arm.plant().torque(FOREARM), Some(Torque::On), "it starts, and is driven again");
    assert_eq!(arm.registers().get(MISSING_SERVOS.address), 0);
}

#[test]
fn without_power_nothing_answers_and_after_it_the_arm_starts() {
    let mut arm = ready();
    write(&mut arm, SPEED.address, &[7]);
    arm.take_received();
    arm.power_off();
    let read = Request::Read { address: PRESENT_POSITION.address, count: 7 };
    arm.send_request(&read);
    let before = arm.plant().angle(FOREARM);
    arm.advance(millis(1_000));
    assert!(arm.plant().angle(FOREARM) > before + 20_000, "it falls");
    assert_eq!((arm.take_received(), arm.plant().supply_decivolts()), (vec![], 0));
    arm.restart_controller();
    arm.send_request(&read);
    arm.advance(millis(1_000));
    assert_eq!(arm.take_received(), [], "no controller starts without power");
    arm.power_cycle();
    arm.advance(millis(2_000));
    assert_eq!(arm.take_received(), [], "the read was lost");
    assert_eq!(arm.registers().get(SPEED.address), 60, "the RAM too");
    arm.send_request(&read);
    arm.advance(millis(50));
    assert_eq!((arm.take_received().len(), arm.plant().supply_decivolts()), (14, 74));
}

#[test]
fn a_weight_in_the_gripper_loads_the_joints_until_a_servo_gives_up() {
    let mut arm = ready();
    write(&mut arm, PROTECTION.address, &[0]);
    let load = |arm: &Simulation| arm.plant().load(FOREARM).unsigned_abs();
    let unloaded = load(&arm);
    arm.plant_mut().set_load(150);
    arm.advance(millis(1_000));
    // 150 g at 288.5 mm are a torque of 424 mN m. With a stall torque of 2450 mN m, this is a load of 17.3 %, or 173. Friction
    // carries a part of the torque in both measurements.
    assert!((150..=180).contains(&(load(&arm) - unloaded)), "{unloaded}, then {}", load(&arm));
    arm.plant_mut().set_load(1_000);
    arm.advance(millis(3_000));
    assert_eq!(arm.plant().torque(FOREARM), None, "overload");
    assert_eq!(arm.plant().load_grams(), 1_000);
}

#[test]
fn a_flash_with_a_fault_stores_no_settings() {
    let mut arm = ready();
    arm.set_fault(fault("flash=fails"), None);
    write(&mut arm, EEPROM_LOCK.address, &[0]);
    write(&mut arm, DEVICE_ID.address, &[42]);
    assert_ne!(arm.registers().get(FAULTS.address) & fault::SETTINGS_STORAGE, 0);
    assert!(only(&mut arm).count.unwrap().effects > 0);
    arm.power_cycle();
    assert_ne!(arm.registers().get(DEVICE_ID.address), 42);
    arm.end_faults(None);
    arm.set_fault(fault("flash=full"), None);
    let refused = arm.registers().get(FRAMES_REFUSED.address);
    write(&mut arm, EEPROM_LOCK.address, &[0]);
    write(&mut arm, DEVICE_ID.address, &[43]);
    assert_eq!(arm.registers().get(FRAMES_REFUSED.address), refused + 1);
    arm.end_faults(None);
    write(&mut arm, DEVICE_ID.address, &[44]);
    arm.power_cycle();
    assert_eq!(arm.registers().get(DEVICE_ID.address), 44);
}

#[test]
fn line_faults_come_from_the_seed_and_survive_a_restart() {
    let run = |seed: u64| {
        let mut arm = ready();
        arm.set_seed(seed);
        arm.set_fault(fault("line=loss=1%"), None);
        arm.set_fault(fault("line=corruption=1%"), None);
        arm.restart_controller();
        let mut received = Vec::new();
        for _ in 0..100 {
            arm.send_request(&Request::Read { address: PRESENT_POSITION.address, count: 7 });
            arm.advance(millis(20));
            received.extend(arm.take_received());
        }
        (received, arm.faults())
    };
    let (received, faults) = run(5);
    assert!(received.len() > 1_000 && received.len() < 1_400, "{}", received.len());
    assert!(faults.iter().all(|report| report.count.unwrap().effects > 5), "{faults:?}");
    assert_eq!(run(5), (received.clone(), faults));
    assert_ne!(run(6).0, received);
}

#[test]
fn a_delay_of_the_line_delays_request_and_answer() {
    let mut arm = ready();
    arm.set_fault(fault("line=delay=20"), None);
    let asked_at = arm.now();
    arm.send_request(&Request::Read { address: PRESENT_POSITION.address, count: 7 });
    assert!(arm.advance_until(millis(100), |arm| arm.received().len() == 14));
    let took = (arm.now() - asked_at).as_micros();
    assert!((41_000..44_000).contains(&took), "{took} us: two delays and 21 bytes");
}

#[test]
fn a_copy_has_its_own_faults_and_goes_the_same_way() {
    let mut arm = ready();
    arm.set_fault(fault("line=loss=5%"), Some(millis(400)));
    arm.set_fault(fault("3=garbled=3"), Some(millis(300)));
    arm.advance(millis(100));
    let mut copy = arm.clone();
    let run = |arm: &mut Simulation| {
        for _ in 0..20 {
            arm.send_request(&Request::Read { address: PRESENT_POSITION.address, count: 7 });
            arm.advance(millis(20));
        }
        (arm.take_received(), arm.take_ended_faults())
    };
    let (received, ended) = run(&mut arm);
    assert_eq!(ended.len(), 2);
    assert_eq!(run(&mut copy), (received, ended));
}

#[test]
fn a_thing_that_the_claws_drop_is_an_ended_fault() {
    let mut arm = ready();
    arm.set_fault(fault("7=thing=30"), None);
    write(&mut arm, TARGET_POSITION.address + 6, &[28]);
    arm.advance(millis(1_000));
    assert_eq!((arm.plant().angle(Joint::ALL[6]), arm.faults().len()), (30_000, 1));
    write(&mut arm, TARGET_POSITION.address + 6, &[60]);
    arm.advance(millis(1_000));
    assert_eq!(arm.faults(), []);
    let ended = arm.take_ended_faults();
    assert!(ended.len() == 1 && ended[0].count.unwrap().effects > 0, "{ended:?}");
}
