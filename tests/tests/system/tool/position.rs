//! `sevenbot where` and `move-to`: positions of the tip in millimetres. Also `model`, and `plot` of a recording.

use std::process::Output;
use std::thread::sleep;
use std::time::Duration;

use super::output::{all_output, failed, run_without_arm, succeeded};
use system_tests::process::{RunningProgram, Signal, send_signal};
use system_tests::registers::{SPEED, STANDARD_POSE, TARGET_POSITION, VACUUM_PUMP};
use system_tests::{TestArm, TestSetup, with_arm};

/// The numbers of the line that begins with `first`.
#[track_caller]
fn numbers(text: &str, first: &str) -> Vec<f64> {
    let line = text.lines().find(|line| line.starts_with(first));
    let line = line.unwrap_or_else(|| panic!("no line with {first} in:\n{text}"));
    line.split_whitespace().filter_map(|word| word.parse().ok()).collect()
}

fn distance(one: &[f64], other: [f64; 3]) -> f64 {
    one.iter().zip(other).map(|(one, other)| (one - other).powi(2)).sum::<f64>().sqrt()
}

/// Starts a move, and waits until the tool prints `first_frame`, the first frame of the move.
fn start_to_move(arm: &mut TestArm, arguments: &[&str], first_frame: &str) -> RunningProgram {
    arm.spawn_sevenbot_until(&[arguments, &["--verbose"]].concat(), first_frame)
}

#[test]
fn where_shows_the_tip_of_the_standard_pose() {
    with_arm(TestSetup::any(), |arm| {
        arm.drive_to(&STANDARD_POSE);
        let text = succeeded(arm.sevenbot(&["where"]));
        // Two degrees of play move the tip by 9 mm at a distance of 250 mm.
        assert!(distance(&numbers(&text, "tip")[..3], [0.0, 250.3, 219.5]) < 20.0, "{text}");
        assert!(numbers(&text, "tip")[3] < 2.0, "the servos' counts leave 1.2 mm open: {text}");
        assert!(text.contains("tool") && text.contains("wrist"), "{text}");
        let json = succeeded(arm.sevenbot(&["where", "--json"]));
        for field in ["\"tip_mm\":[", "\"tool\":[", "\"wrist_mm\":[", "\"uncertainty_mm\":"] {
            assert!(json.contains(field), "{json}");
        }
    });
}

#[test]
fn the_tip_goes_to_the_makers_example() {
    with_arm(TestSetup::any(), |arm| {
        arm.drive_to(&STANDARD_POSE);
        let text = succeeded(arm.sevenbot(&["move-to", "-50", "185", "50", "--wait"]));
        assert!(text.contains("straight down"), "{text}");
        assert_eq!(arm.read(TARGET_POSITION, 7), [105, 88, 110, 90, 135, 90, 80], "joints 6 and 7 stay");
        assert!(distance(&numbers(&text, "reached")[..3], [-50.0, 185.0, 50.0]) < 20.0, "{text}");
        let text = succeeded(arm.sevenbot(&["where"]));
        assert!(distance(&numbers(&text, "tip")[..3], [-50.0, 185.0, 50.0]) < 20.0, "{text}");

        let kept = ["move-to", "50", "185", "60", "--keep-tool", "--wait", "--json"];
        let json = succeeded(arm.sevenbot(&kept));
        assert!(json.contains("\"asked_mm\":[50.0,185.0,60.0]") && json.contains("\"measured\":{"), "{json}");
        arm.drive_to(&STANDARD_POSE);
    });
}

#[test]
fn a_point_out_of_reach_moves_nothing_and_names_the_nearest() {
    with_arm(TestSetup::any(), |arm| {
        arm.drive_to(&STANDARD_POSE);
        let text = failed(&arm.sevenbot(&["move-to", "0", "500", "50"]), 1);
        assert!(text.contains("it is too far") && text.contains("nothing was moved"), "{text}");
        assert_eq!(arm.read(TARGET_POSITION, 7), STANDARD_POSE);
        let (_, nearest) = text.split_once("nearest point within reach is ").expect("a point");
        let point: Vec<&str> = nearest.split_whitespace().take(3).collect();
        succeeded(arm.sevenbot(&["move-to", point[0], point[1], point[2], "--dry-run"]));
        assert_eq!(arm.read(TARGET_POSITION, 7), STANDARD_POSE, "a dry run moves nothing");
    });
}

#[test]
fn reach_is_checked_without_an_arm() {
    let dry = |words: &[&str]| -> Output {
        run_without_arm(&[&["--port", "/nonexistent", "move-to"], words, &["--dry-run"]].concat())
    };
    let text = succeeded(dry(&["0", "185", "50"]));
    assert!(text.contains("straight down") && text.contains("joints"), "{text}");
    assert!(text.contains("hundredths of a degree miss the point by 0.0"), "{text}");
    let text = failed(&dry(&["0", "250", "280"]), 1);
    assert!(text.contains("With --tool 0 1"), "a direction that works: {text}");
    let text = failed(&dry(&["0", "-200", "100"]), 1);
    assert!(text.contains("behind the arm"), "{text}");
    failed(&dry(&["0", "185"]), 2);
    failed(&dry(&["0", "185", "50", "--tool", "0", "1"]), 2);
}

