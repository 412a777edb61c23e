//! What the thread of the port does for one call of Python. Knows the library, not Python.

use std::io;
use std::time::{Duration, Instant};

use sevenbot::approach::ApproachRule;
use sevenbot::cartesian::{Guard, PathBreach, StraightLine, StraightLineRequest, TipPose, Vector};
use sevenbot::fine::FineTargets;
use sevenbot::health::{MoveCheck, Problem, ProblemKind};
use sevenbot::map::{FINE_POSITION, MOTOR_STATE, VACUUM_PUMP, motor_state};
use sevenbot::moves::{
    GuardedMoveError, JointMove, LineStart, MoveError, Observer, Pace, ParkError, Player, Recorder,
};
use sevenbot::recording::{FileVersion, Moment, Recording, RecordingLines};
use sevenbot::{Arm, Error, FineAngle, Span, park_poses};

use crate::arguments::{LINE_SPEEDS, LinePace};
use crate::errors::StraightMoveError;
use crate::watch::Watch;

/// The longest time between two checks whether the call goes on.
const POLL_PERIOD: Duration = Duration::from_millis(20);
/// As [`POLL_PERIOD`], for a caller that sleeps on the clock of the arm.
const SLEEP_PERIOD: Duration = Duration::from_millis(20);
/// On a shorter line the tip counts as not moving, in millimetres.
const SHORTEST_LINE: f64 = 0.5;

/// The requested tip and direction of the tool, and the guard; `None`: no guard.
#[derive(Clone, Copy, Debug)]
pub(crate) struct TipRequest {
    pub(crate) tip: Vector,
    pub(crate) tool: Vector,
    pub(crate) guard: Option<Guard>,
}

/// The measured angles in degrees. Fails if a servo is silent, because its angle is out of date.
pub(crate) fn known_angles(arm: &mut Arm) -> Result<[f64; 7], MoveError> {
    let angles = angles(arm)?;
    MoveCheck::of_positions(arm).check(arm)?;
    Ok(angles)
}

/// The measured angles in degrees: the fine ones if the arm has all seven, or else whole degrees.
fn angles(arm: &mut Arm) -> Result<[f64; 7], Error> {
    let fine = arm.fine_state_if_served()?.map_or([None; 7], |state| state.positions);
    if let [Some(a), Some(b), Some(c), Some(d), Some(e), Some(f), Some(g)] = fine {
        return Ok([a, b, c, d, e, f, g].map(FineAngle::degrees));
    }
    Ok(arm.positions()?.map(|angle| f64::from(angle.degrees())))
}

/// Starts a move, as the command `pose` does.
pub(crate) fn begin(arm: &mut Arm, targets: FineTargets, pace: Pace) -> Result<JointMove, MoveError> {
    arm.driven_joints()?;
    JointMove::begin_at_pace(arm, targets, pace)
}

/// Waits for a move, and returns the measured angles in degrees. If the caller ends the wait, the arm holds.
pub(crate) fn finish(arm: &mut Arm, sent: &JointMove, watch: &mut Watch<'_>) -> Result<[f64; 7], MoveError> {
    let finished = sent.finish(arm, watch);
    if finished == Err(MoveError::Interrupted) {
        arm.hold()?;
    }
    finished?;
    Ok(angles(arm)?)
}

/// Parks the arm in this pose, or in the kept one, or in the standard one. The inner error concerns the file of kept poses.
pub(crate) fn park(
    arm: &mut Arm,
    pose: Option<FineTargets>,
    keep: bool,
    watch: &mut Watch<'_>,
) -> Result<io::Result<[f64; 7]>, ParkError> {
    let (path, chip) = (park_poses::path(), arm.identity().chip_name());
    let kept = match (&path, pose) {
        (Some(path), None) => park_poses::load(path, &chip),
        _ => Ok(pose),
    };
    let pose = match kept {
        Ok(pose) => pose,
        Err(error) => return Ok(Err(error)),
    };
    let parked = arm.park(pose, watch);
    if parked == Err(ParkError::Move(MoveError::Interrupted)) {
        arm.hold().map_err(MoveError::from)?;
    }
    let parked = parked?.map(FineAngle::degrees);
    match (path, pose) {
        (Some(path), Some(pose)) if keep => Ok(park_poses::keep(&path, &chip, &pose).map(|()| parked)),
        (None, Some(_)) if keep => {
            let reason = format!("parked, but the pose is not kept: {}", park_poses::NO_DIRECTORY);
            Ok(Err(io::Error::new(io::ErrorKind::NotFound, reason)))
        }
        _ => Ok(Ok(parked)),
    }
}

