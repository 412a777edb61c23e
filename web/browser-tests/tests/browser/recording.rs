//! Recordings: made in the page and parsed by the library `sevenbot`, opened and played in the page; and parks.

use std::path::{Path, PathBuf};

use browser_tests::{Page, Viewed};
use sevenbot::recording::Recording;
use system_tests::wait::wait_for;

/// Records a move of joint 1 by the keyboard, and saves it in a folder. Returns the file and the angles before and after.
fn record(page: &mut Page, folder: &Path) -> (PathBuf, [f64; 2]) {
    page.download_to(folder);
    page.click("[data-action=record]");
    let (start, target) = (page.measured()[0], page.target(1));
    page.focus("#joint-1");
    page.keys("ArrowRight", 40);
    // A recording ends with the last reply before the click. A joint that still moves is elsewhere in the next reply.
    page.wait_until_joint_rests(1, target + 20.0);
    page.click("[data-action=record]");
    let end = page.measured()[0];
    page.wait_for_text("#recording", "recorded: ");
    page.click("[data-action=download]");
    let file = folder.join("movement.7bot");
    wait_for("the file is saved", || {
        std::fs::read_to_string(&file)
            .ok()
            .filter(|text| !text.is_empty())
            .ok_or_else(|| "not yet".to_owned())
    });
    (file, [start, end])
}

#[test]
fn a_movement_of_the_page_is_a_recording_of_the_tool() {
    let viewed = Viewed::without_arm();
    let mut page = viewed.open();
    let (file, [start, end]) = record(&mut page, &viewed.path(""));
    let text = std::fs::read_to_string(file).expect("a file");
    let recording = Recording::parse(&text).expect("a recording");
    let angles: Vec<_> = recording.moments().map(|moment| moment.pose[0].degrees()).collect();
    let (first, last) = (angles.first().expect("a moment"), angles.last().expect("a moment"));
    assert!((first - start).abs() < 0.1, "{angles:?}, measured {start}");
    assert!((last - end).abs() < 0.1, "{angles:?}, measured {end}");
    assert!(angles.len() > 10, "{angles:?}");
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
    page.wait_until_said("#recording", "playing");
    page.wait_for_text("#recording", "recorded: ");
    page.wait_until_joint_rests(1, 120.5);
    assert_eq!(page.state()["faults"], 0, "{}", page.state());
    assert_eq!(page.text("#notice"), "");

    std::fs::write(&file, "no recording").expect("a file");
    page.choose_file("#upload", &file);
    page.wait_for_text("#notice", "This file is no recording:");
    assert!(page.text("#recording").contains("recorded: "), "the last one is kept");
}

/// Plays a movement that turns joint 1 for a minute, and waits until it turns.
fn play_slowly(viewed: &Viewed, page: &mut Page) {
    open_slow_movement(viewed, page);
    page.click("[data-action=play]");
    page.wait_for_state("joint 1 turns", |state| state["measured"][0].as_f64() > Some(92.0));
}

fn open_slow_movement(viewed: &Viewed, page: &mut Page) {
    let file = viewed.path("slow.7bot");
    let text = "7bot-recording 2\n0.000 90 90 65 90 90 90 80 0\n60.000 180 90 65 90 90 90 80 0\n";
    std::fs::write(&file, text).expect("a file");
    page.choose_file("#upload", &file);
    page.wait_for_text("#recording", "recorded: ");
}

/// Checks that the movement is over, and that the arm stands.
fn check_it_stands(page: &mut Page) {
    let held = page.measured()[0];
    page.pass(2.0);
    assert!((page.measured()[0] - held).abs() < 1.0, "{held}");
    assert!(!page.text("#recording").contains("playing"));
}

#[test]
fn a_stop_ends_a_movement_that_is_played() {
    let viewed = Viewed::without_arm();
    let mut page = viewed.open();
    play_slowly(&viewed, &mut page);
    page.key(" ");
    page.wait_for_text("#state", "Stopped: the arm holds.");
    check_it_stands(&mut page);
}

