//! The built simulator as a controller. A second process simulates its servos and the USB adapter.
//!
//! ```text
//!   client ──▶ host-sim --servos ──▶ link ──▶ host-sim --servos-only --trace ──▶ log
//! ```

use std::fs;
use std::path::{Path, PathBuf};

use crate::sim::{Bus, Client, Sim, refused, wait_until};
use motion_core::servo_bus::frame::{Decoder, Instruction, register};
use protocol_core::registers::map::{FAULTS, MISSING_SERVOS, PRESENT_POSITION, TARGET_POSITION, fault};
use rustix::process::Signal;

/// Register 242 while no servo answers.
const ALL_MISSING: u8 = 0x7F;
/// Codes of the torque switch, in the older table.
const DAMPING: u8 = 0;
const ON: u8 = 1;
const STANDARD_POSE: [u8; 7] = [90, 90, 65, 90, 90, 90, 80];
/// A timeout in milliseconds that is longer than the delay of an answer on a busy machine.
const PATIENT: [&str; 2] = ["--usb-timeout", "300"];

/// Seven servos behind an adapter, and their controller.
struct Rig {
    controller: Sim,
    servos: Sim,
    folder: tempfile::TempDir,
}

/// A frame of the controller: instruction and parameters.
type Question = (u8, Vec<u8>);

impl Rig {
    /// Starts the servos and the controller, each with its options.
    fn start(servos: &[&str], controller: &[&str]) -> Self {
        let folder = tempfile::tempdir().unwrap();
        let bus = folder.path().join("bus");
        let bus = bus.to_str().unwrap();
        let servos = [&["--servos-only", "--link", bus, "--trace"], servos].concat();
        let servos = Sim::start_with_log(&servos, &folder.path().join("servos"));
        let controller = Self::start_controller(folder.path(), controller);
        Self { controller, servos, folder }
    }

    fn start_controller(folder: &Path, options: &[&str]) -> Sim {
        let bus = folder.join("bus");
        let options = [&["--eeprom", "none", "--servos", bus.to_str().unwrap()], options].concat();
        Sim::start_with_log(&options, &folder.join("controller"))
    }

    fn bus(&self) -> PathBuf {
        self.folder.path().join("bus")
    }

    fn client(&self) -> Client {
        Client::open(self.controller.port())
    }

    /// The log of the controller so far.
    fn controller_log(&self) -> String {
        fs::read_to_string(self.folder.path().join("controller")).unwrap()
    }

    /// The trace of the servos so far.
    fn trace(&self) -> String {
        fs::read_to_string(self.folder.path().join("servos")).unwrap()
    }

    /// Did all writes to a torque switch so far have this value?
    fn has_set_all_torque_to(&self, code: u8) -> bool {
        torque_sets(&self.trace()).iter().all(|&(_, set)| set == code)
    }

    /// The torque switch of a servo, after the controller has ended.
    fn torque_switch(&self, id: u8) -> u8 {
        let mut bus = Bus::open(&self.bus(), 1_000_000);
        let checksum = !(id + 4 + 2 + register::TORQUE_SWITCH + 1);
        bus.ask(&[0xFF, 0xFF, id, 4, 2, register::TORQUE_SWITCH, 1, checksum], 7)[5]
    }

    fn torque_switches(&self) -> Vec<u8> {
        (0..7).map(|id| self.torque_switch(id)).collect()
    }

    /// Waits until the controller has found all servos and given them torque.
    fn wait_until_driven(&self) -> Client {
        let mut client = self.client();
        client.read_until(MISSING_SERVOS.address, &[0]);
        wait_until("all servos have torque", || {
            let sets = torque_sets(&self.trace());
            (0..7).all(|id| sets.contains(&(id, ON)))
        });
        client
    }
}

/// The frames of the controller in a trace.
fn frames(trace: &str) -> Vec<Question> {
    let pieces = trace.lines().filter_map(|line| line.split_once("-> [")?.1.strip_suffix(']'));
    let bytes = pieces.flat_map(|piece| piece.split(", ").map(|byte| u8::from_str_radix(byte, 16).unwrap()));
    let (mut decoder, mut frames) = (Decoder::new(), Vec::new());
    for byte in bytes {
        decoder.push(&[byte]);
        while let Some(frame) = decoder.pull() {
            let frame = frame.unwrap();
            frames.push((frame.code, frame.params.to_vec()));
        }
    }
    frames
}

