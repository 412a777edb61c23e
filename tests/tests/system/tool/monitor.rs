//! `sevenbot monitor` in a terminal, and with output as CSV and JSON.

use super::output::{failed, succeeded};
use std::fs;
use std::io::{BufRead, BufReader};
use std::path::Path;
use system_tests::process::{Signal, send_signal};
use system_tests::programs::sevenbot;
use system_tests::registers::{MOTOR_STATE, STANDARD_POSE, TARGET_POSITION};
use system_tests::started_arm::{ArmKind, StartedArm};
use system_tests::terminal::Terminal;
use system_tests::wait::wait_until;
use system_tests::{Need, TestSetup, near, with_arm};

const RIGHT: &str = "\x1b[C";
const SHIFT_LEFT: &str = "\x1b[1;2D";

/// Runs the monitor in a terminal.
fn monitor(port: &Path, options: &[&str]) -> Terminal {
    let port = port.to_str().expect("port names are UTF-8");
    Terminal::run(sevenbot(), &[&["monitor", "--port", port], options].concat())
}

/// The words in the row of a joint on the screen.
fn row(screen: &str, joint: u8) -> Vec<&str> {
    let number = joint.to_string();
    let rows = screen.lines().map(|line| line.trim_start_matches([' ', '▸']).split_whitespace().collect());
    let mut rows = rows.filter(|words: &Vec<&str>| words.first() == Some(&number.as_str()));
    rows.next().unwrap_or_default()
}

/// The screen without the parts that differ between runs: port, supply, tip, plots, and the line of the link.
fn masked(screen: &str, port: &Path) -> String {
    let port = port.to_str().expect("port names are UTF-8");
    let mask = |line: &str| {
        // The weight of the arm loads the motors, so the supply reads 7.3 V or 7.4 V.
        let line = line.replace(port, "PORT").replace("supply 7.3 V", "supply 7.4 V");
        // The tip droops with the forearm, so its position differs between runs.
        let line = line.split("   tip ").next().unwrap_or_default();
        // Braille patterns of the plots.
        let line: String =
            line.chars().filter(|symbol| !('\u{2801}'..='\u{28ff}').contains(symbol)).collect();
        let line = if line.contains("round trip") { " link ... round trip ..." } else { line.as_str() };
        let title = line.split("firmware").next().map(str::len).filter(|_| line.contains("7Bot"));
        let line = title.map_or(line.to_owned(), |left| {
            let (left, right) = line.split_at(left);
            format!("{left}{}", right.split_whitespace().collect::<Vec<_>>().join(" "))
        });
        line.trim_end().to_owned()
    };
    screen.lines().map(mask).collect::<Vec<_>>().join("\n")
}

#[test]
fn the_screen_shows_the_arm() {
    // An arm without storage reports a fault.
    with_arm(TestSetup::any().needs(Need::FreshArm).needs(Need::Persistence), |arm| {
        let port = arm.lend_port();
        let mut terminal = monitor(&port, &[]);
        let screen = terminal.wait_until("a round trip is shown", |screen| {
            let is_whole = screen.contains("round trip") && row(screen, 7).len() > 4;
            // The level forearm has drooped.
            is_whole && screen.contains("faults none") && screen.contains("66°")
        });
        assert!(terminal.is_on_alternate_screen());
        insta::assert_snapshot!(masked(&screen, &port));
        terminal.keys("?");
        terminal.wait_for("select a joint");
        terminal.keys("?");
        terminal.wait_until("the help is closed", |screen| !screen.contains("select a joint"));
        terminal.keys("f");
        terminal.wait_for("frozen");
        terminal.keys("q");
        assert!(terminal.wait().success());
        assert!(!terminal.is_on_alternate_screen(), "the normal screen is restored");
        arm.reopen(115_200);
    });
}

#[test]
fn keys_move_a_joint_and_change_speeds() {
    with_arm(TestSetup::any(), |arm| {
        let before = arm.read(TARGET_POSITION, 7);
        let port = arm.lend_port();
        let mut terminal = monitor(&port, &[]);
        terminal.wait_for("114.0 °/s");
        terminal.keys("3");
        terminal.wait_for("▸   3");
        for key in [RIGHT, RIGHT, RIGHT, "]", "]", SHIFT_LEFT] {
            terminal.keys(key);
        }
        let expected = before[2] + 13;
        let is_sent = |screen: &str| row(screen, 3).get(1) == Some(&format!("{expected}°").as_str());
        terminal.wait_until("the target of joint 3 is 13 degrees further", is_sent);
        terminal.keys("--");
        terminal.wait_for("95.0 °/s");
        terminal.wait_until("joint 3 is at its target", |screen| {
            let present = row(screen, 3).get(2).and_then(|word| word.trim_end_matches('°').parse().ok());
            present.is_some_and(|present| near(present, expected))
        });
        // Ctrl-C makes the arm hold its position, which for joint 3 is its target.
        terminal.keys("\x03");
        terminal.wait_for("the arm holds where it is");
        assert!(terminal.wait().success());
        arm.reopen(115_200);
        assert!(near(arm.read(TARGET_POSITION, 7)[2], expected));
        arm.write(TARGET_POSITION, &before);
        arm.wait_for_pose(&before);
    });
}