/// The breach of the guard on the way of the joints to these targets; `None` if the guard allows the way.
pub(crate) fn breach_on_way(
    arm: &mut Arm,
    targets: &FineTargets,
    pace: Pace,
    guard: &Guard,
) -> Result<Option<PathBreach>, Error> {
    match arm.check_way(targets, pace, guard) {
        Ok(()) => Ok(None),
        Err(GuardedMoveError::Guarded(breach)) => Ok(Some(breach)),
        Err(GuardedMoveError::Exchange(error)) => Err(error),
    }
}

/// A straight line from the present targets, as a recording.
pub(crate) fn straight_line(
    arm: &mut Arm,
    request: TipRequest,
    pace: LinePace,
) -> Result<Recording, StraightMoveError> {
    let TipRequest { tip, tool, guard } = request;
    let joints = arm.driven_joints()?;
    let start = LineStart::of(arm, &joints)?;
    let speed = match pace {
        LinePace::Speed(speed) => speed,
        LinePace::Within(seconds) => speed_within(start, tip, seconds)?,
    };
    let line = start.line_to(tip, tool, speed);
    Ok(StraightLine::plan(&StraightLineRequest { guard, ..line })?.recording)
}

/// The speed, in mm/s, that takes the tip from `start` to `tip` in `seconds`; the lowest speed if only the tool turns.
fn speed_within(start: LineStart, tip: Vector, seconds: f64) -> Result<f64, StraightMoveError> {
    let from = TipPose::of_fine(start.targets).tip;
    let length = (tip.x - from.x).hypot(tip.y - from.y).hypot(tip.z - from.z);
    match length / seconds {
        _ if length < SHORTEST_LINE => Ok(*LINE_SPEEDS.start()),
        speed if LINE_SPEEDS.contains(&speed) => Ok(speed),
        _ => Err(StraightMoveError::Pace { length, seconds }),
    }
}

/// Waits on the clock of the arm's line. If the caller ends the wait, the arm holds.
pub(crate) fn sleep(arm: &mut Arm, time: Duration, watch: &mut Watch<'_>) -> Result<(), MoveError> {
    let slept = sleep_until(arm, arm.now() + time, watch);
    if slept.is_err() {
        arm.hold()?;
    }
    slept
}

fn sleep_until(arm: &mut Arm, end: Instant, watch: &mut Watch<'_>) -> Result<(), MoveError> {
    loop {
        let left = end.saturating_duration_since(arm.now());
        if left.is_zero() {
            return Ok(());
        }
        if !watch.goes_on() {
            return Err(MoveError::Interrupted);
        }
        watch.pause(arm, left.min(SLEEP_PERIOD));
    }
}

/// Makes the arm hold if a joint moves, or may move because its servo is silent. The maker's firmware does not report this, so
/// an arm with it always holds.
pub(crate) fn hold_if_moving(arm: &mut Arm) -> Result<(), MoveError> {
    let is_moving = arm.status()?.is_none_or(|status| status.moving() != 0 || status.missing() != 0);
    if is_moving {
        arm.hold_and_watch()?;
    }
    Ok(())
}

/// Reads all positions `count` times, one after the other or one each `period`. Returns times in seconds and angles.
pub(crate) fn sample(
    arm: &mut Arm,
    count: u32,
    period: Duration,
    watch: &mut Watch<'_>,
) -> Result<(Vec<f64>, Vec<[f64; 7]>), MoveError> {
    arm.wait_until_settled()?;
    let mut check = MoveCheck::of_positions(arm);
    let row = arm.has_extended_block()?.then_some(FINE_POSITION);
    let start = arm.now();
    let (mut times, mut rows) = (Vec::new(), Vec::new());
    for number in 0..count {
        if !watch.goes_on() {
            return Err(MoveError::Interrupted);
        }
        sleep_until(arm, start + period.saturating_mul(number), watch)?;
        let angles = match row {
            Some(row) => {
                let angle = |word| FineAngle::from_hundredths(word).map_or(f64::NAN, FineAngle::degrees);
                arm.read_span(Span::of(&row))?.words(&row).map(angle)
            }
            None => arm.positions()?.map(|angle| f64::from(angle.degrees())),
        };
        times.push(arm.now().saturating_duration_since(start).as_secs_f64());
        rows.push(angles);
        check.poll(arm)?;
        watch.progress(sevenbot::moves::Stage::Playing, u64::from(number), u64::from(count));
    }
    check.check(arm)?;
    Ok((times, rows))
}

