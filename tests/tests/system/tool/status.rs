//! `sevenbot status`, `recover`, `park`, `log` and `--log`, and the faults that end a pose or a stream.

use std::io::Write;
use std::process::{Output, Stdio};

use super::output::{all_output, failed, succeeded, words};
use system_tests::process::{RunningProgram, Signal, send_signal};
use system_tests::programs::tool;
use system_tests::simulator::Simulator;
use system_tests::wait::wait_until;

/// A simulator, and the tool on its port.
struct Rig(Simulator);

impl Rig {
    fn start() -> Self {
        let rig = Self(Simulator::start(&[]));
        wait_until("the servos are driven", || rig.run(&["status"]).status.success());
        let time = || rig.0.state()["time_us"].as_u64().expect("a time");
        let start_up = time() + 600_000;
        wait_until("the start-up of the servos is over (D12)", || time() > start_up);
        rig
    }

    fn run(&self, arguments: &[&str]) -> Output {
        let mut tool = tool();
        tool.arg("--port").arg(&self.0.ports[0]).args(["--timeout", "2000"]).args(arguments);
        tool.env("XDG_CONFIG_HOME", self.0.folder.path())
            .stdin(Stdio::null())
            .output()
            .expect("sevenbot runs")
    }

    fn stream(&self, lines: &str) -> Output {
        self.begin_stream(lines).output()
    }

    fn begin_stream(&self, lines: &str) -> RunningProgram {
        let mut tool = tool();
        tool.arg("--port").arg(&self.0.ports[0]).arg("stream").stdin(Stdio::piped());
        let mut tool = RunningProgram::spawn(tool.stdout(Stdio::piped()).stderr(Stdio::piped()));
        tool.stdin.take().expect("a pipe").write_all(lines.as_bytes()).expect("the tool reads");
        // The end of the input is the end of the stream.
        tool.stdin = None;
        tool
    }

    /// The angles of the simulated joints in degrees, not as the controller measured them.
    fn angles(&self) -> [f64; 7] {
        let state = self.0.state();
        std::array::from_fn(|joint| state["joints"][joint]["angle_degrees"].as_f64().expect("an angle"))
    }

    /// Sets a fault, and waits until `sevenbot status` prints `told`.
    fn break_it(&self, fault: &str, told: &str) {
        self.0.says(&["fault", fault]);
        wait_until("the arm tells of the fault", || all_output(&self.run(&["status"])).contains(told));
    }
}

#[test]
fn d30_status_tells_a_joint_and_what_to_do() {
    let rig = Rig::start();
    let text = succeeded(rig.run(&["status"]));
    assert!(text.contains("nothing needs attention"), "{text}");
    assert_eq!(words(&text, "1 ")[..3], ["1", "90.00°", "90.00°"]);
    rig.break_it("3=missing", "joint 3 does not answer");
    let text = failed(&rig.run(&["status"]), 1);
    assert!(text.contains("- check the plugs and the cable of its servo"), "{text}");
    let json = String::from_utf8(rig.run(&["status", "--json"]).stdout).expect("text");
    assert!(json.contains("\"needs_attention\":true") && json.contains("\"joint\":3,\"text\""), "{json}");
}

#[test]
fn a_pose_for_a_silent_joint_moves_nothing() {
    let rig = Rig::start();
    rig.break_it("3=missing", "joint 3 does not answer");
    let text = failed(&rig.run(&["pose", "120", "90", "80", "_", "_", "_", "_"]), 1);
    assert!(text.contains("joint 3 does not answer"), "{text}");
    let text = failed(&rig.run(&["set", "wrist-position", "4", "0", "4", "185", "4", "120"]), 1);
    assert!(text.contains("joint 3 does not answer"), "M7: {text}");
    let targets = succeeded(rig.run(&["get", "target-position.1", "target-position.2"]));
    let target = |register: &str| words(&targets, register)[2].to_owned();
    assert_eq!((target("46"), target("47")), ("90".to_owned(), "90".to_owned()), "nothing was sent");
    succeeded(rig.run(&["pose", "100", "_", "_", "_", "_", "_", "_", "--wait"]));
}

