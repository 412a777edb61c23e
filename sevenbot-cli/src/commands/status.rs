//! `status`: shows each joint, the servos and the supply, the problems and their remedies.

use std::io::{self, Write};

use clap::Args;
use serde::Serialize;
use sevenbot::health::{JointHealth, sentences};
use sevenbot::register_text::{motor_state_name, servo_alarms};
use sevenbot::{FineAngle, Health, Problem};

use crate::command_error::CommandError;
use crate::printer::Printable;
use crate::session::Session;
use crate::style::{BAD, BOLD, GOOD};

/// Show each joint, the servos and the supply: what is wrong, and what to do.
#[derive(Debug, Args)]
#[command(after_help = "\
A line for each joint: measured position, target, load in percent of the stall
torque, velocity, and what the joint does:

  moving, at its target, or how far it rests from its target
  holds something  joint 7 with effector type gripper (`sevenbot effector
                   gripper`)
  no answer        its servo does not answer; the position is the last one
  let go           its servo holds no torque although it should
  blocked          something kept it from its target for a second

The servos' temperatures and error bits are not told joint by joint: the line
above the table has the highest temperature, and the alarms of all servos
together. `sevenbot servo info` on an adapter shows those of one servo.

With the maker's firmware only positions and targets are known, and a dash
stands for the rest.

Exit status 1 if anything needs attention; `sevenbot recover` goes through what
to do.")]
pub(crate) struct StatusArgs {}

pub(crate) fn run(session: &mut Session) -> Result<(), CommandError> {
    let mut arm = session.connect()?;
    arm.wait_until_settled()?;
    let health = arm.health()?;
    session.printer.print(&ArmStatus::from(&health))?;
    match health.problems().as_slice() {
        [] => Ok(()),
        problems => Err(CommandError::Arm(sentences(problems))),
    }
}

/// The health of an arm, to be printed.
#[derive(Debug, Serialize)]
pub(crate) struct ArmStatus {
    needs_attention: bool,
    motor_state: &'static str,
    supply_volts: Option<f64>,
    hottest_servo_celsius: Option<u8>,
    alarms: Option<String>,
    alarm_bits: Option<u8>,
    supply_lost: Option<bool>,
    protection: Option<bool>,
    joints: Vec<JointLine>,
    problems: Vec<ProblemText>,
}

#[derive(Debug, Serialize)]
struct JointLine {
    joint: u8,
    position_degrees: Option<f64>,
    target_degrees: f64,
    load_percent: Option<f64>,
    degrees_per_second: Option<f64>,
    moving: Option<bool>,
    silent: Option<bool>,
    let_go: Option<bool>,
    blocked: Option<bool>,
    at_target: bool,
    state: String,
    #[serde(skip)]
    is_bad: bool,
}

#[derive(Debug, Serialize)]
pub(crate) struct ProblemText {
    kind: &'static str,
    joint: Option<u8>,
    text: String,
    remedy: &'static str,
}

impl From<&Problem> for ProblemText {
    fn from(problem: &Problem) -> Self {
        Self {
            kind: problem.kind.name(),
            joint: problem.joint.map(sevenbot::Joint::number),
            text: problem.to_string(),
            remedy: problem.kind.remedy(),
        }
    }
}

impl From<&Health> for ArmStatus {
    fn from(health: &Health) -> Self {
        let problems: Vec<ProblemText> = health.problems().iter().map(ProblemText::from).collect();
        Self {
            needs_attention: !problems.is_empty(),
            motor_state: motor_state_name(health.motor_state),
            supply_volts: health.supply_volts,
            hottest_servo_celsius: health.hottest_celsius,
            alarms: health.alarms.map(servo_alarms),
            alarm_bits: health.alarms,
            supply_lost: health.is_supply_lost,
            protection: health.is_protected,
            joints: health.joints.iter().map(|joint| JointLine::of(joint, health.is_driven())).collect(),
            problems,
        }
    }
}

impl JointLine {
    fn of(joint: &JointHealth, is_driven: bool) -> Self {
        Self {
            joint: joint.joint.number(),
            position_degrees: joint.position.map(FineAngle::degrees),
            target_degrees: joint.target.degrees(),
            load_percent: joint.load_percent,
            degrees_per_second: joint.velocity,
            moving: joint.is_moving,
            silent: joint.is_silent,
            let_go: joint.has_let_go,
            blocked: joint.is_blocked,
            at_target: joint.is_at_target,
            state: joint.word(is_driven),
            is_bad: joint.problems().next().is_some(),
        }
    }

    fn write_line(&self, out: &mut dyn Write) -> io::Result<()> {
        let number = |value: Option<f64>, decimals: usize, unit: &str| {
            value.map_or_else(|| "–".to_owned(), |value| format!("{value:.decimals$}{unit}"))
        };
        let position = number(self.position_degrees, 2, "°");
        let target = number(Some(self.target_degrees), 2, "°");
        let load = number(self.load_percent, 1, " %");
        let velocity = number(self.degrees_per_second, 1, " °/s");
        let (joint, state) = (self.joint, &self.state);
        let style = if self.is_bad { BAD } else { anstyle::Style::new() };
        writeln!(
            out,
            "{joint:>5}  {position:>8}  {target:>8}  {load:>8}  {velocity:>10}  {style}{state}{style:#}"
        )
    }
}

impl Printable for ArmStatus {
    fn write_text(&self, out: &mut dyn Write) -> io::Result<()> {
        let unknown = || "unknown".to_owned();
        let supply = self.supply_volts.map_or_else(unknown, |volts| format!("{volts:.1} V"));
        let hottest = self.hottest_servo_celsius.map_or_else(unknown, |degrees| format!("{degrees} °C"));
        let alarms = self.alarms.clone().unwrap_or_else(unknown);
        let protection = match self.protection {
            None => "unknown",
            Some(true) => "on",
            Some(false) => "off",
        };
        let motors = self.motor_state;
        writeln!(
            out,
            "motors {motors}, supply {supply}, hottest servo {hottest}, alarms {alarms}, protection {protection}"
        )?;
        writeln!(out, "{BOLD}joint  position    target      load    velocity  state{BOLD:#}")?;
        self.joints.iter().try_for_each(|joint| joint.write_line(out))?;
        write_problems(out, &self.problems)
    }
}

/// Writes each problem, with its remedy below it.
fn write_problems(out: &mut dyn Write, problems: &[ProblemText]) -> io::Result<()> {
    if problems.is_empty() {
        return writeln!(out, "{GOOD}nothing needs attention{GOOD:#}");
    }
    for ProblemText { text, remedy, .. } in problems {
        writeln!(out, "{BAD}{text}{BAD:#}\n  - {remedy}")?;
    }
    Ok(())
}
