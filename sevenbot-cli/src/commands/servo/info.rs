//! `servo info`: shows the registers of one servo.

use std::io::{self, Write};

use clap::Args;
use serde::Serialize;
use sevenbot::servo_bench::servo_info::{ServoInfo, error_words};

use super::port::{Rate, exchange_error, id, open};
use crate::command_error::CommandError;
use crate::printer::Printable;
use crate::session::Session;
use crate::style::{BAD, BOLD, GOOD};

/// Show measurements, goal and limits of one servo.
///
/// Only reads: the servo does not move.
#[derive(Debug, Args)]
#[command(after_help = "\
The degrees are those of the joint that an id from 0 to 6 belongs to, without
the joint's offset: offsets are stored in the arm's controller.

Exit status 1 when the servo reports an error.

Examples:
  sevenbot servo info 0
  sevenbot servo info 1 --rate 115200 --json")]
pub(super) struct ServoInfoArgs {
    /// The servo's id.
    #[arg(value_parser = id())]
    id: u8,
    #[command(flatten)]
    rate: Rate,
}

pub(super) fn run(session: &mut Session, args: &ServoInfoArgs) -> Result<(), CommandError> {
    let mut bus = open(session, args.rate.rate)?;
    match ServoInfo::read(&mut bus, args.id) {
        Ok(servo) => {
            session.printer.print(&ServoSummary::from(&servo))?;
            healthy(&servo)
        }
        Err(error) => Err(exchange_error(session, bus, error)),
    }
}

fn healthy(servo: &ServoInfo) -> Result<(), CommandError> {
    match servo.errors {
        0 => Ok(()),
        errors => Err(CommandError::Arm(format!("servo {} reports: {}", servo.id, error_words(errors)))),
    }
}

#[derive(Serialize)]
struct ServoSummary {
    id: u8,
    joint: Option<u8>,
    /// None if the position is outside 0 to 1023 counts.
    measured: Option<ServoMeasurements>,
    moving: bool,
    errors: String,
    error_bits: u8,
    torque_switch: u8,
    goal_counts: u16,
    limits: ServoLimits,
    baud: Option<u32>,
    eeprom_locked: bool,
    acknowledges_writes: bool,
    firmware_version: String,
    servo_version: String,
    byte_order: u8,
}

#[derive(Serialize)]
struct ServoMeasurements {
    position_counts: u16,
    position_degrees: Option<f64>,
    speed_counts_per_second: i16,
    load_percent: f64,
    supply_volts: f64,
    temperature_celsius: u8,
}

#[derive(Serialize)]
struct ServoLimits {
    min_position_counts: u16,
    max_position_counts: u16,
    min_supply_volts: f64,
    max_supply_volts: f64,
    max_temperature_celsius: u8,
    max_torque_percent: f64,
    torque_off_at: String,
}

fn tenths(value: impl Into<f64>) -> f64 {
    value.into() / 10.0
}

fn version((major, minor): (u8, u8)) -> String {
    format!("{major}.{minor}")
}

impl From<&ServoInfo> for ServoSummary {
    fn from(servo: &ServoInfo) -> Self {
        Self {
            id: servo.id,
            joint: servo.joint().map(sevenbot::Joint::number),
            measured: measured(servo),
            moving: servo.is_moving,
            errors: error_words(servo.errors),
            error_bits: servo.errors,
            torque_switch: servo.torque_switch,
            goal_counts: servo.goal_position,
            limits: ServoLimits::from(servo),
            baud: servo.baud,
            eeprom_locked: !servo.is_unlocked,
            acknowledges_writes: servo.acknowledges_writes,
            firmware_version: version(servo.firmware_version),
            servo_version: version(servo.servo_version),
            byte_order: servo.byte_order,
        }
    }
}

fn measured(servo: &ServoInfo) -> Option<ServoMeasurements> {
    let reading = servo.reading?;
    Some(ServoMeasurements {
        position_counts: reading.position_counts,
        position_degrees: servo.degrees().map(|degrees| (degrees * 10.0).round() / 10.0),
        speed_counts_per_second: reading.speed,
        load_percent: tenths(reading.load),
        supply_volts: tenths(reading.voltage_decivolts),
        temperature_celsius: reading.temperature_celsius,
    })
}

