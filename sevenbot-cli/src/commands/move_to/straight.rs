//! `move-to --straight`: plans a straight line, checks all of it, and plays it like a recording.

use std::io::{self, Write};

use serde::Serialize;
use sevenbot::cartesian::{
    DirectionText, PointText, StraightLine, StraightLineRequest, TargetResolution, TipPose, Vector,
};
use sevenbot::moves::LineStart;
use sevenbot::{Angle, FineAngle};

use super::super::play::follow;
use super::super::position::components;
use super::args::{MoveToArgs, target};
use super::facts::{MeasuredTip, rounded};
use crate::command_error::CommandError;
use crate::guard_args::refused_line;
use crate::measured_pose::MeasuredPose;
use crate::printer::Printable;
use crate::session::Session;

/// Moves the tip on a straight line, starting at the present targets.
pub(super) fn run(session: &mut Session, args: &MoveToArgs) -> Result<(), CommandError> {
    let mut arm = args.connect(session)?;
    let joints = if args.dry_run { arm.wait_until_settled()? } else { arm.driven_joints()? };
    let start = LineStart::of(&mut arm, &joints)?;
    let tool = args.tool().unwrap_or_else(|| TipPose::of_fine(start.targets).tool);
    // The error of this check names the point nearest to the end, and another direction of the tool. The error of the line is about
    // the point where the line breaks.
    target(args, tool)?;
    let line = start.line_to(args.tip(), tool, args.speed);
    let request = StraightLineRequest { guard: args.guard.guard(), ..line };
    let line = StraightLine::plan(&request).map_err(|reason| refused_line(&reason))?;
    let course = StraightMove::of(&line, &request);
    if args.dry_run {
        return session.printer.print(&course);
    }
    follow(&mut arm, &line.recording)?;
    let positions = arm.positions()?.map(Angle::degrees);
    let measured = MeasuredTip::of(MeasuredPose::read(&mut arm, positions)?, args.tip());
    session.printer.print(&StraightMove { measured: Some(measured), ..course })
}

/// A straight line: the plan, and the measured end.
#[derive(Debug, Serialize)]
struct StraightMove {
    start_mm: [f64; 3],
    asked_mm: [f64; 3],
    /// The direction of the tool at the end, of length 1.
    tool: [f64; 3],
    length_mm: f64,
    seconds: f64,
    targets: usize,
    period_ms: u64,
    /// The largest distance from the line, due to rounded angles.
    deviation_mm: f64,
    tilt_degrees: f64,
    /// The angle to which joint 4 turns before the line starts, without moving tip or tool. `None` if it stays.
    first_turn_degrees: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    measured: Option<MeasuredTip>,
    #[serde(skip)]
    direction: Vector,
    #[serde(skip)]
    rounded_to: &'static str,
}

impl StraightMove {
    fn of(line: &StraightLine, request: &StraightLineRequest) -> Self {
        Self {
            start_mm: components(line.start.tip, 100.0),
            asked_mm: components(request.tip, 100.0),
            tool: components(request.tool.unit().unwrap_or(request.tool), 10_000.0),
            length_mm: rounded(line.length_mm),
            seconds: rounded(line.duration.as_secs_f64()),
            targets: line.targets().count(),
            period_ms: u64::try_from(request.resolution.period().as_millis()).unwrap_or(u64::MAX),
            deviation_mm: rounded(line.deviation_mm),
            tilt_degrees: rounded(line.tilt_degrees),
            first_turn_degrees: line.first_turn.map(FineAngle::degrees),
            measured: None,
            direction: request.tool,
            rounded_to: match request.resolution {
                TargetResolution::Degrees => "whole degrees",
                TargetResolution::Hundredths => "hundredths of a degree",
            },
        }
    }
}

impl Printable for StraightMove {
    fn write_text(&self, out: &mut dyn Write) -> io::Result<()> {
        let Self { length_mm, seconds, targets, period_ms, deviation_mm, tilt_degrees, rounded_to, .. } =
            self;
        let decimals = if *rounded_to == "whole degrees" { 1 } else { 2 };
        let [from, to] = [self.start_mm, self.asked_mm].map(|[x, y, z]| PointText(Vector::new(x, y, z)));
        writeln!(out, "line     from {from} to {to} mm: {length_mm:.0} mm in {seconds:.1} s")?;
        writeln!(out, "tool     {} at the end", DirectionText(self.direction))?;
        writeln!(out, "targets  {targets}, one each {period_ms} ms")?;
        writeln!(
            out,
            "off      {rounded_to} take the tip up to {deviation_mm:.decimals$} mm from the line and tilt the tool by up \
             to {tilt_degrees:.decimals$}°"
        )?;
        if let Some(degrees) = self.first_turn_degrees {
            writeln!(out, "first    joint 4 turns to {degrees}°, which moves neither tip nor tool")?;
        }
        self.measured.as_ref().map_or(Ok(()), |measured| measured.write_text(out))
    }
}
