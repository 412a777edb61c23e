//! The page in another browser.

use browser_tests::Viewed;
use browser_tests::firefox::Firefox;
use serde_json::Value;

/// Its code in the WebDriver standard.
const ARROW_RIGHT: char = '\u{E014}';
const ESCAPE: char = '\u{E00C}';

#[test]
fn the_simulated_arm_is_shown_and_moved_and_nothing_is_requested_from_elsewhere() {
    let viewed = Viewed::without_arm();
    let mut page = Firefox::open(&viewed.url);
    page.wait_for("the arm is ready", "document.querySelector('#state').textContent", |text| {
        text == "The arm is ready."
    });
    page.keys(ESCAPE, 1);
    let angle = "JSON.parse(window.sevenbot.state()).measured[0]";
    let (start, before) = (page.evaluate(angle).as_f64().expect("an angle"), page.picture());
    page.evaluate("document.querySelector('#joint-1').focus()");
    page.keys(ARROW_RIGHT, 30);
    let has_turned = |angle: &Value| angle.as_f64().is_some_and(|angle| (angle - start - 15.0).abs() < 0.3);
    page.wait_for("joint 1 turns", angle, has_turned);
    assert!(page.picture().differences(&before) > 500, "the picture of the arm turns, too");
    assert_eq!(page.evaluate("document.querySelector('#notice').hidden"), true, "there is a picture");
    assert_eq!(page.errors().collect::<Vec<_>>(), [""; 0]);
    // Firefox draws its own controls with pictures and a font that are within it.
    let requests: Vec<_> = page.requests().filter(|url| !url.starts_with("data:")).collect();
    assert!(!requests.is_empty());
    assert!(requests.iter().all(|url| url.starts_with(viewed.origin())), "{requests:?}");
}
