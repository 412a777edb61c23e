//! A person moves the simulated arm and stops it: by keys, by the mouse and by a finger.

use browser_tests::page::PHONE;
use browser_tests::{Page, Viewed};
use kinematics::forward;
use sevenbot::map::SPEED;

/// The tip at these angles in degrees: x, y, z in mm.
fn tip([one, two, three, four, five, six, _]: [f64; 7]) -> [f64; 3] {
    let tip = forward([one, two, three, four, five, six]).hand.tip;
    [tip.x, tip.y, tip.z]
}

/// Scrolls to the top of the page. Returns the place where the tip is drawn, in CSS pixels.
fn tip_on_screen(page: &mut Page) -> [f64; 2] {
    page.evaluate("scrollTo(0, 0)");
    let measured = page.measured();
    page.project(tip(measured))
}

/// As [`tip_on_screen`], but for an arm with each joint at its target.
fn sent_tip_on_screen(page: &mut Page) -> [f64; 2] {
    page.evaluate("scrollTo(0, 0)");
    let state = page.state();
    page.project(tip(std::array::from_fn(|joint| state["targets"][joint].as_f64().expect("an angle"))))
}

fn distance([x, y]: [f64; 2], [to_x, to_y]: [f64; 2]) -> f64 {
    (x - to_x).hypot(y - to_y)
}

fn wait_until_it_rests(page: &mut Page) {
    page.pass(0.2);
    page.wait_for_text("#state", "The arm is ready.");
    page.pass(0.5);
}

/// Sends joint 1 to 180 degrees by the keyboard, and waits until it moves. The joint is slow, and virtual time passes slowly: the
/// move takes at least half a minute, so that a stop comes before its end on a busy machine, too.
fn start_to_move(page: &mut Page) {
    page.click("[data-action=speed][data-value='0.25']");
    page.write_register(SPEED.address, "5");
    let start = page.measured()[0];
    page.focus("#joint-1");
    page.key("End");
    page.wait_for_state("joint 1 turns", |state| state["measured"][0].as_f64() > Some(start + 3.0));
}

#[track_caller]
fn check_it_stops(page: &mut Page) {
    page.wait_for_text("#state", "Stopped: the arm holds.");
    let target = page.target(1);
    assert!(target < 179.0, "{target}");
    // The motor needs a moment to come back to where it was stopped.
    for _ in 0..2 {
        page.pass(0.3);
        let measured = page.measured()[0];
        assert!((measured - target).abs() < 1.0, "at {measured}, stopped at {target}");
    }
}

#[test]
fn an_arrow_key_on_a_slider_moves_the_arm_and_its_picture() {
    let viewed = Viewed::without_arm();
    let mut page = viewed.open();
    let (before, picture) = (page.target(1), page.picture());
    page.focus("#joint-1");
    page.keys("ArrowRight", 30);
    page.wait_until_joint_rests(1, before + 15.0);
    assert!(page.picture().differences(&picture) > 500);
    assert_eq!(page.errors(), [""; 0]);
}

#[test]
fn the_space_bar_stops_a_moving_arm_from_everywhere() {
    let viewed = Viewed::without_arm();
    for place in ["#joint-1", "[data-action=record]", "#source", "#scene", "summary", "body"] {
        let mut page = viewed.open();
        start_to_move(&mut page);
        page.evaluate("document.activeElement.blur()");
        page.focus(place);
        page.key(" ");
        check_it_stops(&mut page);
        assert_eq!(page.text("#recording"), "nothing recorded yet", "the key presses no button");
    }
}

#[test]
fn the_button_stops_a_moving_arm_with_the_mouse_and_with_a_finger() {
    let viewed = Viewed::without_arm();
    let mut page = viewed.open();
    start_to_move(&mut page);
    page.click("#stop");
    check_it_stops(&mut page);
    page.click("[data-action=speed][data-value='10']");
    page.focus("#joint-1");
    page.key("Home");
    page.wait_until_joint_rests(1, 0.0);
    page.show_on(PHONE);
    start_to_move(&mut page);
    page.evaluate("scrollTo(0, document.body.scrollHeight)");
    page.tap("#stop");
    check_it_stops(&mut page);
}