#[test]
fn the_guard_is_checked_without_an_arm() {
    let dry = |words: &[&str]| -> Output {
        run_without_arm(&[&["--port", "/nonexistent", "move-to"], words, &["--dry-run"]].concat())
    };
    let text = failed(&dry(&["0", "185", "-100"]), 1);
    assert!(text.contains("the tip would be 40.0 mm below the table at z = -60 mm"), "{text}");
    assert!(text.contains("the nearest allowed point is 0 185 -60 mm, 40.0 mm away"), "{text}");
    assert!(text.contains("--table Z") && text.contains("--no-guard"), "what to do: {text}");
    succeeded(dry(&["0", "185", "-60"]));
    succeeded(dry(&["0", "185", "-100", "--table", "-120"]));
    succeeded(dry(&["0", "185", "-100", "--no-guard"]));
    failed(&dry(&["0", "185", "50", "--table", "55.5"]), 1);
    failed(&dry(&["0", "185", "50", "--table", "40", "--no-guard"]), 2);
    // The nearest point to the middle of the base is not within the base.
    let text = failed(&dry(&["0", "0", "0"]), 1);
    let (_, nearest) = text.split_once("nearest point within reach is ").expect("a point");
    let point: Vec<&str> = nearest.split_whitespace().take(3).collect();
    succeeded(dry(&[point[0], point[1], point[2]]));
    let text = failed(&dry(&["0", "100", "-40"]), 1);
    assert!(text.contains("inside the space of the base"), "{text}");
}

#[test]
fn the_way_to_a_point_is_guarded_and_joints_only_warn() {
    with_arm(TestSetup::any(), |arm| {
        arm.drive_to(&[105, 88, 110, 90, 135, 90, 80]);
        let before = arm.read(TARGET_POSITION, 7);
        // Both ends, and the line between them, are 5 mm above this table.
        let line = ["move-to", "50", "185", "50", "--table", "45", "--straight", "--dry-run"];
        succeeded(arm.sevenbot(&line));
        // Joint 2 leads and joint 3 follows slowly, so the tip is lower on the way than at both ends.
        arm.write(SPEED, &[60, 60, 10, 60, 60, 60, 60]);
        let text = failed(&arm.sevenbot(&["move-to", "0", "300", "100", "--table", "45"]), 1);
        let is_refused = text.contains("the way there is not allowed") && text.contains("nothing was moved");
        assert!(is_refused && text.contains("below the table at z = 45 mm"), "{text}");
        assert_eq!(arm.read(TARGET_POSITION, 7), before);
        arm.write(SPEED, &[60; 7]);
        let into_base = ["pose", "90", "140", "180", "90", "90", "90", "80", "--speed", "1"];
        let warned = arm.sevenbot(&into_base);
        let text = all_output(&warned);
        assert_eq!(warned.status.code(), Some(0), "{text}");
        assert!(text.contains("warning: ") && text.contains("--no-guard ends this warning"), "{text}");
        let quiet = arm.sevenbot(&["home", "--no-guard", "--speed", "60", "--wait"]);
        assert!(!all_output(&quiet).contains("warning"), "{}", all_output(&quiet));
        arm.write(SPEED, &[60; 7]);
        arm.drive_to(&STANDARD_POSE);
    });
}

#[test]
fn ctrl_c_holds_an_arm_on_its_way_to_a_point() {
    with_arm(TestSetup::any(), |arm| {
        arm.drive_to(&STANDARD_POSE);
        // Joint 1 turns by 63 degrees at 1.9 degrees/s: the signal comes before the end on a busy machine, too.
        arm.write(SPEED, &[1; 7]);
        let tool = start_to_move(arm, &["move-to", "200", "100", "60", "--wait"], "-> write fine-target");
        sleep(Duration::from_millis(500));
        send_signal(&tool, Signal::INT);
        let output = tool.output();
        assert_eq!(output.status.code(), Some(130), "{}", all_output(&output));
        assert!(all_output(&output).contains("holds where it is"), "{}", all_output(&output));
        arm.reopen(115_200);
        arm.wait_until_still();
        assert_ne!(arm.read(TARGET_POSITION, 1), [27], "not where it was sent");
        arm.write(SPEED, &[60; 7]);
        arm.drive_to(&STANDARD_POSE);
    });
}

