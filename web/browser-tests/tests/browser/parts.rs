//! The two parts of the page's module: the first view does without the rest, and what needs the rest loads it at once.

use browser_tests::{Page, Viewed};
use system_tests::wait::wait_until;

/// Makes the download that the page starts by itself wait for ever. Then only a function that needs the rest loads it.
const WITHOUT_REST: &str = "const fetchIt = window.fetch;\
    window.fetch = (url, ...more) => `${url}`.endsWith('rest.wasm') ? new Promise(() => {}) : fetchIt(url, ...more);";

fn requests_of_rest(page: &mut Page) -> usize {
    page.requests().iter().filter(|url| url.ends_with("/rest.wasm")).count()
}

#[test]
fn the_first_view_shows_moves_and_stops_the_arm_without_the_rest() {
    for viewed in [Viewed::without_arm(), Viewed::with_arm()] {
        let mut page = viewed.open_after(WITHOUT_REST);
        page.choose("#joint-speed", "10");
        page.type_into("#target-1", "180");
        page.wait_for_state("joint 1 turns", |state| state["measured"][0].as_f64() > Some(93.0));
        page.click("#stop");
        page.wait_for_state("the arm holds", |state| state["stop"] == "Holds");
        page.pass(1.0);
        let stopped = page.measured()[0];
        page.pass(1.0);
        assert!(stopped < 179.0 && (page.measured()[0] - stopped).abs() < 0.5, "{stopped}");
        page.click("[data-action=language]");
        assert_eq!(requests_of_rest(&mut page), 0);
        assert_eq!(page.errors(), [""; 0]);
    }
}

fn open_exercises(page: &mut Page) {
    page.click("[data-action=exercises]");
    page.wait_for_text("#exercise-text", "Joint 1");
}

#[test]
fn what_needs_the_rest_loads_it_at_once() {
    let viewed = Viewed::without_arm();
    let mut page = viewed.open_after(WITHOUT_REST);
    open_exercises(&mut page);
    page.click("[data-action=hint]");
    assert_eq!(requests_of_rest(&mut page), 1);
    assert_eq!(page.errors(), [""; 0]);
}

#[test]
fn the_rest_is_loaded_after_the_first_picture() {
    let viewed = Viewed::without_arm();
    let mut page = viewed.open();
    wait_until("the rest is asked for", || requests_of_rest(&mut page) > 0);
    open_exercises(&mut page);
    assert_eq!(page.errors(), [""; 0]);
}