/// The ids and values of all writes to torque switches. The parameters of such a frame are the register, the length of a value,
/// and pairs of id and value.
fn torque_sets(trace: &str) -> Vec<(u8, u8)> {
    let frames = frames(trace);
    assert!(frames.iter().all(|(code, _)| *code != Instruction::Write as u8), "no servo is written to alone");
    let torque = frames.iter().filter(|(code, params)| {
        *code == Instruction::SyncWrite as u8 && params.first() == Some(&register::TORQUE_SWITCH)
    });
    torque.flat_map(|(_, params)| params[2..].chunks(2).map(|pair| (pair[0], pair[1]))).collect()
}

fn near(is: &[u8], wanted: &[u8]) -> bool {
    is.iter().zip(wanted).all(|(is, wanted)| is.abs_diff(*wanted) <= 2)
}

fn wait_for_pose(client: &mut Client, pose: [u8; 7]) {
    wait_until("the arm stands in the pose", || near(&client.read(PRESENT_POSITION.address, 7), &pose));
}

#[test]
fn servos_at_another_rate_are_driven() {
    let rate = ["--servo-baud", "115200"];
    let rig = Rig::start(&rate, &[PATIENT.as_slice(), &rate].concat());
    let mut client = rig.wait_until_driven();
    wait_for_pose(&mut client, STANDARD_POSE);
}

#[test]
fn the_servos_are_damped_at_the_end() {
    for signal in [Signal::TERM, Signal::INT] {
        let mut rig = Rig::start(&["--usb-latency", "1-4"], &PATIENT);
        rig.wait_until_driven();
        assert!(rig.has_set_all_torque_to(ON));
        assert_eq!(rig.controller.end_with(signal), Some(0));
        assert_eq!(rig.torque_switches(), [DAMPING; 7], "after {signal:?}");
        assert!(rig.controller_log().contains("state 0: the servos are damped"));
    }
}

#[test]
fn hold_on_exit_leaves_the_servos_holding() {
    for signal in [Signal::TERM, Signal::INT] {
        let mut rig = Rig::start(&[], &[PATIENT.as_slice(), &["--hold-on-exit"]].concat());
        let mut client = rig.wait_until_driven();
        wait_for_pose(&mut client, STANDARD_POSE);
        assert_eq!(rig.controller.end_with(signal), Some(0));
        assert_eq!(rig.torque_switches(), [ON; 7], "after {signal:?}");
        assert!(rig.has_set_all_torque_to(ON));
    }
}

/// The next controller engages the arm where it stands (D12).
#[test]
fn d12_a_second_controller_finds_the_arm_holding_and_lets_no_joint_go() {
    let mut rig = Rig::start(&[], &[PATIENT.as_slice(), &["--hold-on-exit"]].concat());
    let pose = STANDARD_POSE.map(|degrees| degrees - 20);
    let mut client = rig.wait_until_driven();
    client.write(TARGET_POSITION.address, &pose);
    wait_for_pose(&mut client, pose);
    assert_eq!(rig.controller.end_with(Signal::TERM), Some(0));
    rig.controller = Rig::start_controller(rig.folder.path(), &PATIENT);
    let mut client = rig.client();
    client.read_until(MISSING_SERVOS.address, &[0]);
    wait_for_pose(&mut client, pose);
    wait_until("it aims for where the arm stands", || near(&client.read(TARGET_POSITION.address, 7), &pose));
    wait_for_pose(&mut client, pose);
    assert!(rig.has_set_all_torque_to(ON));
}

/// Silent joints hold, and engage only after a measurement (D12).
#[test]
fn d12_the_arm_holds_while_the_adapter_is_unplugged() {
    let rig = Rig::start(&["--usb-latency", "1-4"], &PATIENT);
    let mut client = rig.wait_until_driven();
    let pose = STANDARD_POSE.map(|degrees| degrees - 20);
    client.write(TARGET_POSITION.address, &pose);
    wait_for_pose(&mut client, pose);
    rig.servos.signal(Signal::USR1);
    wait_until("the link is gone", || !rig.bus().is_symlink());
    client.read_until(MISSING_SERVOS.address, &[ALL_MISSING]);
    assert_eq!(client.read(FAULTS.address, 1)[0] & fault::SERVO_BUS, fault::SERVO_BUS);
    assert!(rig.controller_log().contains("the adapter is gone"));
    rig.servos.signal(Signal::USR1);
    client.read_until(MISSING_SERVOS.address, &[0]);
    wait_until("the fault is over", || client.read(FAULTS.address, 1)[0] & fault::SERVO_BUS == 0);
    wait_for_pose(&mut client, pose);
    let trace = rig.trace();
    let (before, after) = trace.split_once("adapter plugged in").unwrap();
    assert!(torque_sets(before).iter().all(|&(_, code)| code == ON), "no joint is let go before");
    assert!(torque_sets(after).iter().all(|&(_, code)| code == ON), "nor after");
    assert_eq!(frames(after)[0].0, Instruction::Read as u8, "first comes a question");
    client.write(TARGET_POSITION.address, &STANDARD_POSE);
    wait_for_pose(&mut client, STANDARD_POSE);
}

