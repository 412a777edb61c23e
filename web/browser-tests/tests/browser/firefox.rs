//! The page in Firefox. All other tests use Chromium.

use browser_tests::Viewed;
use browser_tests::firefox::Firefox;
use serde_json::Value;
use system_tests::wait::wait_for;

/// Codes of keys in the WebDriver standard.
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
    let state = "JSON.parse(window.sevenbot.state())";
    let angle = |state: &Value, name: &str| state[name][0].as_f64().expect("an angle");
    let (start, before) = (angle(&page.evaluate(state), "targets"), page.picture());
    page.evaluate("document.querySelector('#joint-1').focus()");
    page.keys(ARROW_RIGHT, 30);
    page.wait_for("joint 1 turns", state, |state| {
        let target = angle(state, "targets");
        (target - start - 15.0).abs() < 0.01 && (angle(state, "measured") - target).abs() < 1.0
    });
    wait_for("the picture of the arm turns, too", || {
        let differences = page.picture().differences(&before);
        if differences > 500 { Ok(()) } else { Err(format!("{differences} pixels")) }
    });
    assert_eq!(page.evaluate("document.querySelector('#notice-bar').hidden"), true, "there is a picture");
    assert_eq!(page.errors().collect::<Vec<_>>(), [""; 0]);
    // Firefox draws its own controls with built-in pictures and a built-in font, which have `data:` addresses.
    let requests: Vec<_> = page.requests().filter(|url| !url.starts_with("data:")).collect();
    assert!(!requests.is_empty());
    assert!(requests.iter().all(|url| url.starts_with(viewed.origin())), "{requests:?}");
}
