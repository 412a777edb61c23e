//! Recordings: made in the page, checked and played by `sevenbot`, and the other way round.

use std::path::{Path, PathBuf};

use browser_tests::{Page, Viewed};
use sevenbot::recording::Recording;
use system_tests::wait::wait_for;

/// Records a move of joint 1 by the keyboard, and saves it in a folder.
fn record(page: &mut Page, folder: &Path) -> PathBuf {
    page.download_to(folder);
    page.click("[data-action=record]");
    let start = page.measured()[0];
    page.focus("#joint-1");
    page.keys("ArrowRight", 40);
    page.wait_for_state("joint 1 turns", |state| {
        state["measured"][0].as_f64().is_some_and(|angle| (angle - start - 20.0).abs() < 0.3)
    });
    page.click("[data-action=record]");
    page.wait_for_text("#recording", "recorded: ");
    page.click("[data-action=download]");
    let file = folder.join("movement.7bot");
    wait_for("the file is saved", || {
        std::fs::read_to_string(&file)
            .ok()
            .filter(|text| !text.is_empty())
            .ok_or_else(|| "not yet".to_owned())
    });
    file
}

#[test]
fn a_movement_of_the_page_is_a_recording_of_the_tool() {
    let viewed = Viewed::without_arm();
    let mut page = viewed.open();
    let file = record(&mut page, &viewed.path(""));
    let text = std::fs::read_to_string(file).expect("a file");
    let recording = Recording::parse(&text).expect("a recording");
    let angles: Vec<_> = recording.moments().map(|moment| moment.pose[0].degrees()).collect();
    let (first, last) = (angles.first().expect("a moment"), angles.last().expect("a moment"));
    assert!((last - first - 20.0).abs() < 0.5, "{first} to {last}");
    assert!(angles.len() > 10, "{} moments", angles.len());
}

#[test]
fn a_recording_of_the_tool_is_played_and_another_file_is_refused() {
    let viewed = Viewed::without_arm();
    let mut page = viewed.open();
    let file = viewed.path("wave.7bot");
    let text = "7bot-recording 2\n0.000 90 90 65 90 90 90 80 0\n3.000 120.5 90 65 90 90 90 80 0\n";
    std::fs::write(&file, text).expect("a file");
    page.choose_file("#upload", &file);
    page.wait_for_text("#recording", "recorded: ");
    page.click("[data-action=play]");
    page.wait_for_text("#recording", "playing");
    page.wait_for_text("#recording", "recorded: ");
    let played = page.wait_for_state("the movement ends", |state| {
        state["measured"][0].as_f64().is_some_and(|angle| (angle - 120.5).abs() < 0.3)
    });
    assert_eq!(played["faults"], 0, "{played}");

    std::fs::write(&file, "no recording").expect("a file");
    page.choose_file("#upload", &file);
    page.wait_for_text("#notice", "This file is no recording:");
    assert!(page.text("#recording").contains("recorded: "), "the last one is kept");
}

#[test]
fn a_stop_ends_a_movement_that_is_played() {
    let viewed = Viewed::without_arm();
    let mut page = viewed.open();
    let file = viewed.path("slow.7bot");
    let text = "7bot-recording 2\n0.000 90 90 65 90 90 90 80 0\n60.000 180 90 65 90 90 90 80 0\n";
    std::fs::write(&file, text).expect("a file");
    page.choose_file("#upload", &file);
    page.wait_for_text("#recording", "recorded: ");
    page.click("[data-action=play]");
    page.wait_for_state("joint 1 turns", |state| state["measured"][0].as_f64() > Some(92.0));
    page.key(" ");
    page.wait_for_text("#state", "Stopped: the arm holds.");
    let held = page.measured()[0];
    page.pass(2.0);
    assert!((page.measured()[0] - held).abs() < 1.0, "{held}");
    assert!(!page.text("#recording").contains("playing"));
}
