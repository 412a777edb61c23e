//! The commands that move the arm, and what becomes of it when they are cut short.

mod said;

use std::io::{BufRead, BufReader};
use std::process::{Child, Stdio};
use std::time::{Duration, Instant};

use rustix::process::{Pid, Signal, kill_process};
use said::{done, failed, words};
use system_tests::line::{Line, PATIENCE};
use system_tests::own::{OwnArm, World};
use system_tests::programs::tool;
use system_tests::registers::{
    EFFECTOR_TYPE, MOTOR_STATE, PRESENT_POSITION, SPEED, STANDARD_POSE, TARGET_POSITION, TIME,
};
use system_tests::target::Target;
use system_tests::{Bench, Need, Setup, near, with_arm};

/// A pose far from the standard one.
const FAR: [&str; 7] = ["170", "90", "65", "90", "90", "90", "80"];

/// The tool on its slow way to a far pose, the arm under way. Its port is the tool's.
fn under_way(arm: &mut Bench) -> (Child, BufReader<std::process::ChildStderr>) {
    let port = arm.lend_port();
    let mut tool = tool()
        .args(["--verbose", "pose", "--wait", "--speed", "5"])
        .args(FAR)
        .arg("--port")
        .arg(port)
        .stdin(Stdio::null())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .expect("sevenbot runs");
    let mut frames = BufReader::new(tool.stderr.take().expect("a pipe"));
    let (mut line, mut said) = (String::new(), String::new());
    while !line.contains("moving-joints = 1 ") {
        said.push_str(&line);
        line.clear();
        assert_ne!(frames.read_line(&mut line).expect("text"), 0, "ended before the arm moved:\n{said}");
    }
    (tool, frames)
}

/// What it says to its end, and its exit status.
fn ending((mut tool, mut frames): (Child, BufReader<std::process::ChildStderr>)) -> (String, Option<i32>) {
    let mut said = String::new();
    std::io::Read::read_to_string(&mut frames, &mut said).expect("text");
    // Less the frames.
    let said = said.lines().filter(|line| !line.contains("->") && !line.contains("<-"));
    let said = said.collect::<Vec<_>>().join("\n");
    (said, tool.wait().expect("it ends").code())
}

#[test]
fn a_pose_takes_steps_and_leaves_joints_alone() {
    with_arm(Setup::any(), |arm| {
        arm.write(SPEED, &[0; 7]);
        arm.write(TIME, &[0; 7]);
        done(arm.sevenbot(&["pose", "+20", "_", "-5", ".", "_", "_", "70", "--speed", "100", "--wait"]));
        assert_eq!(arm.read(TARGET_POSITION, 7), [110, 90, 60, 90, 90, 90, 70]);
        assert_eq!(arm.read(SPEED, 7), [100, 0, 100, 0, 0, 0, 100], "only of the joints that move");
        done(arm.sevenbot(&["pose", "-10", "_", "_", "_", "_", "_", "_", "--wait"]));
        assert_eq!(arm.register(TARGET_POSITION), 100);
        let text = failed(&arm.sevenbot(&["pose", "+81", "_", "_", "_", "_", "_", "1"]), 1);
        assert!(text.contains("joint 1 would go to 181°"), "{text}");
        assert_eq!(arm.read(TARGET_POSITION, 7), [100, 90, 60, 90, 90, 90, 70], "no half pose");
        let text = failed(&arm.sevenbot(&["pose", "+1", "x", "_", "_", "_", "_", "_"]), 2);
        assert!(text.contains("degrees from 0 to 180"), "{text}");
        assert!(done(arm.sevenbot(&["home", "--wait", "--json"])).starts_with("{\"positions_degrees\":["));
        assert_eq!(arm.read(TARGET_POSITION, 7), STANDARD_POSE);
    });
}

#[test]
fn stop_holds_the_arm_where_it_is() {
    with_arm(Setup::any(), |arm| {
        done(arm.sevenbot(&[["pose", "--speed", "5"].as_slice(), &FAR].concat()));
        arm.wait_until("the arm is under way", |arm| arm.register(PRESENT_POSITION) > 92);
        let text = done(arm.sevenbot(&["stop"]));
        let held: u8 = text.split_whitespace().next().expect("degrees").parse().expect("degrees");
        assert!((90..165).contains(&held), "{text}");
        assert_eq!(arm.register(TARGET_POSITION), held);
        arm.wait_until_still();
        arm.wait_until("it came to rest there", |arm| near(arm.register(PRESENT_POSITION), held));
    });
}

#[test]
fn stop_leaves_a_joint_alone_whose_servo_is_missing() {
    with_arm(Setup::any().fault("3=missing"), |arm| {
        arm.wait_until("the arm has noticed", |arm| arm.register(242) == 0b100);
        done(arm.sevenbot(&["stop"]));
        // It was never measured: 0 is not where it is, and it must not be sent there.
        assert_eq!(arm.register(PRESENT_POSITION + 2), 0);
        assert_eq!(arm.register(TARGET_POSITION + 2), STANDARD_POSE[2]);
    });
}

