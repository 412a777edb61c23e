//! `sevenbot monitor`, in a terminal as a user has one, and as lines.

mod said;

use std::fs;
use std::path::Path;
use std::process::Stdio;
use std::thread::sleep;
use std::time::{Duration, Instant};

use said::{done, failed};

use system_tests::line::PATIENCE;
use system_tests::own::{OwnArm, World};
use system_tests::programs::{sevenbot, tool};
use system_tests::registers::{MOTOR_STATE, TARGET_POSITION};
use system_tests::terminal::Terminal;
use system_tests::{Need, Setup, near, with_arm};

const RIGHT: &str = "\x1b[C";
const SHIFT_LEFT: &str = "\x1b[1;2D";

/// The monitor in a terminal, on a port that nobody else has open.
fn monitor(port: &Path, options: &[&str]) -> Terminal {
    let port = port.to_str().expect("port names are UTF-8");
    Terminal::run(sevenbot(), &[&["monitor", "--port", port], options].concat())
}

/// The row of a joint on the monitor's screen, without what leads to it.
fn row(screen: &str, joint: u8) -> Vec<&str> {
    let number = joint.to_string();
    let rows = screen.lines().map(|line| line.trim_start_matches([' ', '▸']).split_whitespace().collect());
    let mut rows = rows.filter(|words: &Vec<&str>| words.first() == Some(&number.as_str()));
    rows.next().unwrap_or_default()
}

