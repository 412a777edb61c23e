//! `info`: who the arm is, its settings, and how it is, in words.

use std::io::{self, Write};

use anstyle::{AnsiColor, Style};
use sevenbot::arm::STATUS;
use sevenbot::map::{
    BAUD_RATE, DEVICE_ID, EEPROM_LOCK, EFFECTOR_TYPE, FAULTS, FEEDBACK_FREQUENCY, FRAMES_ACCEPTED,
    FRAMES_CORRUPTED, FRAMES_REFUSED, LAST_REFUSAL, LAST_REFUSED_REGISTER, MISSING_SERVOS, MOTOR_STATE,
    MOVING_JOINTS, OFFSET, SERVO_BUS_ERRORS, SERVO_TEMPERATURE, STATUS_VERSION, SUPPLY_VOLTAGE, VACUUM_PUMP,
    refusal,
};
use sevenbot::names::name_of_register;
use sevenbot::words::{faults, joints, meaning, refusal_word};
use sevenbot::{Arm, Register, Snapshot, Span};

use crate::failure::Failure;

const BOLD: Style = Style::new().bold();
const GOOD: Style = AnsiColor::Green.on_default();
const BAD: Style = AnsiColor::Red.on_default().bold();

pub(crate) fn run(arm: &mut Arm, port: &str, baud: u32, out: &mut impl Write) -> Result<(), Failure> {
    let settings = arm.read_span(Span::between(&DEVICE_ID, &FEEDBACK_FREQUENCY))?;
    let status = arm.read_span(STATUS)?;
    writeln!(out, "{BOLD}7Bot V2{BOLD:#} on {port} at {baud} baud")?;
    line(out, "firmware", &arm.identity().version())?;
    line(out, "chip id", &arm.identity().chip_id().map(|byte| format!("{byte:02X}")).concat())?;
    show_settings(&settings, out)?;
    if status.byte(&STATUS_VERSION) == 0 {
        writeln!(out, "This firmware has no status block: it is the maker's own.")?;
        return Ok(());
    }
    show_health(&status, out)?;
    show_link(&status, out)?;
    healthy(&status)
}

fn line(out: &mut impl Write, name: &str, value: &str) -> io::Result<()> {
    writeln!(out, "  {name:<20}{value}")
}

fn show_settings(settings: &Snapshot, out: &mut impl Write) -> io::Result<()> {
    let word = |row: &Register| meaning(row, settings.byte(row));
    let offsets = settings.joints(&OFFSET).map(|byte| OFFSET.range.decode(byte).to_string());
    let feedback = match settings.byte(&FEEDBACK_FREQUENCY) {
        0 => "off".to_owned(),
        hertz => format!("{hertz} Hz"),
    };
    writeln!(out, "{BOLD}Settings{BOLD:#}")?;
    line(out, "device id", &settings.byte(&DEVICE_ID).to_string())?;
    line(out, "baud rate at start", &word(&BAUD_RATE))?;
    line(out, "offsets", &format!("{} °", offsets.join(" ")))?;
    line(out, "EEPROM lock", &word(&EEPROM_LOCK))?;
    line(out, "motor state", &word(&MOTOR_STATE))?;
    line(out, "effector", &format!("{}, {}", word(&EFFECTOR_TYPE), word(&VACUUM_PUMP)))?;
    line(out, "position feedback", &feedback)
}

fn show_health(status: &Snapshot, out: &mut impl Write) -> io::Result<()> {
    let judged = |row: &Register, words: String| {
        let style = if status.byte(row) == 0 { GOOD } else { BAD };
        format!("{style}{words}{style:#}")
    };
    let temperature = match status.byte(&SERVO_TEMPERATURE) {
        0 => "unknown".to_owned(),
        degrees => format!("{degrees} °C"),
    };
    writeln!(out, "{BOLD}Health{BOLD:#}")?;
    line(out, "faults", &judged(&FAULTS, faults(status.byte(&FAULTS))))?;
    line(out, "servos missing", &judged(&MISSING_SERVOS, joints(status.byte(&MISSING_SERVOS))))?;
    line(out, "moving", &joints(status.byte(&MOVING_JOINTS)))?;
    line(out, "supply", &meaning(&SUPPLY_VOLTAGE, status.byte(&SUPPLY_VOLTAGE)))?;
    line(out, "hottest servo", &temperature)
}

fn show_link(status: &Snapshot, out: &mut impl Write) -> io::Result<()> {
    let count = |row: &Register| status.counter(row).to_string();
    writeln!(out, "{BOLD}Counters{BOLD:#}")?;
    line(out, "frames accepted", &count(&FRAMES_ACCEPTED))?;
    line(out, "frames damaged", &count(&FRAMES_CORRUPTED))?;
    line(out, "frames refused", &count(&FRAMES_REFUSED))?;
    line(out, "last refusal", &last_refusal(status))?;
    line(out, "servo bus errors", &count(&SERVO_BUS_ERRORS))
}

fn last_refusal(status: &Snapshot) -> String {
    match status.byte(&LAST_REFUSAL) {
        refusal::NONE => refusal_word(refusal::NONE).to_owned(),
        reason => {
            let register = name_of_register(status.byte(&LAST_REFUSED_REGISTER));
            format!("{} ({register})", refusal_word(reason))
        }
    }
}

fn healthy(status: &Snapshot) -> Result<(), Failure> {
    let faulty = faults(status.byte(&FAULTS));
    match (status.byte(&FAULTS), status.byte(&MISSING_SERVOS)) {
        (0, 0) => Ok(()),
        (0, missing) => Err(Failure::Arm(format!("no answer from the servos of {}", joints(missing)))),
        (_, 0) => Err(Failure::Arm(format!("the arm reports a fault: {faulty}"))),
        (_, missing) => {
            let missing = joints(missing);
            Err(Failure::Arm(format!("the arm reports a fault: {faulty}; no answer from {missing}")))
        }
    }
}
