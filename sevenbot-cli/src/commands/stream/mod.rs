//! `stream`: sends set-points from standard input to the arm, at an even period.
//!
//! ```text
//!   standard input ──▶ input: TimedPoint ──▶ Feed: the point of each period ──▶ SetPointStream ──▶ arm
//!                                            StreamPace: when it is due ─┘          reports ──▶ Tracking
//! ```

mod feed;
mod input;
mod summary;
mod tracking;

use std::sync::mpsc::{Receiver, TryRecvError};
use std::time::Duration;

use clap::{Args, ValueEnum, value_parser};
use sevenbot::approach::{Approach, ApproachRule, FirstPoints};
use sevenbot::cartesian::Guard;
use sevenbot::fine::FineTargets;
use sevenbot::map::report_content;
use sevenbot::moves::MoveError;
use sevenbot::stream::{PaceCounts, SetPointStream, StreamError, StreamOptions, StreamPace, WatchdogAction};
use sevenbot::{Arm, FineAngle, StatusBlock};

use self::feed::Feed;
use self::input::TimedPoint;
use self::summary::StreamSummary;
use self::tracking::Tracking;
use crate::approach_args::ApproachArgs;
use crate::command_error::CommandError;
use crate::guard_args::{GuardArgs, warn_of};
use crate::interrupt::{Interrupt, hold_on_interrupt};
use crate::session::Session;
use crate::watch::{ProgressWatch, note_slow_joints};

/// Stream set-points from standard input, in hundredths of a degree.
///
/// The arm goes through the points in straight lines. If this program dies, the watchdog of the arm makes it hold, or sink slowly.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  policy.py | sevenbot stream
  sevenbot stream --period 10 < move.csv
  printf '0,90,90,65,90,90,90,80\\n2,95.5,90,65,90,90,90,80\\n' | sevenbot stream
  policy.py | sevenbot stream --approach 3
        goes to the first point in 3 s

