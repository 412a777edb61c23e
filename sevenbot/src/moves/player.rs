//! Makes an arm follow a recording, and keeps the measured positions.
//!
//! ```text
//!   ApproachRule ──▶ way to the first pose ──▶ stream of points, or one frame per step ──▶ last pose
//!           └──▶ StartTooFar                                   └── reports ──▶ measured
//! ```

use std::time::{Duration, Instant};

use protocol_core::registers::map::{SPEED, VACUUM_PUMP};

use super::drive::{POLL_PERIOD, drive};
use super::error::{ConnectionLost, MoveError};
use super::joint_move::JointMove;
use super::observer::Observer;
use super::pace::PaceBefore;
use crate::approach::{Approach, ApproachRule, Standing, StartTooFar};
use crate::arm::Arm;
use crate::fine_angle::FineAngle;
use crate::health::MoveCheck;
use crate::movement_run::MovementRun;
use crate::playback::{self, Step};
use crate::point_path::PointPath;
use crate::recording::{Moment, Recording};
use crate::stream::{SetPointStream, StreamError, StreamOptions};
use crate::units::Speed;

/// Frequency of the reports while playing, in Hz.
const FEEDBACK_HZ: u8 = 30;
/// Without a report for this time, the arm has stopped reporting.
const REPORT_TIMEOUT: Duration = Duration::from_secs(2);
/// Time between two points of a stream, in milliseconds.
const PERIOD_MS: u16 = 20;

/// Plays a recording.
///
/// An arm with the extended block gets a stream of points in hundredths of a degree (D23), another one whole degrees with
/// speeds.
///
/// ```
/// use sevenbot::moves::Player;
/// use sevenbot::recording::Recording;
/// use sevenbot::simulated::{self, SimulationConfig};
///
/// # fn main() -> Result<(), Box<dyn std::error::Error>> {
/// let (mut arm, _) = simulated::arm(SimulationConfig::default())?;
/// let text = "7bot-recording 1\n0 90 90 65 90 90 90 80 0\n2 130 90 65 90 90 90 80 0\n";
/// let recording = Recording::parse(text)?;
/// recording.check_speeds(1.0)?;
/// let mut player = Player::new(&recording, 1.0);
/// player.play(&mut arm, 1, &mut ())?;
/// assert_eq!(arm.positions()?[0].degrees(), 130);
/// assert!(player.measured().len() > 50);
/// # Ok(())
/// # }
/// ```
#[derive(Debug)]
pub struct Player {
    moments: Vec<Moment>,
    steps: Vec<Step>,
    path: PointPath,
    rule: ApproachRule,
    /// The speeds of the joints before the first run.
    speeds: [Speed; 7],
    /// The speeds and durations to put back after the playback.
    before: Option<PaceBefore>,
    measured: Vec<(Duration, [FineAngle; 7])>,
    played: u32,
    has_left_pace: bool,
}

impl Player {
    /// Plays `factor` times as fast. [`Recording::check_speeds`] tells whether the arm can follow.
    #[must_use]
    pub fn new(recording: &Recording, factor: f64) -> Self {
        Self {
            moments: recording.moments().collect(),
            steps: playback::steps(recording, factor),
            path: PointPath::new(recording, factor),
            rule: ApproachRule::Near,
            speeds: [Speed::MAXIMUM; 7],
            before: None,
            measured: Vec::new(),
            played: 0,
            has_left_pace: false,
        }
    }

    /// With another rule for the way to the first pose. The default refuses a pose that is further than 5 degrees away.
    #[must_use]
    pub fn with_approach(self, rule: ApproachRule) -> Self {
        Self { rule, ..self }
    }

    /// How many times the recording was played to its end.
    #[must_use]
    pub const fn played(&self) -> u32 {
        self.played
    }

    /// Could the speeds and durations not be restored, as on a lost connection? Then the arm may keep the values of the playback.
    #[must_use]
    pub const fn has_left_pace(&self) -> bool {
        self.has_left_pace
    }

    /// The positions measured during the first run, and their times since its start.
    #[must_use]
    pub fn measured(&self) -> &[(Duration, [FineAngle; 7])] {
        &self.measured
    }