#[test]
fn the_tip_follows_the_mouse_and_a_position_out_of_reach_is_shown() {
    let viewed = Viewed::without_arm();
    let mut page = viewed.open();
    // The level forearm droops by 0.7 degrees after it got torque.
    page.pass(1.0);
    let from = tip_on_screen(&mut page);
    let to = [from[0] - 40.0, from[1] + 30.0];
    page.drag(from, to);
    wait_until_it_rests(&mut page);
    let sent = sent_tip_on_screen(&mut page);
    assert!(distance(sent, to) < 2.0, "{sent:?}, wanted {to:?}");
    // The arm droops under its weight, by friction sometimes more and sometimes less.
    let [x, y] = tip_on_screen(&mut page);
    assert!(distance([x, y], to) < 10.0, "{x} {y}, wanted {to:?}");

    let empty = page.picture();
    let far = [x + 220.0, y - 60.0];
    page.drag_and_hold([x, y], far);
    page.wait_for_text("#tip", "out of reach");
    wait_until_it_rests(&mut page);
    // The colour of the ring at the wanted position. Without the ring, the picture does not have this colour there.
    let ring = [200, 60, 0];
    assert_eq!(empty.near(ring, 30, far, 20.0), 0);
    let picture = page.picture();
    assert!(picture.near(ring, 30, far, 20.0) > 20, "{}", picture.near(ring, 30, far, 20.0));
    let reached = tip_on_screen(&mut page);
    assert!(distance(reached, far) > 30.0, "{reached:?} for {far:?}");
    page.release(far);
    page.pass(0.2);
    assert!(!page.text("#tip").contains("out of reach"));
    assert_eq!(page.picture().near(ring, 30, far, 20.0), 0);
}

/// Scrolls to the top of the page. Returns the place of the middle of the upper arm, which joint 2 turns, in CSS pixels.
fn on_the_upper_arm(page: &mut Page) -> [f64; 2] {
    page.evaluate("scrollTo(0, 0)");
    let [one, two, three, four, five, six, _] = page.measured();
    let arm = forward([one, two, three, four, five, six]).arm;
    let middle = |a: f64, b: f64| f64::midpoint(a, b);
    let (from, to) = (arm.shoulder, arm.elbow);
    page.project([middle(from.x, to.x), middle(from.y, to.y), middle(from.z, to.z)])
}

#[test]
fn a_joint_follows_the_mouse() {
    let viewed = Viewed::without_arm();
    let mut page = viewed.open();
    let before = page.measured();
    let from = on_the_upper_arm(&mut page);
    page.drag(from, [from[0] + 40.0, from[1]]);
    wait_until_it_rests(&mut page);
    let after = page.measured();
    assert!((after[1] - before[1]).abs() > 5.0, "{before:?} {after:?}");
    assert!((after[0] - before[0]).abs() < 1.0, "{before:?} {after:?}");
}

#[test]
fn a_hand_moves_a_limp_arm_and_it_falls_when_let_go() {
    let viewed = Viewed::without_arm();
    let mut page = viewed.open();
    // Wait until the motors have driven the arm: an arm that was never driven stays on its support.
    page.pass(1.0);
    page.click("[data-action=motors][data-value='2']");
    page.wait_for_text("#state", "The motors are off.");
    page.pass(2.0);
    let fallen = page.measured();
    assert!(fallen[2] > 100.0, "{fallen:?}");
    let from = on_the_upper_arm(&mut page);
    // Forward: backward the linkage stops the forearm.
    let to = [from[0] + 60.0, from[1]];
    page.drag_and_hold(from, to);
    page.pass(1.0);
    let held = page.measured();
    assert!((held[1] - fallen[1]).abs() > 5.0, "{fallen:?} {held:?}");
    page.release(to);
    page.focus("#scene");
    page.key(" ");
    page.wait_for_text("#state", "nothing to stop");
    page.click("[data-action=motors][data-value='1']");
    page.wait_for_text("#state", "The arm is ready.");
}
