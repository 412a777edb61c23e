//! The controls beside the picture: numbers, home, claw, pump, speed and the views of the camera; their sizes on each screen; and
//! fingers that scroll the page.

use browser_tests::page::{PHONE, Screen};
use browser_tests::{Page, Viewed};
use sevenbot::map::{SPEED, VACUUM_PUMP};
use system_tests::wait::wait_until;

fn value(page: &mut Page, field: &str) -> f64 {
    page.number(&format!("Number(document.querySelector('{field}').value)"))
}

fn register(page: &mut Page, address: u8) -> u64 {
    page.state()["registers"][usize::from(address)].as_u64().expect("a value")
}

fn tip_target(page: &mut Page) -> [f64; 3] {
    ["#tip-x", "#tip-y", "#tip-z"].map(|field| value(page, field))
}

#[test]
fn a_joint_goes_to_the_number_beside_its_slider() {
    let viewed = Viewed::without_arm();
    let mut page = viewed.open();
    page.type_into("#target-1", "120.5");
    page.wait_until_joint_rests(1, 120.5);
    assert_eq!(value(&mut page, "#joint-1"), 120.5, "the slider follows");
    page.focus("#target-1");
    page.keys("ArrowUp", 3);
    page.wait_until_joint_rests(1, 122.0);
    let claw = page.target(7);
    page.type_into("#target-7", "85");
    page.wait_for_text("#notice", "This joint goes to angles of 0 – 84°");
    page.pass(0.3);
    assert_eq!([page.target(7), value(&mut page, "#target-7")], [claw, claw], "it stays");
    page.click("[data-action=close-notice]");
    assert_eq!(page.evaluate("document.querySelector('#notice-bar').checkVisibility()"), false);
    assert_eq!(page.errors(), [""; 0]);
}

#[test]
fn the_tip_goes_to_three_numbers_or_says_why_not() {
    let viewed = Viewed::without_arm();
    let mut page = viewed.open();
    let [x, y, z] = tip_target(&mut page);
    page.type_into("#tip-z", &(z + 25.0).to_string());
    page.focus("#tip-x");
    page.keys("ArrowUp", 4);
    let wanted = [x + 20.0, y, z + 25.0];
    page.wait_for_state("the tip is there", |state| {
        let tip = [0, 1, 2].map(|axis| state["tip"][axis].as_f64().expect("mm"));
        tip.iter().zip(wanted).all(|(is, wanted)| (is - wanted).abs() < 5.0)
    });
    let there = page.state()["targets"].clone();
    for (field, number, why) in [("#tip-z", "-60", "below the table"), ("#tip-y", "900", "out of reach")] {
        page.type_into(field, number);
        page.wait_for_text("#notice", &format!("The arm does not go there: {why}"));
        page.pass(0.3);
        assert_eq!(page.state()["targets"], there, "{field} {number}");
    }
    page.type_into("#tip-x", "");
    page.wait_for_text("#notice", "The tip needs three numbers");
    assert_eq!(page.state()["targets"], there);
}

#[test]
fn buttons_drive_claw_and_pump_and_home_and_a_list_sets_the_speed() {
    let viewed = Viewed::without_arm();
    let mut page = viewed.open();
    page.choose("#joint-speed", "30");
    page.wait_for_state("the speed is set", |state| {
        (0..7).all(|joint| state["registers"][usize::from(SPEED.address) + joint] == 30)
    });
    page.click("[data-action=grip][data-value='0']");
    page.wait_until_joint_rests(7, 0.0);
    page.click("[data-action=grip][data-value='84']");
    page.wait_until_joint_rests(7, 84.0);
    page.click("[data-action=pump]");
    page.wait_for_state("the pump is on", |state| state["registers"][usize::from(VACUUM_PUMP.address)] == 1);
    wait_until("the button shows it", || {
        page.evaluate("document.querySelector('[data-action=pump]').ariaPressed") == "true"
    });
    page.click("[data-action=pump]");
    page.wait_for_state("the pump is off", |state| state["registers"][usize::from(VACUUM_PUMP.address)] == 0);
    page.type_into("#target-1", "60");
    page.wait_until_joint_rests(1, 60.0);
    page.click("[data-action=home]");
    page.wait_until_joints_rest(&[(1, 90.0), (7, 80.0)]);
    assert_eq!(register(&mut page, SPEED.address), 30);
    let picture = page.picture();
    page.click("[data-action=camera][data-value=top]");
    page.pass(0.3);
    assert!(page.picture().differences(&picture) > 5_000, "the camera is above");
}

/// The width of an element, in CSS pixels.
fn width(page: &mut Page, selector: &str) -> f64 {
    page.number(&format!("document.querySelector('{selector}').getBoundingClientRect().width"))
}

#[test]
fn sliders_are_long_and_the_picture_is_large_on_each_screen() {
    let viewed = Viewed::without_arm();
    let mut page = viewed.open();
    for (wide, high) in [(360, 740), (1_280, 720), (1_920, 1_080), (3_840, 2_160)] {
        page.show_on(Screen { width: wide, height: high, is_dark: false, is_phone: wide < 500 });
        let slider = width(&mut page, "#joint-1");
        assert!(slider >= 200.0, "a slider of {slider} pixels at {wide}");
        let picture = width(&mut page, "#scene");
        assert!(picture >= f64::from(wide) * 0.45, "a picture of {picture} pixels at {wide}");
        let page_width = page.number("document.documentElement.scrollWidth");
        assert!(page_width <= f64::from(wide), "the page is {page_width} wide at {wide}");
    }
}

#[test]
fn a_finger_beside_the_arm_or_on_a_slider_moves_the_page_and_no_joint() {
    let viewed = Viewed::without_arm();
    let mut page = viewed.open();
    page.show_on(PHONE);
    // Wait until the arm has settled after its start.
    page.wait_until_ready();
    page.pass(1.0);
    let targets = page.state()["targets"].clone();
    for element in ["#joint-4", "#scene"] {
        page.evaluate("scrollTo(0, 0)");
        let [x, y] = page.centre(element);
        let scrolled = page.number("scrollY");
        // Beside the arm, which is in the middle of the picture.
        let x = if element == "#scene" { 20.0 } else { x };
        page.swipe([x, y], [x, y - 150.0]);
        let now = page.number("scrollY");
        assert!(now > scrolled + 50.0, "{element}: from {scrolled} to {now}");
        assert_eq!(page.state()["targets"], targets, "{element}");
    }
}