/// The hold reports the silent joint, and the duration is put back all the same.
#[test]
fn ctrl_c_puts_the_duration_back_although_a_joint_is_silent() {
    let rig = Rig::start();
    let mut tool = tool();
    tool.arg("--port").arg(&rig.0.ports[0]).args(["pose", "170", "_", "_", "_", "_", "_", "_"]);
    let tool = RunningProgram::spawn(tool.args(["--time", "8s", "--wait"]).stderr(Stdio::piped()));
    wait_until("the arm moves", || rig.angles()[0] > 92.0);
    rig.0.says(&["fault", "3=missing"]);
    send_signal(&tool, Signal::INT);
    let text = failed(&tool.output(), 1);
    assert!(
        text.contains("joint 3 does not answer") && !text.contains("still those of this command"),
        "{text}"
    );
    let pace = succeeded(rig.run(&["get", "speed.1", "time.1"]));
    assert_eq!([words(&pace, "32")[2], words(&pace, "39")[2]], ["60", "0"], "{pace}");
}

#[test]
fn a_pose_that_ends_at_a_blocked_joint_names_the_joints_that_still_move() {
    let rig = Rig::start();
    succeeded(rig.run(&["set", "speed", "5"]));
    rig.0.says(&["fault", "1=stuck"]);
    let text = failed(&rig.run(&["pose", "120", "130", "_", "30", "_", "_", "_", "--wait"]), 1);
    assert!(text.contains("joint 1 is blocked"), "{text}");
    assert!(text.contains("still moving: joints 2 and 4; `sevenbot stop` makes the arm hold"), "{text}");
    succeeded(rig.run(&["set", "speed", "60"]));
}

#[test]
fn d30_a_move_of_an_arm_with_an_alarm_warns() {
    let rig = Rig::start();
    rig.0.says(&["trip", "2"]);
    let overloaded = "a servo was overloaded";
    wait_until("the arm tells of the alarm", || all_output(&rig.run(&["status"])).contains(overloaded));
    let output = rig.run(&["home"]);
    let warned = all_output(&output);
    succeeded(output);
    assert!(warned.contains(overloaded) && warned.contains("`sevenbot status` tells what to do"), "{warned}");
}

#[test]
fn d27_a_pose_and_a_stream_end_at_a_blocked_joint_and_recover_helps() {
    let rig = Rig::start();
    rig.0.says(&["fault", "1=stuck"]);
    let text = failed(&rig.run(&["pose", "130", "_", "_", "_", "_", "_", "_", "--wait"]), 1);
    assert!(text.contains("joint 1 is blocked") && text.contains("- remove what is in its way"), "{text}");
    let text = failed(&rig.stream("0,90,,,,,,\n1,120,,,,,,\n4,121,,,,,,\n"), 1);
    assert!(text.contains("joint 1"), "{text}");
    rig.0.says(&["fault", "clear"]);
    let text = succeeded(rig.run(&["recover", "--yes"]));
    assert!(text.contains("recovered: the motors hold the arm"), "{text}");
    succeeded(rig.run(&["status"]));
}

#[test]
fn a_pose_that_fails_puts_the_speeds_back() {
    let rig = Rig::start();
    succeeded(rig.run(&["set", "speed", "20"]));
    rig.0.says(&["fault", "1=stuck"]);
    let failing = ["pose", "120", "110", "_", "_", "_", "_", "_", "--wait", "--speed", "5"];
    let text = failed(&rig.run(&failing), 1);
    assert!(text.contains("joint 1 is blocked") && text.contains("Still moving: joint 2."), "{text}");
    let speeds = succeeded(rig.run(&["get", "speed"]));
    assert_eq!((words(&speeds, "32")[2], words(&speeds, "33")[2]), ("20", "20"));
    rig.0.says(&["fault", "clear"]);
}

/// The program is suspended during the outage. The controller sets the target of a fallen joint to the position where it holds
/// the joint, so only this target shows the program that the joint has moved.
#[test]
fn d29_a_stream_tells_of_a_short_stop_in_which_a_joint_without_points_fell() {
    let rig = Rig::start();
    let stream = rig.begin_stream("0,90,,,,,,\n1,95,,,,,,\n3,90,,,,,,\n");
    wait_until("joint 1 follows the stream", || rig.angles()[0] > 91.0);
    let before = rig.angles()[2];
    send_signal(&stream, Signal::STOP);
    rig.0.says(&["fault", "supply=off", "--for", "300ms"]);
    wait_until("joint 3 has fallen and is held", || {
        rig.angles()[2] > before + 10.0 && rig.0.joint(3, "torque") == "on"
    });
    send_signal(&stream, Signal::CONT);
    let text = failed(&stream.output(), 1);
    // If reports from the outage were on their way to the program, it names the outage instead.
    let tells = ["joint 3 was to stay at 65.0 degrees, and holds at", "not answer", "no servo answers"];
    assert!(tells.iter().any(|part| text.contains(part)), "{text}");
}