/// Time limit (`None`: until a signal), rate of the reports, and whether a hand guides the arm without torque.
#[derive(Clone, Copy, Debug)]
pub(crate) struct RecordOptions {
    pub(crate) limit: Option<Duration>,
    pub(crate) hz: u8,
    pub(crate) is_guided: bool,
}

#[derive(Debug, Default)]
pub(crate) struct RecordedText {
    pub(crate) text: String,
    /// When each moment arrived here, in seconds since the first.
    pub(crate) arrivals: Vec<f64>,
}

/// Records until the time is over or a signal of Python ends it. Also returns what was recorded before a failure.
pub(crate) fn record(
    arm: &mut Arm,
    options: RecordOptions,
    watch: &mut Watch<'_>,
) -> (RecordedText, Result<(), MoveError>) {
    let mut done = RecordedText::default();
    let outcome = record_into(&mut done, arm, options, watch);
    (done, outcome)
}

fn record_into(
    done: &mut RecordedText,
    arm: &mut Arm,
    options: RecordOptions,
    watch: &mut Watch<'_>,
) -> Result<(), MoveError> {
    let RecordOptions { hz, is_guided, .. } = options;
    let before = arm.wait_until_settled()?;
    if is_guided {
        arm.write_motion(MOTOR_STATE.address, &[motor_state::FORCELESS])?;
    }
    let content = arm.exact_positions()?;
    let recorded = arm.with_reports(hz, content, |arm| {
        // After a restart the motors drive the joints, so a hand cannot guide the arm.
        if arm.joints()?.has_restarted_since(&before) {
            return Err(MoveError::Problems(vec![Problem::of_arm(ProblemKind::Restarted)]));
        }
        record_reports(done, arm, options, content, watch)
    });
    if is_guided {
        // The targets become the measured positions (D13).
        let held = arm.engage_and_watch();
        return recorded.and(held);
    }
    recorded
}

fn record_reports(
    done: &mut RecordedText,
    arm: &mut Arm,
    options: RecordOptions,
    content: u8,
    watch: &mut Watch<'_>,
) -> Result<(), MoveError> {
    let vacuum = arm.read_span(Span::of(&VACUUM_PUMP))?.byte(&VACUUM_PUMP) != 0;
    let mut lines = RecordingLines::new(FileVersion::Hundredths);
    done.text = lines.head();
    let mut recorder = Recorder::begin(arm, options.hz, content)?;
    let mut first = None;
    while watch.goes_on() {
        let Some(pose) = recorder.next(arm, POLL_PERIOD)? else { continue };
        if options.limit.is_some_and(|limit| pose.time > limit) {
            break;
        }
        let line = lines.add(&Moment { time: pose.time, pose: pose.pose, vacuum });
        let first = *first.get_or_insert(pose.received);
        done.arrivals.extend(line.is_some().then(|| (pose.received - first).as_secs_f64()));
        done.text.extend(line);
    }
    if watch.is_stopped() { Err(MoveError::Interrupted) } else { Ok(()) }
}

#[derive(Clone, Copy, Debug)]
pub(crate) struct PlayOptions {
    pub(crate) factor: f64,
    pub(crate) times: u32,
    pub(crate) approach: ApproachRule,
}

/// Plays a recording, and returns the measured positions of the first run as the text of a recording.
pub(crate) fn play(
    arm: &mut Arm,
    recording: &Recording,
    options: PlayOptions,
    watch: &mut Watch<'_>,
) -> Result<String, MoveError> {
    arm.driven_joints()?;
    let mut player = Player::new(recording, options.factor).with_approach(options.approach);
    player.play(arm, options.times, watch)?;
    let mut lines = RecordingLines::new(FileVersion::Hundredths);
    let mut text = lines.head();
    let start = recording.moments().next().map(|first| first.time).unwrap_or_default();
    let (mut sent, mut vacuum) = (recording.moments().peekable(), false);
    for (time, pose) in player.measured() {
        let now = start + time.mul_f64(options.factor);
        while let Some(moment) = sent.next_if(|moment| moment.time <= now) {
            vacuum = moment.vacuum;
        }
        text.extend(lines.add(&Moment { time: *time, pose: *pose, vacuum }));
    }
    Ok(text)
}
