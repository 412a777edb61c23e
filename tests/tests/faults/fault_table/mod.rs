//! One cell of the table: a command on an arm with a fault, and its outcome.

mod commands;
mod faults;

use std::fs;
use std::io::Write;
use std::path::Path;
use std::process::{Output, Stdio};
use std::time::Duration;

use serde_json::Value;
use serde_json::json;
use system_tests::control::Control;
use system_tests::process::RunningProgram;
use system_tests::programs::tool;
use system_tests::registers::TARGET_POSITION;
use system_tests::relay::{Relay, RelayPlan};
use system_tests::simulator::Simulator;
use system_tests::wait::wait_until;
use system_tests::{ArmClient, write_request};

use commands::{Asked, FILES};
pub(crate) use commands::{COMMANDS, Command};
pub(crate) use faults::{FAULTS, Fault};

/// Virtual milliseconds after the end of a command, in which the arm completes the move that the command began.
const AFTERWARDS: u64 = 3_000;
/// In this virtual time the servos have started, in milliseconds.
const START_UP: u64 = 1_500;
/// The number of frames that the arm receives before the command, as if it had been on for long. A command detects a
/// restart by the counter of frames.
const USED: usize = 100;
/// First of the fine targets.
const FINE_TARGET: u8 = 128;
/// A joint has reached an angle if it is within this many degrees of it: servos have play, and the arm bends.
const NEAR: f64 = 3.0;
/// A joint that moves by at most this many degrees in [`AFTERWARDS`] stands still.
const STILL: f64 = 1.5;
/// The messages for a supply that is lost and comes back. Which one appears depends on when the command reads the arm.
const SUPPLY_WORDS: [&str; 4] = [
    "no servo answers",
    "does not answer: its position is unknown",
    "let go: its servo holds no torque",
    "the servos lost their supply",
];
/// The most characters of a message in the table. A longer one is cut.
const LONGEST: usize = 110;
/// The largest difference between the last pose of a recording and the pose when the command has ended, in degrees. An
/// arm in motion moves on in between.
const RECORDED: f64 = 8.0;

/// The outcome of a command.
#[derive(Clone, Debug)]
pub(crate) struct Cell {
    pub(crate) status: Option<i32>,
    /// Did the arm do what it was asked? `None`: it was not asked to do anything.
    pub(crate) is_done: Option<bool>,
    /// The first error, warning or other line that the command prints.
    pub(crate) words: String,
    /// All that the command prints.
    pub(crate) text: String,
}

impl Cell {
    /// The exit status as text; `-` if there is none.
    pub(crate) fn status_text(&self) -> String {
        self.status.map_or("-".to_owned(), |status| status.to_string())
    }

    /// Does the command report success although the arm did not do what was asked?
    pub(crate) fn is_wrong(&self) -> bool {
        self.status == Some(0) && self.is_done == Some(false)
    }
}

/// Runs a command on an arm with this fault.
pub(crate) fn run(command: Command, fault: Fault) -> Cell {
    let simulator = Simulator::start(&["--quiet"]);
    let mut control = Control::connect(&simulator.sockets()[0]);
    control.advance(START_UP);
    let mut client = ArmClient::open(&simulator.ports[0], 115_200);
    for (address, values) in command.before {
        client.write(*address, values);
        wait_until("the value is written", || client.read(*address, 1)[0] == values[0] || *address == 28);
    }
    client.send(&write_request(FINE_TARGET, &[]).repeat(USED));
    client.read(TARGET_POSITION, 1);
    drop(client);
    if command.is_supported {
        control.result(&json!({ "do": "fault", "fault": "arm=supported" }));
    }
    control.advance(command.pauses.0);
    fault.begin(&mut control, command.wall);
    control.advance(command.pauses.1);
    let mut actor = Control::connect(&simulator.sockets()[0]);
    let action = Box::new(move || fault.act(&mut actor, command.notice));
    let relay = Relay::open(
        &simulator.ports[0],
        RelayPlan { moment: command.moment, action, is_noisy: fault.is_noise() },
    );
    let output = run_tool(command, relay.path(), simulator.folder.path());
    let port = relay.path().to_str().expect("text").to_owned();
    let at_end = control.result(&json!({ "do": "state" }));
    let has_acted = relay.end();
    control.advance(AFTERWARDS);
    let later = control.result(&json!({ "do": "state" }));
    let text =
        format!("{}{}", String::from_utf8_lossy(&output.stderr), String::from_utf8_lossy(&output.stdout));
    assert!(!text.contains("panicked"), "{text}");
    let is_done = is_done(command.asked, &simulator, &at_end, &later);
    let words = match first_words(&text, &port, simulator.folder.path()) {
        words if fault.passes() && SUPPLY_WORDS.iter().any(|stage| words.contains(stage)) => {
            let kind = words.split(": ").next().unwrap_or_default();
            format!("{kind}: (servos are silent, or let go, or had no supply)")
        }
        words => words,
    };
    let is_early = fault.comes_during() && !has_acted;
    let words = if is_early { format!("(before the fault) {words}") } else { words };
    Cell { status: output.status.code(), is_done, words, text }
}

