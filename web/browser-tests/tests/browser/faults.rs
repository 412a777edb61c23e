//! Faults of the simulated arm, in colour and in words; and writes in the table of registers.

use browser_tests::picture::Picture;
use browser_tests::{Page, Viewed};
use sevenbot::map::MOTOR_STATE;

/// The pose of an arm that was switched on.
const STANDARD_POSE: [u32; 7] = [90, 90, 65, 90, 90, 90, 80];

/// The part of the window with the arm.
fn scene(page: &mut Page) -> Picture {
    page.evaluate("scrollTo(0, 0)");
    page.pass(0.1);
    page.picture_of([30.0, 118.0], [780.0, 420.0])
}

/// The number of pixels in the colour of joints that work, in any light.
fn working(picture: &Picture) -> usize {
    picture.count(|[red, green, blue]| green > red.saturating_add(25) && blue > red.saturating_add(25))
}

/// The number of pixels in the colour of a joint with a fault, in any light.
fn faulty(picture: &Picture) -> usize {
    picture.count(|[red, green, blue]| red > green.saturating_add(70) && red > blue.saturating_add(90))
}

#[test]
fn each_servo_that_does_not_answer_loses_its_colour_and_is_named() {
    let viewed = Viewed::without_arm();
    for joint in 1..=7 {
        let mut page = viewed.open();
        let whole = working(&scene(&mut page));
        page.choose("#fault-joint", &joint.to_string());
        page.click("[data-action=break]");
        page.wait_for_text("#state", &format!("oint {joint} does not answer"));
        page.wait_for_text(&format!("#angle-{joint}"), "no answer");
        let broken = working(&scene(&mut page));
        assert!(broken + 40 < whole, "joint {joint}: {broken} of {whole} pixels");
        page.click("[data-action=repair]");
        page.wait_for_text("#state", "The arm is ready.");
        // The joint gave way meanwhile, so the picture differs. Wait until its angle is measured again.
        page.wait_for_text(&format!("#angle-{joint}"), "°");
        assert_eq!(page.errors(), [""; 0]);
    }
}

#[test]
fn each_joint_that_is_stuck_has_the_colour_of_a_fault_and_is_named() {
    let viewed = Viewed::without_arm();
    let mut page = viewed.open();
    for joint in 1..=6 {
        page.choose("#fault-joint", &joint.to_string());
        page.choose("#fault-kind", "stuck");
        page.click("[data-action=break]");
        assert_eq!(faulty(&scene(&mut page)), 0);
        page.focus(&format!("#joint-{joint}"));
        page.keys("ArrowRight", 20);
        page.wait_until_said("#state", &format!("oint {joint} is blocked"));
        let picture = scene(&mut page);
        let (red, others) = (faulty(&picture), working(&picture));
        assert!(red > 40 && others > 500, "joint {joint}: {red} pixels, {others} of joints that work");
        page.click("[data-action=repair]");
        page.wait_until_said("#state", "The arm is ready.");
        // In some poses the next joint is hidden.
        page.slide_all(STANDARD_POSE);
        let goals: Vec<_> = (1..).zip(STANDARD_POSE.map(f64::from)).collect();
        page.wait_until_joints_rest(&goals);
    }
    assert_eq!(page.errors(), [""; 0]);
}

#[test]
fn a_weak_supply_is_said_and_shown() {
    let viewed = Viewed::without_arm();
    let mut page = viewed.open();
    assert_eq!(faulty(&scene(&mut page)), 0);
    page.click("[data-action=fault]");
    page.wait_for_text("#state", "The supply of a servo is too low or too high");
    // The load lowers the voltage below the 4.8 V of the supply.
    page.wait_for_text("#health", "Supply 4.");
    let red = faulty(&scene(&mut page));
    assert!(red > 500, "{red} pixels");
    page.click("[data-action=repair]");
    page.wait_for_text("#state", "The arm is ready.");
    assert_eq!(faulty(&scene(&mut page)), 0);
}