impl From<&ServoInfo> for ServoLimits {
    fn from(servo: &ServoInfo) -> Self {
        let (min_position_counts, max_position_counts) = servo.position_limits;
        let (min_supply, max_supply) = servo.voltage_limits;
        Self {
            min_position_counts,
            max_position_counts,
            min_supply_volts: tenths(min_supply),
            max_supply_volts: tenths(max_supply),
            max_temperature_celsius: servo.max_temperature,
            max_torque_percent: tenths(servo.max_torque),
            torque_off_at: error_words(servo.unload_conditions),
        }
    }
}

impl Printable for ServoSummary {
    fn write_text(&self, out: &mut dyn Write) -> io::Result<()> {
        let joint = self.joint.map_or_else(|| "no joint's id".to_owned(), |joint| format!("joint {joint}"));
        writeln!(out, "{BOLD}Servo {}{BOLD:#}, {joint}", self.id)?;
        match &self.measured {
            Some(measured) => measured.write_text(out)?,
            None => line(out, "position", &format!("{BAD}none between 0 and 1023 counts{BAD:#}"))?,
        }
        line(out, "moving", if self.moving { "yes" } else { "no" })?;
        let colour = if self.error_bits == 0 { GOOD } else { BAD };
        line(out, "errors", &format!("{colour}{}{colour:#}", self.errors))?;
        line(out, "torque switch", &format!("{}{}", self.torque_switch, torque_word(self.torque_switch)))?;
        line(out, "goal", &format!("{} counts", self.goal_counts))?;
        self.limits.write_text(out)?;
        self.write_settings(out)
    }
}

/// Codes 0 and 2 mean damping or free, depending on the servo's table.
const fn torque_word(code: u8) -> &'static str {
    match code {
        0 | 2 => " (no torque; `sevenbot servo torque-codes` finds out which kind)",
        1 => " (on)",
        _ => " (unknown)",
    }
}

impl ServoSummary {
    fn write_settings(&self, out: &mut dyn Write) -> io::Result<()> {
        writeln!(out, "{BOLD}Settings{BOLD:#}")?;
        let baud = self.baud.map_or_else(|| "unknown code".to_owned(), |baud| format!("{baud} baud"));
        line(out, "baud rate", &baud)?;
        line(out, "EEPROM lock", if self.eeprom_locked { "locked" } else { "open" })?;
        line(out, "writes", if self.acknowledges_writes { "acknowledged" } else { "not acknowledged" })?;
        line(
            out,
            "firmware",
            &format!("{} (registers 0, 1; undefined in older tables)", self.firmware_version),
        )?;
        line(out, "servo version", &format!("{} (registers 3, 4)", self.servo_version))?;
        let order = if self.byte_order == 1 { "high byte first" } else { "undefined, or low byte first" };
        line(out, "byte order", &format!("{order} (register 2 is {})", self.byte_order))
    }
}

impl ServoMeasurements {
    fn write_text(&self, out: &mut dyn Write) -> io::Result<()> {
        let degrees = self.position_degrees.map(|degrees| format!(", {degrees:.1}° without offset"));
        let position = format!("{} counts{}", self.position_counts, degrees.unwrap_or_default());
        line(out, "position", &position)?;
        line(out, "speed", &format!("{} counts/s", self.speed_counts_per_second))?;
        line(out, "load", &format!("{:.1} %", self.load_percent))?;
        line(out, "supply", &format!("{:.1} V", self.supply_volts))?;
        line(out, "temperature", &format!("{} °C", self.temperature_celsius))
    }
}

impl ServoLimits {
    fn write_text(&self, out: &mut dyn Write) -> io::Result<()> {
        writeln!(out, "{BOLD}Limits{BOLD:#}")?;
        let (lowest, highest) = (self.min_position_counts, self.max_position_counts);
        let endless = if (lowest, highest) == (0, 0) { ": the motor turns without end" } else { "" };
        line(out, "position", &format!("{lowest} to {highest} counts{endless}"))?;
        line(out, "supply", &format!("{:.1} to {:.1} V", self.min_supply_volts, self.max_supply_volts))?;
        line(out, "temperature", &format!("{} °C", self.max_temperature_celsius))?;
        line(out, "torque", &format!("{:.1} % of stall", self.max_torque_percent))?;
        line(out, "torque off at", &self.torque_off_at)
    }
}

fn line(out: &mut dyn Write, name: &str, value: &str) -> io::Result<()> {
    writeln!(out, "  {name:<15} {value}")
}
