//! `sevenbot servo`: servos behind a simulated USB adapter, without the controller of an arm.

use std::path::PathBuf;
use std::process::{Command, Output, Stdio};

use super::output::{failed, run_without_arm, succeeded, words};
use system_tests::process::{self, RunningProgram, Signal, send_signal};
use system_tests::programs::{host_sim, sevenbot, tool};
use system_tests::terminal::Terminal;
use system_tests::wait::wait_until;
use system_tests::{ArmClient, TestSetup, with_arm};

/// Options of a scan: only the default baud rate of servos, and only the ids of an arm.
const ARM_IDS: [&str; 4] = ["--rates", "1000000", "--ids", "0-6"];
/// A long timeout of the tool for replies, in milliseconds. `info` of an id without a servo takes three timeouts.
const LONG_TIMEOUT: &str = "2000";

/// A simulated adapter with servos.
struct SimulatedAdapter {
    process: RunningProgram,
    port: PathBuf,
    baud: u32,
}

impl SimulatedAdapter {
    /// Starts an adapter with the default baud rate, and waits until the servo with the id `first` replies.
    fn start(options: &[&str], first: u8) -> Self {
        Self::start_at(1_000_000, options, first)
    }

    fn start_at(baud: u32, options: &[&str], first: u8) -> Self {
        let mut command = Command::new(host_sim());
        command.arg("--servos-only").args(options).stderr(Stdio::null());
        let (process, mut ports) = process::start(&mut command, 1).expect("the adapter is ready");
        let bus = Self { process, port: ports.swap_remove(0), baud };
        bus.wait_for(first);
        bus
    }

    /// Waits until a servo has started.
    fn wait_for(&self, id: u8) {
        let (id, rate) = (id.to_string(), self.baud.to_string());
        wait_until("the servo has started", || {
            self.servo(&["info", &id, "--rate", &rate]).status.code() != Some(3)
        });
    }

    fn servo(&self, arguments: &[&str]) -> Output {
        self.servo_within(LONG_TIMEOUT, arguments)
    }

    fn servo_within(&self, millis: &str, arguments: &[&str]) -> Output {
        let mut tool = tool();
        tool.arg("--port").arg(&self.port).args(["--timeout", millis, "servo"]).args(arguments);
        tool.stdin(Stdio::null()).output().expect("sevenbot runs")
    }

    fn power_cycle(&self) {
        send_signal(&self.process, Signal::HUP);
    }

    fn terminal(&self, arguments: &[&str]) -> Terminal {
        let port = self.port.to_str().expect("UTF-8");
        Terminal::run(
            sevenbot(),
            &[&["--port", port, "--timeout", LONG_TIMEOUT, "servo"], arguments].concat(),
        )
    }
}

/// The ids in the output of a scan.
fn ids(text: &str) -> Vec<u8> {
    let lines = text.lines().filter_map(|line| line.strip_prefix("id "));
    lines.filter_map(|line| line.split_whitespace().next()?.parse().ok()).collect()
}

#[test]
fn scan_finds_the_servos_and_an_echo() {
    for (fault, expected) in [(None, "gives no echo"), (Some("bus=echo"), "echoes what is sent")] {
        let options: Vec<&str> = fault.map_or(vec![], |fault| vec!["--fault", fault]);
        let bus = SimulatedAdapter::start(&options, 0);
        let text = succeeded(bus.servo(&[&["scan"], ARM_IDS.as_slice()].concat()));
        assert_eq!(ids(&text), [0, 1, 2, 3, 4, 5, 6], "{text}");
        assert_eq!(words(&text, "id 6"), ["id", "6", "1000000", "baud", "joint", "7"]);
        assert!(text.contains(expected), "{text}");
    }
}

#[test]
fn scan_tries_all_ids_through_a_slow_adapter() {
    let bus = SimulatedAdapter::start(&["--ids", "0,42,3", "--usb-latency", "1-20"], 42);
    let text = succeeded(bus.servo(&["scan", "--rates", "1000000"]));
    assert_eq!(ids(&text), [0, 3, 42], "{text}");
    assert_eq!(words(&text, "id 42")[4..], ["no", "joint's", "id"]);
}

#[test]
fn registers_are_read_and_written_by_name() {
    let bus = SimulatedAdapter::start(&[], 0);
    let text = succeeded(bus.servo(&["get", "1", "id", "max-torque"]));
    assert_eq!(words(&text, "5 "), ["5", "id", "1"]);
    let text = succeeded(bus.servo(&["set", "1", "max-torque", "600"]));
    assert_eq!(words(&text, "16")[..3], ["16", "max-torque", "600"]);
    let text = failed(&bus.servo(&["set", "1", "max-torque", "1001"]), 2);
    assert!(text.contains("max-torque takes 0 to 1000; nothing was written"), "{text}");
    failed(&bus.servo(&["set", "1", "status", "0"]), 2);
    failed(&bus.servo(&["set", "1", "goal-position", "500"]), 2);
    let text = succeeded(bus.servo(&["dump", "1"]));
    assert_eq!(words(&text, "48")[..4], ["48", "lock", "1", "locked"]);
    let toml = succeeded(bus.servo(&["dump", "1", "--format", "toml"]));
    assert!(toml.contains("max-torque = 600") && !toml.contains("present-position"), "{toml}");
}

