//! The monitor without a screen: one line per sample, as columns, CSV or JSON.

use std::io::{self, Write};

use serde::Serialize;
use sevenbot::fine::FineState;
use sevenbot::health::JointHealth;
use sevenbot::{FineAngle, Joint, StatusBlock};

use super::super::status::ProblemText;
use super::sample::ArmSample;
use crate::printer::Printable;

/// Text format of a sample.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum LineFormat {
    /// Seconds, seven targets, seven positions, and the moving joints.
    Columns,
    /// Also speeds, status and measured values, separated by commas.
    Csv,
}

impl LineFormat {
    /// The line with the names of the columns, without a line feed.
    pub(crate) fn head(self) -> String {
        let joints = |word: &str| Joint::ALL.map(|joint| format!("{word}.{}", joint.number()));
        match self {
            Self::Columns => {
                format!("seconds {} {} moving", joints("target").join(" "), joints("present").join(" "))
            }
            Self::Csv => format!(
                "seconds,{},{},{},{},motor_state,faults,missing,supply_volts,hottest_celsius,round_trip_ms,{},{},{},\
                 blocked,let_go,alarms,supply_lost",
                joints("target").join(","),
                joints("present").join(","),
                joints("degrees_per_second").join(","),
                joints("moving").join(","),
                joints("fine_position").join(","),
                joints("velocity").join(","),
                joints("load_percent").join(",")
            ),
        }
    }

    /// The line of one sample, without a line feed.
    pub(crate) fn line(self, sample: &ArmSample) -> String {
        match self {
            Self::Columns => columns(sample),
            Self::Csv => csv(sample),
        }
    }
}

fn columns(sample: &ArmSample) -> String {
    let targets = sample.joints.targets().map(|degrees| degrees.to_string()).join(" ");
    let present = sample.joints.positions().map(|degrees| degrees.to_string()).join(" ");
    let moving: String = numbers(|joint| sample.joints.is_moving(joint)).iter().map(u8::to_string).collect();
    let moving = if moving.is_empty() { "-" } else { &moving };
    format!("{:.3} {targets} {present} {moving}", sample.time.as_secs_f64())
}

fn csv(sample: &ArmSample) -> String {
    let joints =
        |field: fn(&ArmSample, Joint) -> String| Joint::ALL.map(|joint| field(sample, joint)).join(",");
    let status = sample.joints.status();
    let number = |value: Option<u8>| value.map_or_else(String::new, |value| value.to_string());
    let volts = status.and_then(StatusBlock::supply_volts);
    [
        format!("{:.3}", sample.time.as_secs_f64()),
        joints(|sample, joint| sample.joints.target(joint).to_string()),
        joints(|sample, joint| sample.joints.present(joint).to_string()),
        joints(|sample, joint| format!("{:.1}", sample.joints.speed(joint).degrees_per_second())),
        joints(|sample, joint| u8::from(sample.joints.is_moving(joint)).to_string()),
        sample.joints.motor_state().to_string(),
        number(status.map(StatusBlock::faults)),
        number(status.map(StatusBlock::missing)),
        volts.map_or_else(String::new, |volts| format!("{volts:.1}")),
        number(status.and_then(StatusBlock::hottest_celsius)),
        format!("{:.1}", sample.round_trip.as_secs_f64() * 1e3),
        optional(sample.fine.map(|fine| fine.positions.map(|angle| angle.map(FineAngle::degrees))), 2),
        optional(sample.fine.map(|fine| fine.velocities.map(|tenths| Some(f64::from(tenths) / 10.0))), 1),
        optional(sample.fine.map(|fine| fine.loads.map(|tenths| Some(f64::from(tenths) / 10.0))), 1),
        number(joint_bits(sample, |joint| joint.is_blocked)),
        number(joint_bits(sample, |joint| joint.has_let_go)),
        number(sample.health.alarms),
        number(sample.health.is_supply_lost.map(u8::from)),
    ]
    .join(",")
}

/// The bits of the joints for which `is_so` is true; `None` if the firmware does not report it.
fn joint_bits(sample: &ArmSample, is_so: fn(&JointHealth) -> Option<bool>) -> Option<u8> {
    sample
        .health
        .joints
        .iter()
        .try_fold(0, |bits, joint| Some(if is_so(joint)? { bits | joint.joint.bit() } else { bits }))
}

/// Seven fields, empty where there is no number.
fn optional(values: Option<[Option<f64>; 7]>, decimals: usize) -> String {
    let field = |value: Option<f64>| value.map_or_else(String::new, |value| format!("{value:.decimals$}"));
    values.unwrap_or_default().map(field).join(",")
}

fn numbers(is_so: impl Fn(Joint) -> bool) -> Vec<u8> {
    Joint::ALL.into_iter().filter(|&joint| is_so(joint)).map(Joint::number).collect()
}

#[derive(Debug, Serialize)]
pub(crate) struct SampleJson {
    seconds: f64,
    targets: [u8; 7],
    positions: [u8; 7],
    degrees_per_second: [f64; 7],
    moving: Vec<u8>,
    missing: Vec<u8>,
    motor_state: u8,
    faults: Option<u8>,
    supply_volts: Option<f64>,
    hottest_celsius: Option<u8>,
    round_trip_ms: f64,
    alarms: Option<u8>,
    problems: Vec<ProblemText>,
    #[serde(skip_serializing_if = "Option::is_none")]
    fine: Option<FineJson>,
}

/// The values of the extended block.
#[derive(Debug, Serialize)]
struct FineJson {
    positions: [Option<f64>; 7],
    degrees_per_second: [f64; 7],
    load_percent: [f64; 7],
}

impl From<FineState> for FineJson {
    fn from(fine: FineState) -> Self {
        let tenths = |values: [i16; 7]| values.map(|tenths| f64::from(tenths) / 10.0);
        Self {
            positions: fine.positions.map(|angle| angle.map(FineAngle::degrees)),
            degrees_per_second: tenths(fine.velocities),
            load_percent: tenths(fine.loads),
        }
    }
}

impl From<&ArmSample> for SampleJson {
    fn from(sample: &ArmSample) -> Self {
        let status = sample.joints.status();
        Self {
            seconds: thousandths(sample.time.as_secs_f64()),
            targets: sample.joints.targets(),
            positions: sample.joints.positions(),
            degrees_per_second: Joint::ALL
                .map(|joint| thousandths(sample.joints.speed(joint).degrees_per_second())),
            moving: numbers(|joint| sample.joints.is_moving(joint)),
            missing: numbers(|joint| sample.joints.is_missing(joint)),
            motor_state: sample.joints.motor_state(),
            faults: status.map(StatusBlock::faults),
            supply_volts: status.and_then(StatusBlock::supply_volts),
            hottest_celsius: status.and_then(StatusBlock::hottest_celsius),
            round_trip_ms: thousandths(sample.round_trip.as_secs_f64() * 1e3),
            alarms: sample.health.alarms,
            problems: sample.health.problems().iter().map(ProblemText::from).collect(),
            fine: sample.fine.map(FineJson::from),
        }
    }
}

fn thousandths(value: f64) -> f64 {
    (value * 1e3).round() / 1e3
}

impl Printable for SampleJson {
    fn write_text(&self, out: &mut dyn Write) -> io::Result<()> {
        writeln!(out, "{:.3} {:?}", self.seconds, self.positions)
    }
}