#[test]
fn a_servo_that_protects_itself_is_named() {
    let viewed = Viewed::without_arm();
    let mut page = viewed.open();
    page.choose("#fault-joint", "3");
    page.choose("#fault-kind", "trip");
    page.click("[data-action=break]");
    page.wait_until_said("#state", "oint 3 let go");
    page.wait_for_text("#state", "The arm is ready.");
    page.choose("#fault-kind", "trip heat");
    page.click("[data-action=break]");
    page.wait_until_said("#state", "too hot");
    assert_eq!(page.errors(), [""; 0]);
}

#[test]
fn a_thing_between_the_claws_stops_them_and_its_weight_loads_the_arm_until_it_falls() {
    let viewed = Viewed::without_arm();
    let mut page = viewed.open();
    // The level forearm droops by 0.7 degrees after it got torque.
    page.pass(1.0);
    let empty = page.measured()[2];
    page.choose("#payload", "300");
    page.click("[data-action=thing]");
    page.pass(1.0);
    let loaded = page.measured()[2];
    assert!((loaded - empty).abs() > 0.5, "joint 3 droops from {empty} to {loaded}");
    page.focus("#joint-7");
    page.keys("Home", 1);
    page.wait_until_said("#state", "oint 7 is blocked");
    let claw = page.measured()[6];
    assert!((claw - 30.0).abs() < 1.0, "{claw}");
    page.click("[data-action=drop]");
    page.pass(1.0);
    let dropped = page.measured()[2];
    assert!((dropped - empty).abs() < (loaded - empty).abs() / 2.0, "{empty}, {loaded}, {dropped}");
    assert_eq!(page.errors(), [""; 0]);
}

#[test]
fn after_an_emergency_stop_the_motors_stay_off_until_they_are_switched_on() {
    let viewed = Viewed::without_arm();
    let mut page = viewed.open();
    page.click("[data-value='supply=off 3000000']");
    page.wait_until_said("#state", "o servo answers");
    page.wait_for_text("#state", "lost their supply");
    page.click("[data-action=motors][data-value='1']");
    page.wait_for_text("#state", "The arm is ready.");
    assert_eq!(page.errors(), [""; 0]);
}

#[test]
fn after_a_power_cut_the_arm_holds_where_it_fell() {
    let viewed = Viewed::without_arm();
    let mut page = viewed.open();
    page.click("[data-action=power]");
    page.pass(1.5);
    page.wait_for_text("#state", "The arm is ready.");
    let state = page.state();
    for joint in 0..7 {
        let angle = |name: &str| state[name][joint].as_f64().expect("an angle");
        assert!((angle("measured") - angle("targets")).abs() < 1.0, "joint {}: {state}", joint + 1);
    }
}

#[test]
fn a_register_is_written_in_the_table_and_a_wrong_value_is_refused_in_words() {
    let viewed = Viewed::without_arm();
    let mut page = viewed.open();
    page.evaluate("document.querySelectorAll('details').forEach(panel => panel.open = true)");
    page.wait_for_text("#registers", "motor-state");
    page.write_register(MOTOR_STATE.address, "2");
    page.wait_for_state("the motors are off", |state| state["motors"] == 2);
    page.wait_for_text("#frames", "write motor-state = 2");
    page.write_register(MOTOR_STATE.address, "lots");
    page.wait_until_said("#notice", "This value cannot be written: lots");
    page.write_register(MOTOR_STATE.address, "7");
    page.wait_until_said("#notice", "This value cannot be written:");
    assert_eq!(page.state()["motors"], 2);
}

#[test]
fn a_wall_stands_where_a_person_puts_it() {
    let viewed = Viewed::without_arm();
    let mut page = viewed.open();
    page.choose("#fault-joint", "1");
    page.choose("#fault-kind", "wall");
    page.type_into("#wall-at", "110");
    page.click("[data-action=break]");
    page.type_into("#target-1", "150");
    page.wait_until_said("#state", "oint 1 is blocked");
    let stopped = page.measured()[0];
    assert!((stopped - 110.0).abs() < 2.0, "{stopped}");
}