#[test]
fn a_slider_ends_a_movement_that_is_played_and_its_joint_goes_where_it_is_set() {
    let viewed = Viewed::without_arm();
    let mut page = viewed.open();
    play_slowly(&viewed, &mut page);
    page.click("[data-action=pump]");
    assert!(page.text("#recording").contains("playing"), "what moves no joint leaves it");
    page.focus("#joint-2");
    page.keys("ArrowRight", 10);
    page.wait_until_joint_rests(2, 95.0);
    check_it_stands(&mut page);
    assert_eq!(page.state()["registers"][184], 0, "the stream is closed");
}

/// The speeds of the joints, and the period of a stream.
fn settings(page: &mut Page) -> Vec<u64> {
    let state = page.state();
    let registers = (32..39).chain([184]);
    registers.map(|address| state["registers"][address].as_u64().expect("a value")).collect()
}

#[test]
fn park_or_another_movement_ends_one_that_is_played_and_restores_its_speeds() {
    let viewed = Viewed::without_arm();
    let mut page = viewed.open();
    let before = settings(&mut page);
    play_slowly(&viewed, &mut page);
    assert_ne!(settings(&mut page), before, "points tell the speed");
    page.click("[data-action=play]");
    page.click("[data-action=park]");
    page.wait_for_text("#notice", "Parked: the motors are off");
    assert_eq!(settings(&mut page), before);
}

#[test]
fn what_moves_no_joint_leaves_a_park_and_what_ends_it_restores_the_speeds() {
    let viewed = Viewed::without_arm();
    let mut page = viewed.open();
    let before = settings(&mut page);
    page.evaluate(
        "['park', 'pump', 'park'].forEach(name => document.querySelector(`[data-action=${name}]`).click())",
    );
    page.wait_for_text("#notice", "Parked: the motors are off");
    assert_eq!(settings(&mut page), before, "the second park knows the speeds before the first one");
    assert_eq!(page.state()["registers"][31], 1, "the pump is on");
    page.click("[data-action=park]");
    page.wait_for_text("#notice", "Not parked: The motors are off.");
    page.click("[data-action=motors][data-value='1']");
    page.wait_until_ready();
    page.type_into("#target-3", "60");
    page.wait_until_joint_rests(3, 60.0);
    page.click("[data-action=record]");
    page.click("[data-action=park]");
    page.wait_for_state("the arm is parked slowly", |state| state["registers"][34] == 10);
    page.focus("#joint-1");
    page.keys("ArrowRight", 10);
    page.wait_until_joint_rests(1, 95.0);
    assert_eq!((settings(&mut page), page.text("#notice")), (before, String::new()));
    assert!(page.target(3) > 5.0, "joint 3 was held on its way to 0: {}", page.target(3));
    page.choose("#source", "simulator");
    page.wait_for_text("#recording", "recorded: ");
}

#[test]
fn a_stop_of_another_program_ends_a_movement_that_is_played() {
    let viewed = Viewed::with_arm();
    let mut page = viewed.open();
    open_slow_movement(&viewed, &mut page);
    // A second attempt begins where the first one ended, away from the start of the movement.
    page.type_into("#approach", "2");
    viewed.stop_by_another_program(&mut page, "play");
    check_it_stands(&mut page);
}

#[test]
fn a_reload_keeps_the_movement_and_the_language_and_shows_no_tour() {
    let viewed = Viewed::without_arm();
    let mut page = viewed.open();
    page.click("[data-action=play]");
    page.wait_for_text("#notice", "There is no movement yet");
    let file = viewed.path("wave.7bot");
    std::fs::write(&file, "7bot-recording 2\n0.000 90 90 65 90 90 90 80 0\n3.000 120 90 65 90 90 90 80 0\n")
        .expect("a file");
    page.choose_file("#upload", &file);
    page.wait_for_text("#recording", "recorded: 2 points, 3.0 s");
    assert_eq!(page.text("#notice"), "", "it is no longer true");
    page.click("[data-action=tour-end]");
    page.click("[data-action=language]");
    page.reload();
    page.wait_for_text("#recording", "已录制: 2 个点, 3.0 s");
    assert_eq!(page.evaluate("document.querySelector('dialog').open"), false);
}
