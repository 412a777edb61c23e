//! The time line: recordings and previews of programs are looked through, and the arm does not move.

use std::path::Path;

use browser_tests::{Page, Viewed};
use system_tests::wait::wait_for;

use super::programs::{LIT, SLOW, open_file, open_programs, open_text};

/// Moves the slider by a key, and waits until the text of the time line contains `says`.
fn choose(page: &mut Page, key: &str, says: &str) {
    page.focus("#moment");
    page.key(key);
    page.wait_for_text("#moment-text", says);
}

/// The number of pixels that differ between the pictures of the arm at two moments, which these keys choose.
fn differences_between(page: &mut Page, keys: [&str; 2], says: [&str; 2]) -> usize {
    page.evaluate("scrollTo(0, 0)");
    let pictures = [0, 1].map(|index: usize| {
        choose(page, keys[index], says[index]);
        page.pass(0.3);
        page.picture_of([20.0, 150.0], [500.0, 400.0])
    });
    pictures[0].differences(&pictures[1])
}

#[test]
fn a_recording_is_looked_through_and_nothing_moves() {
    let viewed = Viewed::without_arm();
    let mut page = viewed.open();
    page.click("[data-action=look]");
    page.wait_for_text("#notice", "There is no movement yet");
    let file = viewed.path("wave.7bot");
    std::fs::write(&file, "7bot-recording 1\n0 90 115 65 90 90 90 80 0\n4.03 170 115 65 90 90 90 80 0\n")
        .expect("a file");
    page.choose_file("#upload", &file);
    page.wait_for_text("#recording", "recorded: ");
    page.wait_until_ready();
    // Wait until the arm has settled under its weight.
    page.pass(1.0);
    let before = page.measured();
    page.click("[data-action=look]");
    page.wait_for_text("#moment-text", "0.0 / 4.0 s · 90° 115°");
    let says = ["4.0 / 4.0 s · 170° 115°", "0.0 / 4.0 s · 90° 115°"];
    let differences = differences_between(&mut page, ["End", "Home"], says);
    assert!(differences > 1_000, "the ghost shows the moment: {differences} pixels");
    let angles: Vec<_> = before.into_iter().zip(page.measured()).collect();
    assert!(angles.iter().all(|(before, now)| (before - now).abs() < 0.3), "{angles:?}");
    assert_eq!(page.target(1), 90.0);
    page.click("[data-action=close-time-line]");
    let is_hidden = "document.querySelector('#time-line').hidden";
    assert_eq!(page.evaluate(is_hidden), true);
    // Another recording hides the time line, and so does a move of the arm.
    page.click("[data-action=look]");
    assert_eq!(page.evaluate(is_hidden), false);
    std::fs::write(&file, "7bot-recording 1\n0 90 115 65 90 90 90 80 0\n2 100 115 65 90 90 90 80 0\n")
        .expect("a file");
    page.choose_file("#upload", &file);
    page.wait_for_text("#recording", "2.0 s");
    assert_eq!(page.evaluate(is_hidden), true);
    page.click("[data-action=look]");
    assert_eq!(page.evaluate(is_hidden), false);
    page.type_into("#target-1", "95");
    page.wait_until_joint_rests(1, 95.0);
    assert_eq!(page.evaluate(is_hidden), true);
    assert_eq!(page.errors(), [""; 0]);
}

#[test]
fn a_preview_of_a_program_lights_its_blocks_and_moves_nothing() {
    for viewed in [Viewed::without_arm(), Viewed::with_arm()] {
        let mut page = viewed.open();
        open_programs(&mut page);
        page.wait_until_ready();
        let example = Path::new(env!("CARGO_MANIFEST_DIR")).join("../block-programs/examples/joints.json");
        open_file(&mut page, &example, "arm.pose");
        let before = page.measured();
        page.click("[data-action=preview]");
        wait_for("the time line is there", || {
            let text = page.text("#moment-text");
            if text.contains(" s · ") { Ok(()) } else { Err(format!("{text}; {}", page.text("#notice"))) }
        });
        let end = std::fs::read_to_string(example.with_extension("end.txt")).expect("a file");
        let end = end.split_whitespace().map(|word| word.parse::<f64>().expect("an angle"));
        page.focus("#moment");
        page.key("End");
        let text = page.text("#moment-text");
        let shown = text.split(" · ").nth(1).expect("angles").split_whitespace();
        for (shown, end) in shown.zip(end) {
            let shown: f64 = shown.trim_end_matches('°').parse().expect("an angle");
            assert!((shown - end).abs() < 1.5, "{text}: {end}");
        }
        wait_for("a block is lit", || {
            let lit = page.evaluate(LIT);
            if lit == "" { Err("none".to_owned()) } else { Ok(()) }
        });
        let angles: Vec<_> = before.into_iter().zip(page.measured()).collect();
        assert!(angles.iter().all(|(before, now)| (before - now).abs() < 0.3), "{angles:?}");
        // Another program hides the time line, wherever the slider is.
        page.key("Home");
        open_text(&viewed, &mut page, SLOW, "speed=2");
        assert_eq!(page.evaluate("document.querySelector('#time-line').hidden"), true);
        assert_eq!(page.errors(), [""; 0]);
    }
}

#[test]
fn a_preview_says_why_a_program_would_end_early() {
    let viewed = Viewed::without_arm();
    let mut page = viewed.open();
    open_programs(&mut page);
    open_text(&viewed, &mut page, SLOW, "speed=2");
    page.evaluate("document.querySelector('#fault-kind').value = 'stuck'");
    page.click("[data-action=break]");
    page.pass(0.5);
    page.click("[data-action=preview]");
    page.wait_for_text("#notice", "In the preview the program ends early. Joint 1");
    assert_eq!(page.target(1), 90.0);
    page.click("[data-action=repair]");
    page.wait_until_ready();
    page.click("[data-action=motors][data-value='2']");
    page.wait_for_text("#state", "The motors are off.");
    page.click("[data-action=preview]");
    page.wait_for_text("#notice", "The motors are off.");
}