#[test]
fn an_echo_of_the_adapter_has_no_effect() {
    for fault in [[].as_slice(), &["--fault", "bus=echo"]] {
        let rig = Rig::start(&[&["--usb-latency", "1-4"], fault].concat(), &PATIENT);
        let mut client = rig.wait_until_driven();
        for shift in [20, 0] {
            let pose = STANDARD_POSE.map(|degrees| degrees - shift);
            client.write(TARGET_POSITION.address, &pose);
            wait_for_pose(&mut client, pose);
        }
        assert_eq!(rig.trace().contains("<- [ff, ff, 00, 04, 02"), !fault.is_empty(), "questions come back");
    }
}

/// The program continues: the servos may get their power later.
#[test]
fn without_an_answer_of_any_servo_the_log_says_what_to_check() {
    let faults: Vec<String> = (1..=7).map(|joint| format!("{joint}=missing")).collect();
    let missing: Vec<&str> = faults.iter().flat_map(|fault| ["--fault", fault]).collect();
    let echo = [missing.as_slice(), &["--fault", "bus=echo"]].concat();
    let (silence, bytes) = ("nothing comes back at all", "but bytes come");
    let cases: [(&[&str], &str); 3] =
        [(&missing, silence), (&echo, bytes), (&["--servo-baud", "500000"], silence)];
    for (options, says) in cases {
        let mut rig = Rig::start(options, &["-q"]);
        let mut client = rig.client();
        client.read_until(MISSING_SERVOS.address, &[ALL_MISSING]);
        wait_until("it says what is wrong", || {
            let said = rig.controller_log();
            said.contains("no servo answers at 1000000 baud") && said.contains(says)
        });
        assert!(rig.controller_log().contains("sevenbot servo scan"));
        assert_eq!(rig.controller.end_with(Signal::TERM), Some(0));
    }
}

#[test]
fn a_port_that_cannot_be_used_is_refused_in_one_line() {
    let rig = Rig::start(&[], &[]);
    let bus = rig.bus();
    let said = refused(&["--eeprom", "none", "--servos", bus.to_str().unwrap()]);
    assert!(said.contains("another program uses the port") && said.contains("fuser"), "{said}");
    let absent = rig.folder.path().join("ttyUSB0");
    let said = refused(&["--eeprom", "none", "--servos", absent.to_str().unwrap()]);
    assert!(said.contains("there is no such port: plug the cable in"), "{said}");
    for wrong in ["/dev/null", rig.folder.path().to_str().unwrap()] {
        let said = refused(&["--eeprom", "none", "--servos", wrong]);
        assert!(said.contains("that is no serial port"), "{said}");
    }
}

/// Answers after the timeout are dropped. A longer timeout accepts them.
#[test]
fn answers_after_the_timeout_are_no_measurements() {
    let faults: Vec<String> = (1..=7).map(|joint| format!("{joint}=late=60")).collect();
    let late: Vec<&str> = faults.iter().flat_map(|fault| ["--fault", fault]).collect();
    let servos = [late.as_slice(), &["--fault", "arm=supported"]].concat();
    let mut rig = Rig::start(&servos, &["--usb-timeout", "5"]);
    let mut client = rig.client();
    let unmeasured = client.read(PRESENT_POSITION.address, 7);
    client.read_until(MISSING_SERVOS.address, &[ALL_MISSING]);
    wait_until("it says that bytes come", || rig.controller_log().contains("but bytes come"));
    assert!(rig.trace().contains("<- [ff, ff, 0"), "the servos do answer");
    for _ in 0..50 {
        let positions = client.read(PRESENT_POSITION.address, 7);
        let mut known = positions.iter().zip(&unmeasured).zip(STANDARD_POSE);
        let are_right = known.all(|((is, unmeasured), pose)| is == unmeasured || is.abs_diff(pose) <= 2);
        assert!(are_right, "{positions:?}");
    }
    assert_eq!(rig.controller.end_with(Signal::TERM), Some(0));
    rig.controller = Rig::start_controller(rig.folder.path(), &["--usb-timeout", "900"]);
    let mut client = rig.client();
    client.read_until(MISSING_SERVOS.address, &[0]);
    wait_for_pose(&mut client, STANDARD_POSE);
}