/// What the tool says when it has done something with an arm, come up or not.
#[track_caller]
fn with(arm: &OwnArm, arguments: &[&str]) -> String {
    let mut tool = tool();
    done(tool.arg("--port").arg(arm.port()).args(arguments).output().expect("sevenbot runs"))
}

#[test]
fn stop_waits_for_an_arm_that_was_just_switched_on() {
    // One of its own: it is not waited for until it has come up.
    let mut arm = OwnArm::start(World::Simulator, Vec::new());
    assert_eq!(
        with(&arm, &["stop"]),
        "90 90 65 90 90 90 80\n",
        "not 0, which is what nobody has measured yet"
    );
    with(&arm, &["pose", "120", "90", "65", "90", "90", "90", "80", "--wait"]);
    restart(&mut arm);
    let text = step_up(&arm);
    let base: u8 = text.split_whitespace().next().expect("degrees").parse().expect("degrees");
    assert!(near(base, 130), "from where it stands: {text}");
}

/// Switches the arm off and on, and waits until it answers with an empty RAM; its servos may not be measured yet.
fn restart(arm: &mut OwnArm) {
    Line::open(arm.port(), 115_200).write(EFFECTOR_TYPE, &[1]);
    let deadline = Instant::now() + PATIENCE;
    let mut line = Line::open(arm.port(), 115_200);
    assert_eq!(line.read(EFFECTOR_TYPE, 1), [1], "set before the power goes");
    arm.power_cycle();
    while line.try_read(EFFECTOR_TYPE, 1, Duration::from_millis(500)) != Some(vec![0]) {
        assert!(Instant::now() < deadline, "the arm does not come back");
    }
}

/// Moves joint 1 by 10 degrees. On a busy machine its servo may count as silent for a while: then nothing may move.
fn step_up(arm: &OwnArm) -> String {
    let deadline = Instant::now() + PATIENCE;
    loop {
        let mut tool = tool();
        let arguments = ["pose", "+10", "_", "_", "_", "_", "_", "_", "--wait"];
        let output = tool.arg("--port").arg(arm.port()).args(arguments).output().expect("sevenbot runs");
        if output.status.success() || Instant::now() > deadline {
            return done(output);
        }
        let text = failed(&output, 1);
        assert!(text.contains("nothing was moved"), "{text}");
    }
}

#[test]
fn zero_degrees_is_a_position() {
    with_arm(Setup::any(), |arm| {
        done(arm.sevenbot(&["pose", "0", "_", "_", "_", "_", "_", "_", "--speed", "100", "--wait"]));
        let text = done(arm.sevenbot(&["stop"]));
        let held: u8 = text.split_whitespace().next().expect("degrees").parse().expect("degrees");
        assert!(near(held, 0), "{text}");
        assert_eq!(arm.register(TARGET_POSITION), held);
        done(arm.sevenbot(&["pose", "0", "_", "_", "_", "_", "_", "_", "--wait"]));
        done(arm.sevenbot(&["pose", "+10", "_", "_", "_", "_", "_", "_", "--wait"]));
        assert_eq!(arm.register(TARGET_POSITION), 10);
    });
}

#[test]
fn ctrl_c_leaves_the_arm_holding() {
    with_arm(Setup::any(), |arm| {
        let tool = under_way(arm);
        let id = i32::try_from(tool.0.id()).ok().and_then(Pid::from_raw).expect("a process id");
        kill_process(id, Signal::INT).expect("it runs");
        let (said, status) = ending(tool);
        assert_eq!(status, Some(130), "{said}");
        assert!(said.contains("the arm holds where it is"), "{said}");
        arm.reopen(115_200);
        let held = arm.register(TARGET_POSITION);
        assert!(held < 165, "held at {held}");
        arm.wait_until_still();
        arm.wait_until("it came to rest there", |arm| near(arm.register(PRESENT_POSITION), held));
    });
}

#[test]
fn a_pulled_cable_ends_a_wait_with_a_clear_message() {
    with_arm(Setup::any().needs(Need::Kill), |arm| {
        let tool = under_way(arm);
        arm.kill_and_restart();
        let (said, status) = ending(tool);
        assert_eq!(status, Some(3), "{said}");
        assert!(said.contains("the connection is gone") && said.contains("was the cable pulled"), "{said}");
        assert!(!said.contains("panicked"), "{said}");
    });
}

#[test]
fn state_asks_before_the_arm_falls() {
    with_arm(Setup::any(), |arm| {
        assert_eq!(words(&done(arm.sevenbot(&["state"])), "29")[2..], ["1", "servo"]);
        let text = failed(&arm.sevenbot(&["state", "forceless"]), 2);
        assert!(text.contains("fall") && text.contains("--yes"), "{text}");
        assert_eq!(arm.register(MOTOR_STATE), 1);
        done(arm.sevenbot(&["state", "forceless", "--yes"]));
        assert_eq!(arm.register(MOTOR_STATE), 2);
        done(arm.sevenbot(&["state", "damping"]));
        assert_eq!(arm.register(MOTOR_STATE), 0, "it had no force to lose");
        done(arm.sevenbot(&["state", "servo"]));
        assert_eq!(arm.register(MOTOR_STATE), 1);
    });
}