    /// Plays until the recording was played this many times, earlier calls included; 0: until the observer ends the playback. If
    /// the observer ends it, the arm holds. Restores the speeds and durations that the arm had before. The motors must drive the
    /// joints: [`Arm::driven_joints`].
    ///
    /// # Errors
    /// The first pose is too far from where the arm stands or, if `times` is not 1, from the last pose: then nothing is
    /// moved. A joint is blocked, let go or silent, a servo has a new alarm, the supply was lost, or the controller restarted:
    /// [`MoveError::Problems`]. The motors do not drive the joints, or another program stopped the arm. The observer ended the
    /// playback, this program paused for too long, the arm did not take a value or reach a pose, its reports ended, or an exchange
    /// failed.
    pub fn play(&mut self, arm: &mut Arm, times: u32, observer: &mut dyn Observer) -> Result<(), MoveError> {
        self.check_start(arm, times)?;
        let Some(first) = self.moments.first() else { return Ok(()) };
        let before = self.before.insert(PaceBefore::read(arm, &first.pose.map(Some))?).clone();
        let content = arm.exact_positions()?;
        let done = arm.with_reports(FEEDBACK_HZ, content, |arm| {
            let done = self.play_times(arm, times, observer);
            if done == Err(MoveError::Interrupted) {
                arm.hold()?;
            }
            done
        });
        // Restore the speeds first. If the line is too bad for the rest, the next program ends the stream.
        let restored = before.put_back_at_once(arm);
        self.has_left_pace = restored.is_err();
        if restored.is_ok() && done.as_ref().is_err_and(MoveError::is_connection_lost) {
            let _ = arm.let_watchdog_act().is_ok_and(|()| arm.end_abandoned_stream().is_ok());
        }
        done.and(restored)
    }

    fn play_times(
        &mut self,
        arm: &mut Arm,
        times: u32,
        observer: &mut dyn Observer,
    ) -> Result<(), MoveError> {
        // Checks between the moves. A joint move and a stream have checks of their own, steps in whole degrees have none.
        let mut check = MoveCheck::begin(arm, 0)?;
        check.end();
        while times == 0 || self.played < times {
            self.approach(arm, observer)?;
            check.check(arm)?;
            self.play_once(arm, observer)?;
            check.check(arm)?;
            self.played = self.played.saturating_add(1);
        }
        Ok(())
    }

    /// Checks the ways to the first pose before anything moves.
    fn check_start(&mut self, arm: &mut Arm, times: u32) -> Result<(), MoveError> {
        let Some((first, last)) = self.moments.first().zip(self.moments.last()) else { return Ok(()) };
        let standing = arm.standing()?;
        self.speeds = standing.speeds;
        let first = first.pose.map(Some);
        Approach::plan(&standing, &first, self.rule)?;
        if times != 1 {
            let end = Standing::at_pose(last.pose, self.speeds);
            let seam = Approach::plan(&end, &first, self.rule);
            seam.map_err(|far| StartTooFar { is_seam: true, ..far })?;
        }
        Ok(())
    }

    /// Moves to the first pose, and waits until the arm is there.
    fn approach(&self, arm: &mut Arm, observer: &mut dyn Observer) -> Result<(), MoveError> {
        let Some(first) = self.moments.first() else { return Ok(()) };
        if let ApproachRule::Within(_) = self.rule {
            self.blend(first, arm, observer)?;
        }
        let step = playback::approach(arm.positions()?, *first);
        let pace = step.registers();
        let pace = pace.get(..pace.len().saturating_sub(step.targets.len())).unwrap_or_default();
        arm.write_checked(VACUUM_PUMP.address, pace)?;
        move_to(arm, first.pose, observer)
    }

    /// Goes smoothly to the first pose.
    fn blend(&self, first: &Moment, arm: &mut Arm, observer: &mut dyn Observer) -> Result<(), MoveError> {
        let standing = Standing { speeds: self.speeds, ..arm.standing()? };
        let way = Approach::plan(&standing, &first.pose.map(Some), self.rule)?;
        arm.write_checked(VACUUM_PUMP.address, &[u8::from(first.vacuum)])?;
        if arm.has_extended_block()? {
            let options = StreamOptions::new(PERIOD_MS).ok_or(StreamError::NoExtendedBlock)?;
            let mut stream = SetPointStream::open(arm, options)?;
            let done = stream.approach(&way, observer);
            return self.end_stream(stream, done);
        }
        send_steps(playback::steps(&way.recording(*first), 1.0), &mut Tape::default(), arm, observer)
    }