#[test]
fn d27_recover_leaves_the_joints_that_are_well_where_they_are() {
    let rig = Rig::start();
    rig.0.says(&["weight", "300"]);
    rig.0.says(&["fault", "1=stuck"]);
    failed(&rig.run(&["pose", "130", "_", "_", "_", "_", "_", "_", "--wait"]), 1);
    let before = rig.angles();
    rig.0.says(&["fault", "clear"]);
    succeeded(rig.run(&["recover", "--yes"]));
    let after = rig.angles();
    let moved: Vec<_> = before.iter().zip(after).map(|(before, after)| (before - after).abs()).collect();
    assert!(moved[1..].iter().all(|degrees| *degrees < 0.7), "{before:?} {after:?}");
}

#[test]
fn d29_a_lost_supply_is_told_and_recover_asks_before_the_motors_go_on() {
    let rig = Rig::start();
    rig.break_it("supply=off", "no servo answers");
    let text = failed(&rig.run(&["recover", "--yes"]), 1);
    assert!(text.contains("the motors were not switched on"), "{text}");
    failed(&rig.stream("0,90,90,65,90,90,90,80\n1,95,90,65,90,90,90,80\n"), 1);
    rig.0.says(&["fault", "clear"]);
    wait_until("the arm tells of the lost supply", || {
        all_output(&rig.run(&["status"])).contains("the servos lost their supply")
    });
    let text = failed(&rig.stream("0,90,90,65,90,90,90,80\n"), 1);
    assert!(text.contains("the servos lost their supply"), "{text}");
    let text = failed(&rig.run(&["recover"]), 2);
    assert!(text.contains("use --yes to confirm"), "{text}");
    succeeded(rig.run(&["recover", "--yes"]));
    succeeded(rig.run(&["home", "--wait"]));
}

#[test]
fn a_parked_arm_stays_and_one_that_sinks_is_told() {
    let rig = Rig::start();
    let text = failed(&rig.run(&["park", "_", "90", "65", "90", "90", "_", "_", "--keep"]), 1);
    assert!(text.contains("joint 3 sinks"), "a level forearm is no park pose: {text}");
    succeeded(rig.run(&["status"]));
    let first = succeeded(rig.run(&["park"]));
    assert!(first.starts_with("90.00 90.00 0."), "{first}");
    assert!(succeeded(rig.run(&["status"])).starts_with("motors damping protection"));
}

#[test]
fn the_pose_in_the_help_of_park_is_one() {
    succeeded(Rig::start().run(&["park", "_", "95", "0", "_", "50", "_", "_", "--keep"]));
}

#[test]
fn an_own_pose_to_park_is_kept() {
    let rig = Rig::start();
    succeeded(rig.run(&["park", "100", "95", "0", "90", "50", "_", "_", "--keep"]));
    succeeded(rig.run(&["state", "servo"]));
    let kept = succeeded(rig.run(&["park"]));
    let base: f64 = kept.split_whitespace().next().and_then(|angle| angle.parse().ok()).expect("an angle");
    assert!((99.0..=101.0).contains(&base), "{kept}");
}

#[test]
fn a_log_holds_the_bytes_of_a_command_and_sniff_shows_them() {
    let rig = Rig::start();
    let path = rig.0.folder.path().join("run.log");
    let path = path.to_str().expect("UTF-8");
    succeeded(rig.run(&["--log", path, "pose", "95", "_", "_", "_", "_", "_", "_", "--wait"]));
    let text = succeeded(tool().args(["sniff", path]).output().expect("sevenbot runs"));
    assert!(text.contains("read device-code") && text.contains("  write target-position"), "{text}");
    failed(&rig.run(&["--log", path, "status"]), 1);
}

#[test]
fn the_log_of_an_arm_moves_nothing_and_is_not_overwritten() {
    let rig = Rig::start();
    let path = rig.0.folder.path().join("day.log");
    let path = path.to_str().expect("UTF-8");
    succeeded(rig.run(&["log", path, "--hz", "50", "--seconds", "1"]));
    let text = succeeded(tool().args(["sniff", path]).output().expect("sevenbot runs"));
    assert!(text.matches("read ").count() >= 50 && !text.contains("write target"), "{text}");
    failed(&rig.run(&["log", path]), 1);
    failed(&rig.run(&["--log", "other.log", "log", "new.log"]), 2);
}