#[test]
fn keys_move_the_tip() {
    with_arm(TestSetup::any(), |arm| {
        arm.drive_to(&[90, 91, 110, 90, 135, 90, 80]);
        let port = arm.lend_port();
        let mut terminal = monitor(&port, &[]);
        terminal.wait_for("114.0 °/s");
        terminal.keys("j");
        terminal.wait_for("base axes");
        // The tip, 185 mm from the axis of the base, goes 20 mm to the right: the base turns by 6 degrees.
        for _ in 0..4 {
            terminal.keys(RIGHT);
        }
        terminal.wait_until("the base has its target", |screen| {
            let target = row(screen, 1).get(1).and_then(|word| word.trim_end_matches('°').parse::<u8>().ok());
            target.is_some_and(|target| target.abs_diff(84) <= 1)
        });
        terminal.keys("j");
        terminal.wait_for("tool axes");
        terminal.keys("q");
        assert!(terminal.wait().success());
        arm.reopen(115_200);
        arm.drive_to(&STANDARD_POSE);
    });
}

#[test]
fn the_state_forceless_needs_a_confirmation() {
    with_arm(TestSetup::any(), |arm| {
        let port = arm.lend_port();
        let mut terminal = monitor(&port, &[]);
        terminal.wait_for("114.0 °/s");
        terminal.keys("s");
        terminal.wait_for("motor state");
        terminal.keys("f");
        terminal.wait_for("The arm will fall");
        terminal.keys("n");
        terminal.wait_until("the prompt is closed", |screen| !screen.contains("The arm will fall"));
        terminal.keys("s");
        terminal.wait_for("motor state");
        terminal.keys("f");
        terminal.wait_for("The arm will fall");
        terminal.keys("y");
        terminal.wait_for("forceless");
        terminal.keys(RIGHT);
        terminal.wait_for("the motors are off");
        terminal.keys("q");
        assert!(terminal.wait().success());
        arm.reopen(115_200);
        assert_eq!(arm.register(MOTOR_STATE), 2);
    });
}

#[test]
fn an_arm_that_was_restarted_is_found_again() {
    // The link keeps its path when the arm restarts.
    let folder = tempfile::tempdir().expect("a temporary folder");
    let link = folder.path().join("7bot");
    let options = vec![("--link".to_owned(), link.to_str().expect("UTF-8").to_owned())];
    let arm = StartedArm::start(ArmKind::Simulator, options.clone());
    let mut terminal = monitor(&link, &[]);
    terminal.wait_for("114.0 °/s");
    drop(arm);
    let screen = terminal.wait_for("no arm, looking again");
    assert!(screen.contains("114.0 °/s"), "the last values are shown:\n{screen}");
    let _arm = StartedArm::start(ArmKind::Simulator, options);
    terminal.wait_until("the arm is shown again", |screen| {
        screen.contains("firmware 3.0") && screen.contains("servo") && !screen.contains("no arm")
    });
    terminal.keys("q");
    assert!(terminal.wait().success());
}

fn lines(text: &str) -> Vec<Vec<&str>> {
    text.lines().map(|line| line.split(',').collect()).collect()
}

#[test]
fn csv_is_complete_up_to_a_lost_connection() {
    with_arm(TestSetup::any().needs(Need::Kill), |arm| {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let file = folder.path().join("move.csv");
        let path = file.to_str().expect("UTF-8");
        let tool = arm.spawn_sevenbot(&["monitor", "--hz", "50", "--csv", path]);
        wait_until("there are ten lines", || {
            fs::read_to_string(&file).is_ok_and(|text| text.lines().count() >= 10)
        });
        arm.kill_and_restart();
        let output = tool.output();
        assert!(failed(&output, 3).contains("the connection is gone"));
        let text = fs::read_to_string(&file).expect("a file");
        assert!(text.ends_with('\n'));
        let lines = lines(&text);
        assert_eq!((lines[0][0], lines[0].last()), ("seconds", Some(&"supply_lost")));
        assert!(lines.iter().all(|line| line.len() == lines[0].len()), "{text}");
        assert_eq!(lines[1][1..8], ["90", "90", "65", "90", "90", "90", "80"]);
    });
}

#[test]
fn ctrl_c_is_the_ordinary_end_of_lines() {
    with_arm(TestSetup::any(), |arm| {
        let mut tool = arm.spawn_sevenbot(&["monitor", "--json", "--hz", "50"]);
        let mut lines = BufReader::new(tool.stdout.take().expect("a pipe")).lines();
        lines.next().expect("a first line").expect("text");
        send_signal(&tool, Signal::INT);
        assert!(lines.all(|line| line.expect("text").ends_with('}')), "whole lines");
        assert_eq!(tool.wait().expect("it ends").code(), Some(0));
        arm.reopen(115_200);
    });
}

#[test]
fn json_output_has_a_line_per_sample() {
    with_arm(TestSetup::any().needs(Need::Persistence), |arm| {
        let text = succeeded(arm.sevenbot(&["monitor", "--json", "--samples", "3", "--hz", "50"]));
        assert_eq!(text.lines().count(), 3, "{text}");
        for line in text.lines() {
            assert!(line.starts_with("{\"seconds\":") && line.ends_with('}'), "{line}");
            assert!(line.contains("\"moving\":[]") && line.contains("\"faults\":0"), "{line}");
        }
    });
}