#[test]
fn scan_tries_other_rates() {
    let bus = SimulatedAdapter::start_at(115_200, &["--servo-baud", "115200", "--ids", "1"], 1);
    let rates = ["--rates", "1000000,115200,38400", "--ids", "0-3", "--wait", "500"];
    let text = succeeded(bus.servo(&[&["scan"], rates.as_slice()].concat()));
    assert_eq!(words(&text, "id 1"), ["id", "1", "115200", "baud", "joint", "2"]);
    assert_eq!(ids(&text), [1], "{text}");
    succeeded(bus.servo(&["set-id", "1", "2", "--rate", "115200"]));
}

#[test]
fn scan_reports_missing_and_garbled_servos() {
    let bus = SimulatedAdapter::start(&["--fault", "3=missing", "--fault", "5=garbled"], 0);
    let text = failed(&bus.servo(&[&["scan"], ARM_IDS.as_slice()].concat()), 1);
    assert_eq!(ids(&text), [0, 1, 3, 4, 5, 6], "{text}");
    assert!(text.contains("error: id 4 at 1000000 baud: damaged answers"), "{text}");
}

#[test]
fn scan_reports_two_servos_with_one_id() {
    let bus = SimulatedAdapter::start(&["--ids", "3,3,5"], 5);
    let text = failed(&bus.servo(&[&["scan"], ARM_IDS.as_slice()].concat()), 1);
    assert_eq!(ids(&text), [3, 5], "{text}");
    assert!(text.contains("id 3 at 1000000 baud: several servos"), "{text}");
}

#[test]
fn scan_without_servos_suggests_what_to_check() {
    let bus = SimulatedAdapter::start(&[], 0);
    let text = failed(&bus.servo_within("300", &["scan", "--rates", "500000", "--ids", "0-2"]), 3);
    assert!(text.contains("no servo answers") && text.contains("their own power"), "{text}");
}

#[test]
fn facts_are_json_on_demand() {
    let bus = SimulatedAdapter::start(&["--ids", "0,42"], 0);
    let json = succeeded(bus.servo(&["scan", "--rates", "1000000", "--ids", "0-42", "--json"]));
    let masked = json.replace(bus.port.to_str().expect("UTF-8"), "PORT");
    insta::assert_snapshot!(masked.trim_end());
    let json = succeeded(bus.servo(&["info", "0", "--json"]));
    insta::assert_snapshot!(json.trim_end());
}

#[test]
fn info_shows_a_servo_in_words() {
    let bus = SimulatedAdapter::start(&["--fault", "bus=echo"], 6);
    insta::assert_snapshot!(succeeded(bus.servo(&["info", "6"])));
}

#[test]
fn info_of_a_silent_servo_suggests_what_to_check() {
    let bus = SimulatedAdapter::start(&["--ids", "0", "--fault", "bus=echo"], 0);
    for arguments in [["info", "9", "--rate", "1000000"], ["info", "0", "--rate", "38400"]] {
        let text = failed(&bus.servo_within("300", &arguments), 3);
        assert!(text.contains("does not answer (3 tries of 300 ms)"), "{text}");
        assert!(text.contains("sevenbot servo scan"), "{text}");
    }
    let text = failed(&bus.servo(&["info", "254"]), 2);
    assert!(text.contains("254 is not in 0..=253"), "{text}");
}

#[test]
fn set_id_changes_the_only_servo_permanently() {
    for options in [["--ids", "1"].as_slice(), &["--ids", "1", "--fault", "bus=echo"]] {
        let bus = SimulatedAdapter::start(options, 1);
        let text = succeeded(bus.servo(&["set-id", "1", "3"]));
        assert!(text.contains("the servo has id 3 now"), "{text}");
        bus.power_cycle();
        bus.wait_for(3);
        let text = succeeded(bus.servo(&["info", "3"]));
        assert_eq!(words(&text, "EEPROM lock"), ["EEPROM", "lock", "locked"]);
        let text = failed(&bus.servo(&["set-id", "1", "4"]), 1);
        assert!(text.contains("has another id: 3") && text.contains("nothing is left to do"), "{text}");
    }
}

