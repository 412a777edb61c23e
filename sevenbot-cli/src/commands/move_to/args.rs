//! The arguments of `move-to`, and the check of the point.

use clap::Args;
use sevenbot::Arm;
use sevenbot::cartesian::{DOWN, TipTarget, Vector};

use crate::command_error::CommandError;
use crate::guard_args::{GuardArgs, millimetres, refused};
use crate::session::Session;

/// Move the tip to a point, in millimetres.
///
/// The whole move is checked before the arm moves. If the point is out of reach, below the table or in the base, the error
/// gives the nearest point to which the arm can go.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  sevenbot move-to 0 185 50  with the tool straight down
  sevenbot move-to -50 185 50 --wait
                             to the left of it; waits and shows where the tip is
  sevenbot move-to 0 300 150 --tool 0 1 0
                             with the tool forward
  sevenbot move-to 0 300 150 --tool 0 1 -1
                             with the tool forward and down by 45 degrees
  sevenbot move-to 20 250 219 --keep-tool
                             with the tool as it points now
  sevenbot move-to 0 500 50 --dry-run
                             is it within reach? Needs no arm
  sevenbot move-to 60 200 50 --straight --speed 20mm/s
                             on a straight line
  sevenbot move-to 0 185 60 --table 30
                             nothing goes below z = 30: a suction cup of 90 mm

Positions are millimetres from the point where the axis of the base meets the
top plate: x to the right, y forward, z up. The tip is the middle of the disc
that joint 6 turns; add the length of a suction cup or claw. `sevenbot where`
shows where the tip is.

With this project's firmware the joints go to hundredths of a degree, and the
tip misses the point by less than 0.1 mm. Other arms take whole degrees, and it
misses by about a millimetre. The miss is shown. The joints move at their speeds
(`sevenbot get speed`), and without --straight the tip takes no straight way.
Joints 6 and 7 keep their angles.

With --straight the whole line is checked before anything moves: reach, limits,
singular positions and the speed of each joint. It begins where the joints are
sent now. The tool turns evenly on the way. The arm gets a target in hundredths
of a degree each 20 ms, others one in whole degrees each 50 ms. The largest
distance from the line that the rounding causes is shown.

The guard keeps elbow, forearm, wrist, hand, tip and the edge of the disc above
the table, and 10 mm away from the base: 88 mm round its axis, up to 10 mm
above the top plate. It checks the point and the whole way there: the joints
from their measured positions, every 0.1 degrees, or the straight line. A
suction cup or claw on the disc is not known to it: set --table higher by its
length. An arm that is inside already may leave. --dry-run without
--keep-tool and --straight checks the point only. --no-guard checks none of
this: the arm may hit the table and its own base, and the nearest point in an
error may be inside them.

Ctrl-C leaves the arm holding where it is.

Exit status 1 when the point is out of reach or not allowed, when the arm did
not take the move, or with --wait did not reach it.")]
pub(crate) struct MoveToArgs {
    /// Millimetres to the right of the base axis; negative to the left.
    #[arg(allow_negative_numbers = true, value_parser = millimetres)]
    x: f64,
    /// Millimetres in front of the base axis.
    #[arg(allow_negative_numbers = true, value_parser = millimetres)]
    y: f64,
    /// Millimetres above the top plate.
    #[arg(allow_negative_numbers = true, value_parser = millimetres)]
    z: f64,
    /// Direction from the wrist to the tip, of any length. Straight down (0 0 -1) if not given.
    #[arg(long, value_names = ["X", "Y", "Z"], num_args = 3, allow_negative_numbers = true,
          value_parser = millimetres, conflicts_with = "keep_tool")]
    tool: Option<Vec<f64>>,
    /// Keep the present direction of the tool.
    #[arg(long)]
    keep_tool: bool,
    /// Move the tip on a straight line from the present targets, and wait for the end.
    #[arg(long)]
    pub(super) straight: bool,
    /// Speed of the tip on the straight line, 1mm/s to 500mm/s.
    #[arg(long, value_name = "MM/S", default_value = "50mm/s", requires = "straight",
          allow_hyphen_values = true, value_parser = speed)]
    pub(super) speed: f64,
    /// Wait until the joints have arrived, and show the position of the tip.
    #[arg(long)]
    pub(super) wait: bool,
    /// Check and show the move, but do not move.
    #[arg(long)]
    pub(super) dry_run: bool,
    #[command(flatten)]
    pub(super) guard: GuardArgs,
}

/// Parses a speed of the tip, as 40mm/s or 40.
fn speed(text: &str) -> Result<f64, &'static str> {
    let number = text.strip_suffix("mm/s").unwrap_or(text);
    let speed = number.parse().ok().filter(|speed| (1.0..=500.0).contains(speed));
    speed.ok_or("a speed of the tip from 1 to 500 mm/s, as 40mm/s or 40")
}

impl MoveToArgs {
    /// Opens the arm; with --dry-run, without the preparations of [`Session::connect_to_move`].
    pub(super) fn connect(&self, session: &Session) -> Result<Arm, CommandError> {
        if self.dry_run { session.connect() } else { session.connect_to_move() }
    }

    pub(super) const fn tip(&self) -> Vector {
        Vector::new(self.x, self.y, self.z)
    }

    /// The requested direction of the tool; `None` for the present one.
    pub(super) fn tool(&self) -> Option<Vector> {
        match self.tool.as_deref() {
            Some(&[x, y, z]) => Some(Vector::new(x, y, z)),
            _ if self.keep_tool => None,
            _ => Some(DOWN),
        }
    }
}

/// The targets of the joints. Fails if the point is out of reach or not allowed.
pub(super) fn target(args: &MoveToArgs, tool: Vector) -> Result<TipTarget, CommandError> {
    let target = TipTarget::guarded(args.tip(), tool, args.guard.guard().as_ref());
    target.map_err(|reason| refused(&reason))
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::Parser;

    #[derive(Parser)]
    struct CommandLine {
        #[command(flatten)]
        args: MoveToArgs,
    }

    fn parsed(words: &[&str]) -> Result<MoveToArgs, clap::Error> {
        CommandLine::try_parse_from([&["move-to"], words].concat()).map(|line| line.args)
    }

    #[test]
    fn negative_numbers_are_no_options() {
        let args = parsed(&["-50", "-0.5", "-1e1", "--tool", "-1", "0", "-1"]).expect("a point");
        assert_eq!(
            (args.tip(), args.tool()),
            (Vector::new(-50.0, -0.5, -10.0), Some(Vector::new(-1.0, 0.0, -1.0)))
        );
    }

    #[test]
    fn the_tool_points_down_unless_something_else_is_asked_for() {
        assert_eq!(parsed(&["0", "185", "50"]).expect("a point").tool(), Some(DOWN));
        assert_eq!(parsed(&["0", "185", "50", "--keep-tool"]).expect("a point").tool(), None);
        assert!(parsed(&["0", "185", "50", "--keep-tool", "--tool", "0", "1", "0"]).is_err());
        assert!(parsed(&["0", "185", "nan"]).is_err());
    }

    #[test]
    fn a_speed_of_the_tip_has_its_own_unit() {
        let speed = |text| parsed(&["0", "185", "50", "--straight", "--speed", text]).map(|args| args.speed);
        assert_eq!((speed("40mm/s").ok(), speed("40").ok()), (Some(40.0), Some(40.0)));
        assert!(speed("2x").is_err() && speed("30deg/s").is_err() && speed("501mm/s").is_err());
    }
}
