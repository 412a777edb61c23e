//! `info`: identity, settings and health of the arm.

use std::io::{self, Write};

use clap::Args;
use serde::{Serialize, Serializer};
use sevenbot::map::{
    BAUD_RATE, DEVICE_ID, EEPROM_LOCK, EFFECTOR_TYPE, FEEDBACK_FREQUENCY, MOTOR_STATE, OFFSET, VACUUM_PUMP,
    baud_rate,
};
use sevenbot::names::name_of_register;
use sevenbot::register_text::{faults, joints, meaning, refusal_reason};
use sevenbot::{Arm, Firmware, Joint, Register, Snapshot, Span, StatusBlock};

use crate::command_error::CommandError;
use crate::printer::Printable;
use crate::session::Session;
use crate::style::{BAD, BOLD, GOOD};

/// Show identity, settings and health of the arm.
#[derive(Debug, Args)]
#[command(after_help = "\
Exit status 1 when the arm reports a fault or a servo does not answer.")]
pub(crate) struct InfoArgs {}

pub(crate) fn run(session: &mut Session) -> Result<(), CommandError> {
    let mut arm = session.connect()?;
    let settings = arm.read_span(Span::between(&DEVICE_ID, &FEEDBACK_FREQUENCY))?;
    let status = arm.status()?;
    session.printer.print(&ArmInfo {
        identity: ArmIdentity::of(&arm),
        settings: ArmSettings::from(&settings),
        health: status.as_ref().map(HealthFigures::from),
    })?;
    match arm.health()?.problems() {
        problems if problems.is_empty() => Ok(()),
        problems => Err(CommandError::Problems(problems)),
    }
}

#[derive(Serialize)]
struct ArmInfo {
    #[serde(flatten)]
    identity: ArmIdentity,
    settings: ArmSettings,
    /// `None` unless the arm has this project's firmware.
    health: Option<HealthFigures>,
}

#[derive(Serialize)]
struct ArmIdentity {
    port: String,
    baud: u32,
    firmware: String,
    makers_firmware: bool,
    chip_id: String,
}

#[derive(Serialize)]
struct ArmSettings {
    device_id: u8,
    baud_rate: u32,
    offsets_degrees: [i16; 7],
    eeprom_lock: String,
    motor_state: String,
    effector: String,
    vacuum: String,
    feedback_hertz: u8,
}

#[derive(Serialize)]
struct HealthFigures {
    healthy: bool,
    faults: String,
    fault_bits: u8,
    #[serde(serialize_with = "joint_numbers")]
    missing_joints: u8,
    #[serde(serialize_with = "joint_numbers")]
    moving_joints: u8,
    supply_volts: Option<f64>,
    hottest_servo_celsius: Option<u8>,
    frames_accepted: u16,
    frames_damaged: u16,
    frames_refused: u16,
    last_refusal: Option<String>,
    servo_bus_errors: u16,
}

impl ArmIdentity {
    fn of(arm: &Arm) -> Self {
        let identity = arm.identity();
        Self {
            port: arm.port().to_owned(),
            baud: arm.options().baud,
            firmware: identity.version(),
            makers_firmware: identity.firmware() == Firmware::Makers,
            chip_id: identity.chip_name(),
        }
    }
}

impl From<&Snapshot> for ArmSettings {
    fn from(registers: &Snapshot) -> Self {
        let word = |row: &Register| meaning(row, registers.byte(row));
        Self {
            device_id: registers.byte(&DEVICE_ID),
            baud_rate: baud_rate(registers.byte(&BAUD_RATE)),
            offsets_degrees: registers.joints(&OFFSET).map(|byte| OFFSET.range.decode_byte(byte)),
            eeprom_lock: word(&EEPROM_LOCK),
            motor_state: word(&MOTOR_STATE),
            effector: word(&EFFECTOR_TYPE),
            vacuum: word(&VACUUM_PUMP),
            feedback_hertz: registers.byte(&FEEDBACK_FREQUENCY),
        }
    }
}