fn run_tool(command: Command, port: &Path, folder: &Path) -> Output {
    for (name, text) in FILES {
        fs::write(folder.join(name), text).expect("a file");
    }
    let mut tool = tool();
    tool.env("SEVENBOT_TIMEOUT", "1000").env("XDG_CONFIG_HOME", folder).env("NO_COLOR", "1");
    tool.arg("--port").arg(port);
    let place = folder.to_str().expect("text");
    tool.args(command.arguments.split(' ').map(|argument| argument.replace("FOLDER", place)));
    tool.stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::piped());
    let mut tool = RunningProgram::spawn(&mut tool);
    // A command that fails early does not read its input.
    let _ = tool.stdin.take().expect("a pipe").write_all(command.input.as_bytes());
    tool.output()
}

/// Did the arm do what it was asked? The check uses its states at the end of the command and [`AFTERWARDS`] later. `None`:
/// there is nothing to check.
fn is_done(asked: Asked, simulator: &Simulator, at_end: &Value, later: &Value) -> Option<bool> {
    let is_at = |(joint, degrees): &(usize, f64)| (angle(later, *joint) - degrees).abs() <= NEAR;
    let is_driven = |state: &Value| state["registers"]["motor_state"] == 1;
    let stands = (1..=7).all(|joint| (angle(later, joint) - angle(at_end, joint)).abs() <= STILL);
    Some(match asked {
        Asked::Words => return None,
        Asked::Reach(goal) => goal.iter().all(is_at) && is_driven(later),
        Asked::Park(goal) => goal.iter().all(is_at) && later["registers"]["motor_state"] == 0,
        Asked::Targets(goal) => {
            let target = |joint: usize| &at_end["registers"]["target_positions"][joint - 1];
            goal.iter().all(|(joint, degrees)| {
                target(*joint).as_u64().is_some_and(|at| at.abs_diff(u64::from(*degrees)) <= 1)
            }) && is_driven(at_end)
        }
        Asked::Stop => stands,
        Asked::Hold => is_driven(at_end) && has_torque(at_end),
        Asked::Register(address, value) => register(simulator, address) == Some(value),
        Asked::Record => {
            let recording =
                ["hand.txt", "driven.txt"].map(|name| fs::read_to_string(simulator.folder.path().join(name)));
            recording.into_iter().flatten().next().is_some_and(|text| ends_at(&text, at_end))
        }
    })
}

fn angle(state: &Value, joint: usize) -> f64 {
    state["joints"][joint - 1]["angle_degrees"].as_f64().expect("an angle")
}

/// Do all joints have torque?
fn has_torque(state: &Value) -> bool {
    state["joints"].as_array().expect("joints").iter().all(|joint| joint["torque"] == "on")
}

/// The value of a register; `None` if the arm does not answer.
fn register(simulator: &Simulator, address: u8) -> Option<u8> {
    let mut client = simulator.client();
    client.try_read(address, 1, Duration::from_secs(2)).map(|values| values[0])
}

/// Does the recording end where the arm is?
fn ends_at(recording: &str, state: &Value) -> bool {
    let last = recording.lines().next_back().unwrap_or_default();
    let numbers: Vec<f64> = last.split_whitespace().filter_map(|word| word.parse().ok()).collect();
    numbers.len() == 9 && (1..=7).all(|joint| (numbers[joint] - angle(state, joint)).abs() <= RECORDED)
}

/// The first line of an error or a warning, or else the first line, without what differs from run to run.
fn first_words(text: &str, port: &str, folder: &Path) -> String {
    // The set-up makes the arm slow, and the tool prints a note about it. Leave the note out.
    let text = || text.lines().filter(|line| !line.contains("as the registers of speed and duration say"));
    let begins = |word: &'static str| text().find(move |line| line.starts_with(word));
    let line = begins("error:").or_else(|| begins("warning:")).or_else(|| text().next()).unwrap_or_default();
    let line = line.replace(port, "PORT").replace(folder.to_str().expect("text"), "FOLDER");
    let words: String = without_timing(&masked(&line)).chars().take(LONGEST).collect();
    words.trim_end().to_owned()
}

/// Cuts off the end of a line about a lost connection. The end names the read or the write that failed, which depends on
/// timing.
fn without_timing(line: &str) -> String {
    for end in ["the connection is gone", "no answer to a read"] {
        if let Some(begin) = line.find(end) {
            return line[..begin + end.len()].to_owned();
        }
    }
    line.to_owned()
}

/// The line with `#` for each number, except the numbers of joints and states.
fn masked(line: &str) -> String {
    let mut text = String::new();
    let mut previous = "";
    for word in line.split_inclusive(' ') {
        let is_kept = ["joint ", "joints ", "state ", "and "].contains(&previous);
        let is_digit = |character: char| character.is_ascii_digit();
        if is_kept || !word.contains(is_digit) {
            text.push_str(word);
        } else {
            let mut is_in_number = false;
            for character in word.chars() {
                let is_number = is_digit(character) || (is_in_number && character == '.');
                match (is_number, is_in_number) {
                    (true, false) => text.push('#'),
                    (true, true) => {}
                    (false, _) => text.push(character),
                }
                is_in_number = is_number;
            }
        }
        previous = word;
    }
    text.trim_end().to_owned()
}
