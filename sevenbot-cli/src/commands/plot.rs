//! `plot`: draws the way of the tip in a recording as SVG.

use std::path::PathBuf;

use clap::Args;
use sevenbot::FineAngle;
use sevenbot::cartesian::TipPose;
use sevenbot::recording::{Moment, Recording};

use crate::command_error::CommandError;
use crate::input_file;
use crate::output_file::{ForceArg, OutputFile};
use crate::session::Session;
use crate::space_plot::{WayPoint, drawing};

/// Plot the way of the tip in a recording, as SVG.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  sevenbot plot move.txt > move.svg
  sevenbot plot move.txt --out move.svg

Needs no arm. Shows the way from above, from the front and from the right side,
in millimetres from the middle of the base. `sevenbot play --plot` shows the
joints over time.")]
pub(crate) struct PlotArgs {
    /// A recording of `sevenbot record`, or one written by hand; - is standard input.
    file: PathBuf,
    /// The file to write; standard output if not given.
    #[arg(long, value_name = "SVG")]
    out: Option<PathBuf>,
    #[command(flatten)]
    force: ForceArg,
}

pub(crate) fn run(session: &mut Session, args: &PlotArgs) -> Result<(), CommandError> {
    let recording = input_file::recording(&args.file)?;
    let name = args.file.file_name().unwrap_or_default().to_string_lossy();
    let drawing = drawing(&name, &way(&recording));
    match &args.out {
        Some(path) => OutputFile::open(path, Some(&args.file), args.force)?.write(drawing.as_bytes()),
        None => session.printer.print_raw(drawing.as_bytes()),
    }
}

/// The way of the tip. Between two moments the joints move evenly, so the tip moves on a curve.
fn way(recording: &Recording) -> Vec<WayPoint> {
    let moments: Vec<Moment> = recording.moments().collect();
    let pairs = moments.iter().zip(moments.iter().skip(1));
    let between = pairs.flat_map(|(from, to)| points_between(from, to));
    let last = moments
        .last()
        .map(|moment| WayPoint { tip: TipPose::of_fine(moment.pose).tip, vacuum: moment.vacuum });
    between.chain(last).collect()
}

/// One point for each degree of the joint that turns most, and at least one. Begins at `from`, and excludes `to`.
fn points_between(from: &Moment, to: &Moment) -> impl Iterator<Item = WayPoint> {
    let turns = from
        .pose
        .iter()
        .zip(to.pose)
        .map(|(from, to)| from.nearest().degrees().abs_diff(to.nearest().degrees()));
    let steps = turns.max().unwrap_or_default().max(1);
    let ([t1, t2, t3, t4, t5, t6, _], end, vacuum) = (from.pose, to.pose, from.vacuum);
    (0..steps).map(move |step| {
        let share = f64::from(step) / f64::from(steps);
        let mut angles = [t1, t2, t3, t4, t5, t6].map(FineAngle::degrees);
        for (angle, end) in angles.iter_mut().zip(end) {
            *angle += (end.degrees() - *angle) * share;
        }
        WayPoint { tip: TipPose::at(angles).tip, vacuum }
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_way_is_a_curve_from_the_first_pose_to_the_last() {
        let text = "7bot-recording 1\n0 90 90 65 90 90 90 80 0\n1 60 90 65 90 90 90 80 1\n2 60 90 65 90 90 90 80 0\n";
        let way = way(&Recording::parse(text).expect("a recording"));
        assert_eq!(way.len(), 30 + 1 + 1, "a point per degree, one for the rest, and the end");
        let radius = |point: &WayPoint| point.tip.x.hypot(point.tip.y);
        assert!(way.iter().all(|point| (radius(point) - 250.31).abs() < 1e-9), "a circle round the base");
        assert_eq!(way.iter().filter(|point| point.vacuum).count(), 1);
    }
}