#[test]
fn the_tip_goes_straight_and_the_speeds_are_restored() {
    with_arm(TestSetup::any(), |arm| {
        arm.drive_to(&[105, 88, 110, 90, 135, 90, 80]);
        arm.write(SPEED, &[20; 7]);
        arm.write(VACUUM_PUMP, &[1]);
        let line = ["move-to", "60", "200", "50", "--straight", "--speed", "60"];
        let text = succeeded(arm.sevenbot(&[&line[..], &["--dry-run"]].concat()));
        assert!(text.contains("one each 20 ms") && text.contains("take the tip up to 0.0"), "{text}");
        assert_eq!(arm.read(TARGET_POSITION, 1), [105], "a dry run moves nothing");
        let text = succeeded(arm.sevenbot(&line));
        assert!(distance(&numbers(&text, "reached")[..3], [60.0, 200.0, 50.0]) < 20.0, "{text}");
        assert_eq!(arm.read(SPEED, 7), [20; 7], "the speeds are restored");
        assert_eq!(arm.read(VACUUM_PUMP, 1), [1], "the pump stays as it was");
        let back = succeeded(arm.sevenbot(&["move-to", "-50", "185", "50", "--straight", "--json"]));
        assert!(back.contains("\"deviation_mm\":") && back.contains("\"measured\":{"), "{back}");
        arm.write(VACUUM_PUMP, &[0]);
        arm.write(SPEED, &[60; 7]);
        arm.drive_to(&STANDARD_POSE);
    });
}

#[test]
fn a_line_that_breaks_moves_nothing() {
    with_arm(TestSetup::any(), |arm| {
        arm.drive_to(&[105, 88, 110, 90, 135, 90, 80]);
        let text = failed(&arm.sevenbot(&["move-to", "-50", "480", "50", "--straight"]), 1);
        assert!(text.contains("nearest point within reach"), "{text}");
        // Both ends are within reach, and the base is between them.
        let text = failed(&arm.sevenbot(&["move-to", "200", "10", "50", "--straight", "--dry-run"]), 1);
        assert!(text.contains("the straight line breaks"), "{text}");
        let text = failed(&arm.sevenbot(&["move-to", "60", "130", "60", "--straight", "--speed", "500"]), 1);
        assert!(text.contains("it could follow at"), "{text}");
        assert_eq!(arm.read(TARGET_POSITION, 7), [105, 88, 110, 90, 135, 90, 80]);
        arm.drive_to(&STANDARD_POSE);
    });
}

#[test]
fn ctrl_c_holds_an_arm_on_a_straight_line() {
    with_arm(TestSetup::any(), |arm| {
        arm.drive_to(&[105, 88, 110, 90, 135, 90, 80]);
        // The line is 151 mm long, and takes half a minute at 5 mm/s.
        let line = ["move-to", "100", "200", "50", "--straight", "--speed", "5"];
        let tool = start_to_move(arm, &line, "-> write vacuum-pump");
        sleep(Duration::from_millis(2000));
        send_signal(&tool, Signal::INT);
        let output = tool.output();
        assert_eq!(output.status.code(), Some(130), "{}", all_output(&output));
        arm.reopen(115_200);
        arm.wait_until_still();
        assert!(arm.read(TARGET_POSITION, 1)[0] > 70, "not at the end of the line");
        arm.drive_to(&STANDARD_POSE);
    });
}

#[test]
fn models_are_written_without_an_arm() {
    let model = |format: &str| run_without_arm(&["model", "--format", format]);
    let urdf = succeeded(model("urdf"));
    assert!(urdf.starts_with("<robot name=\"7bot_v2\">") && urdf.ends_with("</robot>\n"), "{urdf}");
    let mjcf = succeeded(model("mjcf"));
    assert!(mjcf.starts_with("<mujoco") && mjcf.ends_with("</mujoco>\n"), "{mjcf}");
    let folder = tempfile::tempdir().expect("a temporary folder");
    let file = folder.path().join("7bot.glb");
    let out = ["model", "--format", "glb", "--out", file.to_str().expect("UTF-8")];
    succeeded(run_without_arm(&out));
    let written = std::fs::read(file).expect("a file");
    assert_eq!(written, model("glb").stdout, "binary as it is, also through a pipe");
    assert_eq!(written.get(8..12), Some(&u32::try_from(written.len()).expect("a length").to_le_bytes()[..]));
    failed(&model("stl"), 2);
}

#[test]
fn the_way_of_a_recording_is_plotted_without_an_arm() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let file = folder.path().join("wave.txt");
    std::fs::write(&file, "7bot-recording 1\n0 90 90 65 90 90 90 80 0\n1 120 80 65 90 90 90 80 1\n")
        .expect("a file");
    let svg = succeeded(run_without_arm(&["plot", file.to_str().expect("UTF-8")]));
    assert!(svg.starts_with("<svg") && svg.contains("wave.txt") && svg.contains("class=\"way\""), "{svg}");
    let missing = folder.path().join("none.txt");
    failed(&run_without_arm(&["plot", missing.to_str().expect("UTF-8")]), 1);
}