/// The screen with everything masked that is another each time: the port, counts, times, and the past.
fn masked(screen: &str, port: &Path) -> String {
    let port = port.to_str().expect("port names are UTF-8");
    let mask = |line: &str| {
        // The weight of the arm loads the motors, and the supply is at the edge between the two figures.
        let line = line.replace(port, "PORT").replace("supply 7.3 V", "supply 7.4 V");
        // Braille: the plot begins when the monitor does.
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
    // An arm that keeps no settings has a fault to show.
    with_arm(Setup::any().needs(Need::FreshArm).needs(Need::Persistence), |arm| {
        let port = arm.lend_port();
        let mut terminal = monitor(&port, &[]);
        let screen = terminal.wait_until("a round trip", |screen| {
            screen.contains("faults none") && screen.contains("round trip") && row(screen, 7).len() > 4
        });
        assert!(terminal.is_on_own_screen());
        insta::assert_snapshot!(masked(&screen, &port));
        terminal.keys("?");
        terminal.wait_for("select a joint");
        terminal.keys("?");
        terminal.wait_until("no help", |screen| !screen.contains("select a joint"));
        terminal.keys(" ");
        terminal.wait_for("frozen");
        terminal.keys("q");
        assert!(terminal.wait().success());
        assert!(!terminal.is_on_own_screen(), "the terminal is given back");
        arm.reopen(115_200);
    });
}

#[test]
fn keys_nudge_a_joint_and_change_speeds() {
    with_arm(Setup::any(), |arm| {
        let before = arm.read(TARGET_POSITION, 7);
        let port = arm.lend_port();
        let mut terminal = monitor(&port, &[]);
        terminal.wait_for("round trip");
        terminal.keys("3");
        terminal.wait_for("▸   3");
        for key in [RIGHT, RIGHT, RIGHT, "]", "]", SHIFT_LEFT] {
            terminal.keys(key);
        }
        let wanted = before[2] + 13;
        let is_there = |screen: &str| row(screen, 3).get(1) == Some(&format!("{wanted}°").as_str());
        terminal.wait_until("joint 3 sent 13 degrees further", is_there);
        terminal.keys("--");
        terminal.wait_for("95.0 °/s");
        terminal.wait_until("joint 3 there", |screen| {
            let present = row(screen, 3).get(2).and_then(|word| word.trim_end_matches('°').parse().ok());
            present.is_some_and(|present| near(present, wanted))
        });
        // Ctrl-C makes the arm hold where it is, which the nudged joint has reached.
        terminal.keys("\x03");
        terminal.wait_for("the arm holds where it is");
        assert!(terminal.wait().success());
        arm.reopen(115_200);
        assert!(near(arm.read(TARGET_POSITION, 7)[2], wanted));
        arm.write(TARGET_POSITION, &before);
        arm.wait_for_pose(&before);
    });
}

#[test]
fn letting_the_arm_fall_takes_a_yes() {
    with_arm(Setup::any(), |arm| {
        let port = arm.lend_port();
        let mut terminal = monitor(&port, &[]);
        terminal.wait_for("round trip");
        terminal.keys("s");
        terminal.wait_for("motor state");
        terminal.keys("f");
        terminal.wait_for("The arm will fall");
        terminal.keys("n");
        terminal.wait_until("no question", |screen| !screen.contains("The arm will fall"));
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
fn an_arm_that_went_away_is_found_again() {
    // One of its own, because its port has to keep its name.
    let folder = tempfile::tempdir().expect("a temporary folder");
    let link = folder.path().join("7bot");
    let options = vec![("--link".to_owned(), link.to_str().expect("UTF-8").to_owned())];
    let arm = OwnArm::start(World::Simulator, options.clone());
    let mut terminal = monitor(&link, &[]);
    terminal.wait_for("114.0 °/s");
    drop(arm);
    let screen = terminal.wait_for("no arm, looking again");
    assert!(screen.contains("114.0 °/s"), "what was last known is still there:\n{screen}");
    let _arm = OwnArm::start(World::Simulator, options);
    terminal.wait_until("the arm again", |screen| {
        screen.contains("firmware 3.0") && screen.contains("servo") && !screen.contains("no arm")
    });
    terminal.keys("q");
    assert!(terminal.wait().success());
}

fn lines(text: &str) -> Vec<Vec<&str>> {
    text.lines().map(|line| line.split(',').collect()).collect()
}

#[test]
fn csv_goes_to_a_file_and_is_whole_when_the_cable_is_pulled() {
    with_arm(Setup::any().needs(Need::Kill), |arm| {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let file = folder.path().join("move.csv");
        let port = arm.lend_port();
        let mut command = tool();
        command.args(["monitor", "--hz", "50", "--csv"]).arg(&file).arg("--port").arg(&port);
        let tool = command.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().expect("sevenbot runs");
        wait_for_lines(&file, 10);
        arm.kill_and_restart();
        let output = tool.wait_with_output().expect("it ends");
        assert!(failed(&output, 3).contains("the connection is gone"));
        let text = fs::read_to_string(&file).expect("a file");
        assert!(text.ends_with('\n'));
        let lines = lines(&text);
        assert_eq!((lines[0][0], lines[0].last()), ("seconds", Some(&"round_trip_ms")));
        assert!(lines.iter().all(|line| line.len() == lines[0].len()), "{text}");
        assert_eq!(lines[1][1..8], ["90", "90", "65", "90", "90", "90", "80"]);
    });
}

/// Waits until a program has written so many lines.
fn wait_for_lines(file: &Path, count: usize) {
    let deadline = Instant::now() + PATIENCE;
    while fs::read_to_string(file).map_or(0, |text| text.lines().count()) < count {
        assert!(Instant::now() < deadline, "no lines in {}", file.display());
        sleep(Duration::from_millis(10));
    }
}

#[test]
fn json_is_a_value_a_line() {
    with_arm(Setup::any().needs(Need::Persistence), |arm| {
        let text = done(arm.sevenbot(&["monitor", "--json", "--samples", "3", "--hz", "50"]));
        assert_eq!(text.lines().count(), 3, "{text}");
        for line in text.lines() {
            assert!(line.starts_with("{\"seconds\":") && line.ends_with('}'), "{line}");
            assert!(line.contains("\"moving\":[]") && line.contains("\"faults\":0"), "{line}");
        }
    });
}

#[test]
fn a_picture_of_the_screen_can_be_had_for_documents() {
    with_arm(Setup::any(), |arm| {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let file = folder.path().join("monitor.svg");
        let path = file.to_str().expect("UTF-8");
        done(arm.sevenbot(&["monitor", "--picture", path, "--samples", "5", "--hz", "50"]));
        let picture = fs::read_to_string(&file).expect("a picture");
        assert!(picture.starts_with("<svg") && picture.contains(">7Bot<") && picture.contains("<circle"));
    });
}