    fn play_once(&mut self, arm: &mut Arm, observer: &mut dyn Observer) -> Result<(), MoveError> {
        let mut tape = Tape::default();
        let done = if arm.has_extended_block()? {
            self.stream(&mut tape, arm, observer)
        } else {
            send_steps(self.steps.clone(), &mut tape, arm, observer)
        };
        if self.played == 0 {
            self.measured = tape.measured;
        }
        done?;
        self.moments.last().map_or(Ok(()), |last| move_to(arm, last.pose, observer))
    }

    /// Streams all points once. The arm stands at the first one.
    fn stream(&self, tape: &mut Tape, arm: &mut Arm, observer: &mut dyn Observer) -> Result<(), MoveError> {
        let options = StreamOptions::new(PERIOD_MS).ok_or(StreamError::NoExtendedBlock)?;
        let mut stream = SetPointStream::open(arm, options)?;
        // The points set the speed, so the registers must not limit it. The caller has checked the recording, and the arm is at its
        // first pose. The stream is opened first: if this program dies, the next one resets the speeds only if it finds an
        // abandoned stream.
        let unlimited = stream.arm().write_checked(SPEED.address, &[Speed::MAXIMUM.steps(); 7]);
        if let Err(error) = unlimited {
            return self.end_stream(stream, Err(error.into()));
        }
        let vacuum = self.moments.first().map(|first| first.vacuum);
        tape.restart(stream.arm());
        let run = MovementRun::along(self.path.clone(), vacuum, stream.arm().elapsed(), options.period());
        let done = drive(run, &mut stream, observer, |stream, until, observer| {
            tape.take_reports_until(until, stream.arm(), observer)
        });
        self.end_stream(stream, done)
    }

    /// Ends a stream. After a success, restores the speeds, and then the registers of the stream. If the connection is lost, leaves
    /// the stream to the watchdog of the arm, so that the next program recognizes it: [`Arm::end_abandoned_stream`].
    fn end_stream(
        &self,
        mut stream: SetPointStream<'_>,
        done: Result<(), MoveError>,
    ) -> Result<(), MoveError> {
        let put_back =
            |()| self.before.as_ref().map_or(Ok(()), |before| before.put_back_at_once(stream.arm()));
        let done = done.and_then(put_back);
        match &done {
            Ok(()) => return Ok(stream.close()?),
            Err(error) if error.is_connection_lost() => stream.leave_to_watchdog(),
            Err(_) => {}
        }
        done
    }
}

/// Sends one frame per step.
fn send_steps(
    steps: Vec<Step>,
    tape: &mut Tape,
    arm: &mut Arm,
    observer: &mut dyn Observer,
) -> Result<(), MoveError> {
    tape.restart(arm);
    let run = MovementRun::in_steps(steps, arm.elapsed());
    drive(run, arm, observer, |arm, until, observer| tape.take_reports_until(until, arm, observer))
}

/// The poses that are measured during one run.
#[derive(Default)]
struct Tape {
    measured: Vec<(Duration, [FineAngle; 7])>,
    start: Option<Instant>,
    last_report: Option<Instant>,
}

impl Tape {
    fn restart(&mut self, arm: &mut Arm) {
        arm.reports().for_each(drop);
        self.start = Some(arm.now());
        self.last_report = self.start;
    }

    /// Takes reports until a time of the arm's clock.
    fn take_reports_until(
        &mut self,
        end: Duration,
        arm: &mut Arm,
        observer: &mut dyn Observer,
    ) -> Result<(), MoveError> {
        loop {
            if !observer.goes_on() {
                return Err(MoveError::Interrupted);
            }
            let left = end.saturating_sub(arm.elapsed());
            if left.is_zero() {
                return Ok(());
            }
            match arm.next_report(left.min(POLL_PERIOD))? {
                Some(report) => {
                    self.last_report = Some(report.received);
                    let start = self.start.unwrap_or(report.received);
                    self.measured.push((report.received.saturating_duration_since(start), report.pose()));
                }
                None if self.last_report.is_some_and(|last| arm.now() > last + REPORT_TIMEOUT) => {
                    return Err(silent(arm));
                }
                None => {}
            }
        }
    }
}

fn move_to(arm: &mut Arm, pose: [FineAngle; 7], observer: &mut dyn Observer) -> Result<(), MoveError> {
    JointMove::begin_fine(arm, pose.map(Some))?.finish(arm, observer).map(drop)
}

/// Why reports are missing.
fn silent(arm: &mut Arm) -> MoveError {
    arm.driven_joints().err().unwrap_or(MoveError::ReportsStopped)
}