impl From<&StatusBlock> for HealthFigures {
    fn from(status: &StatusBlock) -> Self {
        Self {
            healthy: status.is_healthy(),
            faults: faults(status.faults()),
            fault_bits: status.faults(),
            missing_joints: status.missing(),
            moving_joints: status.moving(),
            supply_volts: status.supply_volts(),
            hottest_servo_celsius: status.hottest_celsius(),
            frames_accepted: status.frames_accepted(),
            frames_damaged: status.frames_corrupted(),
            frames_refused: status.frames_refused(),
            last_refusal: status.last_refusal().map(|(reason, register)| {
                format!("{} ({})", refusal_reason(reason), name_of_register(register))
            }),
            servo_bus_errors: status.servo_bus_errors(),
        }
    }
}

fn line(out: &mut dyn Write, name: &str, value: &str) -> io::Result<()> {
    writeln!(out, "  {name:<20}{value}")
}

impl Printable for ArmInfo {
    fn write_text(&self, out: &mut dyn Write) -> io::Result<()> {
        let ArmIdentity { port, baud, firmware, chip_id, .. } = &self.identity;
        writeln!(out, "{BOLD}7Bot V2{BOLD:#} on {port} at {baud} baud")?;
        line(out, "firmware", firmware)?;
        line(out, "chip id", chip_id)?;
        self.settings.write_text(out)?;
        match &self.health {
            Some(health) => health.write_text(out),
            None => Ok(()),
        }
    }
}

impl Printable for ArmSettings {
    fn write_text(&self, out: &mut dyn Write) -> io::Result<()> {
        let offsets = self.offsets_degrees.map(|degrees| degrees.to_string()).join(" ");
        let feedback = match self.feedback_hertz {
            0 => "off".to_owned(),
            hertz => format!("{hertz} Hz"),
        };
        writeln!(out, "{BOLD}Settings{BOLD:#}")?;
        line(out, "device id", &self.device_id.to_string())?;
        line(out, "baud rate at start", &format!("{} baud", self.baud_rate))?;
        line(out, "offsets", &format!("{offsets} °"))?;
        line(out, "EEPROM lock", &self.eeprom_lock)?;
        line(out, "motor state", &self.motor_state)?;
        line(out, "effector", &format!("{}, {}", self.effector, self.vacuum))?;
        line(out, "position feedback", &feedback)
    }
}

/// Serializes joint bits as joint numbers.
#[expect(clippy::trivially_copy_pass_by_ref, reason = "serde's own way of calling")]
fn joint_numbers<S: Serializer>(bits: &u8, serializer: S) -> Result<S::Ok, S::Error> {
    serializer
        .collect_seq(Joint::ALL.iter().filter(|joint| bits & joint.bit() != 0).map(|joint| joint.number()))
}

impl Printable for HealthFigures {
    fn write_text(&self, out: &mut dyn Write) -> io::Result<()> {
        let styled = |is_good: bool, words: &str| {
            let style = if is_good { GOOD } else { BAD };
            format!("{style}{words}{style:#}")
        };
        let supply = self.supply_volts.map(|volts| format!("{volts:.1} V"));
        let hottest = self.hottest_servo_celsius.map(|degrees| format!("{degrees} °C"));
        writeln!(out, "{BOLD}Health{BOLD:#}")?;
        line(out, "faults", &styled(self.fault_bits == 0, &self.faults))?;
        line(out, "servos missing", &styled(self.missing_joints == 0, &joints(self.missing_joints)))?;
        line(out, "moving", &joints(self.moving_joints))?;
        line(out, "supply", supply.as_deref().unwrap_or("unknown"))?;
        line(out, "hottest servo", hottest.as_deref().unwrap_or("unknown"))?;
        self.write_counters(out)
    }
}

impl HealthFigures {
    fn write_counters(&self, out: &mut dyn Write) -> io::Result<()> {
        writeln!(out, "{BOLD}Counters{BOLD:#}")?;
        line(out, "frames accepted", &self.frames_accepted.to_string())?;
        line(out, "frames damaged", &self.frames_damaged.to_string())?;
        line(out, "frames refused", &self.frames_refused.to_string())?;
        line(out, "last refusal", self.last_refusal.as_deref().unwrap_or("none"))?;
        line(out, "servo bus errors", &self.servo_bus_errors.to_string())
    }
}