#[test]
fn set_id_refuses_unless_one_servo_replies() {
    let bus = SimulatedAdapter::start(&["--ids", "1,200"], 200);
    let text = failed(&bus.servo(&["set-id", "1", "3"]), 1);
    assert!(text.contains("these ids answer: 1, 200") && text.contains("nothing was written"), "{text}");
    succeeded(bus.servo(&["info", "1"]));
    let text = failed(&bus.servo(&["set-id", "1", "1"]), 2);
    assert!(text.contains("both 1"), "{text}");
}

#[test]
fn center_turns_a_servo_to_its_middle_position() {
    let bus = SimulatedAdapter::start(&[], 6);
    let text = failed(&bus.servo(&["center", "6"]), 2);
    assert!(text.contains("use --yes"), "{text}");
    let text = succeeded(bus.servo(&["center", "6", "--yes", "--speed", "500"]));
    assert!(text.contains("servo 6 holds at 51"), "{text}");
    let text = succeeded(bus.servo(&["info", "6"]));
    assert_eq!(words(&text, "torque switch")[2..], ["1", "(on)"]);
}

#[test]
fn center_stops_a_blocked_servo() {
    let bus = SimulatedAdapter::start(&["--fault", "7=stuck"], 6);
    let text = failed(&bus.servo(&["center", "6", "--yes", "--speed", "500"]), 1);
    assert!(text.contains("stopped at") && text.contains("torque is off"), "{text}");
    let text = succeeded(bus.servo(&["info", "6"]));
    assert_eq!(words(&text, "torque switch")[2], "0");
}

#[test]
fn center_stops_at_ctrl_c() {
    let bus = SimulatedAdapter::start(&[], 6);
    let mut terminal = bus.terminal(&["center", "6", "--yes", "--speed", "20"]);
    // The distance is 497 counts, or a few less if the first reading is late.
    terminal.wait_for(" of 4");
    terminal.keys("\x03");
    terminal.wait_for("its torque is off");
    assert_eq!(terminal.wait().code(), Some(130));
    let text = succeeded(bus.servo(&["info", "6"]));
    assert_eq!(words(&text, "torque switch")[2], "0");
}

#[test]
fn torque_codes_prompts_and_names_the_table() {
    let bus = SimulatedAdapter::start(&[], 0);
    let text = failed(&bus.servo(&["torque-codes"]), 2);
    assert!(text.contains("run it in a terminal"), "{text}");
    for (answer, table) in [("2", "older table"), ("0", "current table")] {
        let mut terminal = bus.terminal(&["torque-codes"]);
        terminal.wait_for("[y/N]");
        terminal.keys("y\n");
        terminal.wait_for("code 0 is active");
        terminal.keys(&format!("{answer}\n"));
        terminal.wait_for("try the other code first");
        terminal.keys("\n");
        terminal.wait_for("code 2 is active");
        terminal.keys(&format!("{answer}\n"));
        terminal.wait_for(table);
        assert!(terminal.wait().success());
        let text = succeeded(bus.servo(&["info", "0"]));
        assert_eq!(words(&text, "torque switch")[2], "0", "the torque is off at the end");
    }
}

#[test]
fn the_host_link_of_an_arm_is_refused() {
    with_arm(TestSetup::any(), |arm| {
        for arguments in [["info", "0"].as_slice(), &["scan", "--rates", "1000000", "--ids", "0-1"]] {
            let text = failed(&arm.sevenbot(&[&["--timeout", LONG_TIMEOUT, "servo"], arguments].concat()), 3);
            assert!(text.contains("this is the arm's host link"), "{text}");
            assert!(text.contains("use an adapter on the servo bus"), "{text}");
        }
    });
}

#[test]
fn errors_of_ports_are_explained() {
    let text = failed(&run_without_arm(&["servo", "scan"]), 2);
    assert!(text.contains("needs the adapter's port"), "{text}");
    let text = failed(&run_without_arm(&["--port", "/dev/no-such-port", "servo", "info", "0"]), 3);
    assert!(text.contains("there is no such port"), "{text}");
    let text = failed(&run_without_arm(&["--port", "sim:foo", "info"]), 3);
    assert!(text.contains("a simulated arm is sim, or sim:SEED"), "{text}");
    let text = failed(&run_without_arm(&["--port", "sim", "servo", "scan"]), 2);
    assert!(text.contains("--port sim has no servo bus"), "{text}");
    let bus = SimulatedAdapter::start(&["--ids", "0"], 0);
    let holder = ArmClient::open(&bus.port, 1_000_000);
    let text = failed(&bus.servo(&["info", "0"]), 3);
    assert!(text.contains("another program has this port open"), "{text}");
    drop(holder);
}

#[test]
fn help_contains_examples() {
    for command in ["", "scan", "info", "set-id", "center", "torque-codes"] {
        let arguments = ["servo", command, "--help"].into_iter().filter(|word| !word.is_empty());
        let text = succeeded(run_without_arm(&arguments.collect::<Vec<_>>()));
        assert!(text.contains("Examples:"), "{command}: {text}");
    }
}