One set-point per line, with its time in seconds and the seven joints in
degrees, 0 to 180:

  {\"t\": 0.02, \"joints\": [90.25, 88, 65, 90, 90, 90, null]}
                                    as JSON; null: this joint gets no point
  0.02, 90.25, 88, 65, 90, 90, 90,  or separated by commas; empty: no point

A recording that `sevenbot convert` wrote as CSV is taken, too; its last column,
the vacuum, is not sent.

The first point has to be within 5 degrees of where each joint stands, and is
approached at up to 30 degrees per second. Further away it is refused with the
distance of each joint, unless --approach goes there first. A joint whose first
angle comes in a later line is treated alike.

Times ascend. The first line is due at once. Between two lines the joints move
in straight lines. A line that comes late delays what follows: nothing is
speeded up. The arm lags one and a half periods behind the points. No joint goes
faster than its speed (`sevenbot get speed`), also on the way to the first
point. A point that takes the arm below the table or into the base is sent with
a warning; `sevenbot move-to --help` describes this guard.

A bad line ends the stream with its number. The lines before it are sent, and
the arm holds at the last of them. Ctrl-C also makes it hold. At the end the
registers of the period and of the watchdog have their old values again, and the
summary shows:

  late      points sent more than a quarter of the period late, points passed
            over, and pauses of the input
  gap       the longest time between two points
  jitter    the standard deviation of the sending times
  tracking  the distance of the measured positions from the points that were due

Only for arms with this project's firmware: others take whole degrees and
no stream.

Exit status 1 after a bad line, if the first point is refused, if the arm takes
no stream, and if it does not follow:
a joint of the stream is blocked, let go or silent, the servos have no supply,
another program stops the arm, or the controller restarted. The message tells
what to do.")]
pub(crate) struct StreamArgs {
    /// Time between two points in milliseconds, 5 to 1000.
    #[arg(long, value_name = "MS", default_value_t = 20, value_parser = value_parser!(u16).range(5..=1_000))]
    period: u16,
    /// Time without a sign of this program after which the watchdog acts, in milliseconds up to 2550; 0: never.
    #[arg(long, value_name = "MS", default_value_t = 300, value_parser = value_parser!(u16).range(0..=2_550))]
    watchdog: u16,
    /// What the watchdog of the arm does.
    #[arg(long, value_name = "ACTION", value_enum, default_value_t = WatchdogActionArg::Hold)]
    watchdog_action: WatchdogActionArg,
    #[command(flatten)]
    approach: ApproachArgs,
    #[command(flatten)]
    guard: GuardArgs,
}

/// What the arm does if this program is silent.
#[derive(Clone, Copy, Debug, ValueEnum)]
enum WatchdogActionArg {
    /// The joints hold.
    Hold,
    /// Damping protection: the arm sinks slowly.
    Damping,
}

impl From<WatchdogActionArg> for WatchdogAction {
    fn from(action: WatchdogActionArg) -> Self {
        match action {
            WatchdogActionArg::Hold => Self::Hold,
            WatchdogActionArg::Damping => Self::Damping,
        }
    }
}

/// Frequency of the reports, in Hz.
const FEEDBACK_HZ: u8 = 50;
/// Time between two checks for new lines while the input pauses.
const POLL_PERIOD: Duration = Duration::from_millis(2);
/// One step of the watchdog's time, in milliseconds.
const WATCHDOG_STEP_MS: u16 = 10;

impl StreamArgs {
    fn options(&self) -> Result<StreamOptions, CommandError> {
        let steps = u8::try_from(self.watchdog.div_ceil(WATCHDOG_STEP_MS)).unwrap_or(u8::MAX);
        let options = StreamOptions::new(self.period);
        let options = options.ok_or_else(|| CommandError::Usage("a period is 5 to 1000 ms".to_owned()))?;
        Ok(options.with_watchdog(steps, self.watchdog_action.into()))
    }
}

pub(crate) fn run(session: &mut Session, args: &StreamArgs) -> Result<(), CommandError> {
    let options = args.options()?;
    let mut arm = session.connect_to_move()?;
    if !arm.has_extended_block()? {
        return Err(StreamError::NoExtendedBlock.into());
    }
    arm.driven_joints()?;
    let targets = arm.fine_targets()?;
    note_slow_joints(&mut arm, &targets.map(Some))?;
    let refused_before = refused(arm.status()?);
    let mut tracking = Tracking::new(targets, options.period());
    let start = StreamStart { rule: args.approach.rule(), first: FirstPoints::default() };
    let done = arm.with_reports(FEEDBACK_HZ, report_content::FINE_POSITIONS, |arm| {
        hold_on_interrupt(arm, |arm, interrupt| stream(arm, interrupt, args, start, &mut tracking))
    });
    let (counts, ended) = done?;
    let refused = refused(arm.status()?).wrapping_sub(refused_before);
    session.printer.print(&StreamSummary::new(counts, options.period(), refused, tracking.error()))?;
    ended.map_err(|reason| CommandError::file("standard input".as_ref(), reason))
}

fn refused(status: Option<StatusBlock>) -> u16 {
    status.as_ref().map_or(0, StatusBlock::frames_refused)
}

/// Streams all points, and waits until the arm has arrived. The second result is the error if a bad line ended the input.
fn stream(
    arm: &mut Arm,
    interrupt: Interrupt,
    args: &StreamArgs,
    start: StreamStart,
    tracking: &mut Tracking,
) -> Result<(PaceCounts, Result<(), String>), CommandError> {
    let (options, guard) = (args.options()?, args.guard.guard());
    let mut stream = SetPointStream::open(arm, options)?;
    let pace = StreamPace::new(stream.arm().elapsed(), options.period());
    let source = PointSource { lines: input::read_in_background(), feed: Feed::default(), end: None };
    let mut streamer = Streamer { stream, pace, source, start, guard, tracking, period: options.period() };
    while streamer.play(interrupt)? {}
    streamer.wait_until_arrived(interrupt)?;
    let Streamer { stream, pace, source, .. } = streamer;
    stream.close()?;
    Ok((pace.counts(), source.end.unwrap_or(Ok(()))))
}

/// The input, and its points that are not sent yet.
struct PointSource {
    lines: Receiver<Result<TimedPoint, String>>,
    feed: Feed,
    /// How the input has ended; `None` while there may be more.
    end: Option<Result<(), String>>,
}

impl PointSource {
    /// Takes the lines that have come, as many as there is room for.
    fn poll(&mut self) {
        while self.end.is_none() && self.feed.has_room() {
            match self.lines.try_recv() {
                Ok(Ok(point)) => self.feed.push(point),
                Ok(Err(reason)) => self.end = Some(Err(reason)),
                Err(TryRecvError::Disconnected) => self.end = Some(Ok(())),
                Err(TryRecvError::Empty) => return,
            }
        }
    }
}

struct Streamer<'a, 'b> {
    stream: SetPointStream<'a>,
    pace: StreamPace,
    source: PointSource,
    start: StreamStart,
    /// `None`: it is switched off, or the warning was given.
    guard: Option<Guard>,
    tracking: &'b mut Tracking,
    period: Duration,
}

/// How joints get to their first points.
struct StreamStart {
    rule: ApproachRule,
    first: FirstPoints,
}

impl Streamer<'_, '_> {
    /// Sends points until the input pauses. Returns false at the end of the input.
    fn play(&mut self, interrupt: Interrupt) -> Result<bool, CommandError> {
        let Some(mut start) = self.wait_for_points(interrupt)? else { return Ok(false) };
        loop {
            self.take_reports_until(self.pace.due(), interrupt)?;
            self.source.poll();
            let now = self.now();
            let number = self.pace.number_at(now);
            let time = start + self.period.saturating_mul(number);
            let Some(point) = self.source.feed.take(time) else { return Ok(true) };
            if let Some(first) = self.start.first.take(&point) {
                self.approach(&first, interrupt)?;
                // The time of the stream does not advance during the approach.
                start = time;
                self.make_due();
            }
            let now = self.now();
            self.pace.take(now);
            let sent = self.stream.arm().now();
            self.stream.send(&point)?;
            self.stream.check()?;
            self.tracking.add_point(sent, &point);
            self.warn_of_pose();
        }
    }

    /// Approaches the first points of joints that have had no point before.
    fn approach(&mut self, first: &FineTargets, interrupt: Interrupt) -> Result<(), CommandError> {
        let standing = self.stream.arm().standing()?;
        let way = Approach::plan(&standing, first, self.start.rule).map_err(MoveError::from)?;
        Ok(self.stream.approach(&way, &mut ProgressWatch::new(interrupt))?)
    }

    /// Makes the next point due, as the first of the stream, or after a pause or an approach.
    fn make_due(&mut self) {
        let now = self.now();
        if self.pace.counts().points == 0 {
            self.pace = StreamPace::new(now, self.period);
        } else {
            self.pace.restart(now);
        }
    }

    /// Warns, once in a stream, if the guard would not allow the last point.
    fn warn_of_pose(&mut self) {
        let [t1, t2, t3, t4, t5, ..] = self.tracking.pose();
        if let Some(breach) = self.guard.and_then(|guard| guard.check_pose([t1, t2, t3, t4, t5]).err()) {
            warn_of(&breach);
            self.guard = None;
        }
    }

    /// Waits for a point, and makes it due now: returns its time in the stream. `None` at the end of the input.
    fn wait_for_points(&mut self, interrupt: Interrupt) -> Result<Option<Duration>, CommandError> {
        self.source.poll();
        while self.source.feed.is_empty() {
            if self.source.end.is_some() {
                return Ok(None);
            }
            let end = self.now() + POLL_PERIOD;
            self.take_reports_until(end, interrupt)?;
            self.stream.keep_alive()?;
            self.stream.check()?;
            self.source.poll();
        }
        self.make_due();
        Ok(Some(self.source.feed.resume_time(self.period)))
    }

    fn now(&mut self) -> Duration {
        self.stream.arm().elapsed()
    }

    fn take_reports_until(&mut self, end: Duration, interrupt: Interrupt) -> Result<(), CommandError> {
        take_reports_until(&mut self.stream, self.tracking, end, interrupt)
    }

    /// Waits until the joints stand at the last points. Fails if a joint does not get there, or if the target of a joint
    /// has changed by more than 3 degrees: from the last point of the joint, or from the target at the start if it had no point.
    fn wait_until_arrived(&mut self, interrupt: Interrupt) -> Result<(), CommandError> {
        let Self { stream, tracking, .. } = self;
        stream.wait_until_arrived(|stream, end| take_reports_until(stream, tracking, end, interrupt))?;
        let targets = stream.arm().fine_targets()?.map(FineAngle::degrees);
        match tracking.moved_from_outside(targets) {
            Some((joint, from, to)) => Err(CommandError::Arm(format!(
                "joint {joint} was to stay at {from:.1} degrees, and holds at {to:.1}: its servo had no torque or no supply for a \
                 moment, or another program moved it. `sevenbot status` shows the arm as it is now"
            ))),
            None => Ok(()),
        }
    }
}

fn take_reports_until(
    stream: &mut SetPointStream<'_>,
    tracking: &mut Tracking,
    end: Duration,
    interrupt: Interrupt,
) -> Result<(), CommandError> {
    loop {
        interrupt.check()?;
        let left = end.saturating_sub(stream.arm().elapsed());
        if left.is_zero() {
            return Ok(());
        }
        if let Some(report) = stream.arm().next_report(left)?
            && let Some(fine) = report.fine
        {
            tracking.add_measured(report.received, &fine.positions);
        }
    }
}
