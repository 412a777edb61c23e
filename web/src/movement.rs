//! Records the joints and plays recordings, in the file format of `sevenbot record` and `sevenbot play`.

use std::time::Duration;

use protocol_core::time::Instant;
use sevenbot::approach::{Approach, ApproachRule, Standing, StartTooFar};
use sevenbot::map::{FINE_TARGET, HOST_WATCHDOG, SET_POINT_PERIOD, SPEED, TARGET_POSITION, VACUUM_PUMP};
use sevenbot::recording::{FileVersion, Moment, Recording, RecordingError, head};
use sevenbot::{FineAngle, Snapshot, Speed};

use crate::arm_state::{ArmState, has_extended_block};
use crate::client::Client;

/// Time between two points of a played movement.
const PERIOD: Duration = Duration::from_millis(20);
/// The arm holds if the page is silent for this long while it plays: 500 ms, in units of 10 ms (D24).
const WATCHDOG: u8 = 50;

/// A movement that grows while it is recorded.
#[derive(Debug)]
pub struct Recorder {
    start: Instant,
    moments: Vec<Moment>,
}

impl Recorder {
    /// A recording that begins now.
    #[must_use]
    pub const fn new(now: Instant) -> Self {
        Self { start: now, moments: Vec::new() }
    }

    /// Adds the measured joints, if all of them are measured and time has passed.
    pub fn add(&mut self, now: Instant, state: &ArmState, vacuum: bool) {
        let time = Duration::from_micros((now - self.start).as_micros());
        let angles = state.measured.map(|angle| FineAngle::from_degrees(f64::from(angle?)));
        let last = self.moments.last().map(|moment| moment.time);
        // The file has milliseconds.
        if last.is_some_and(|last| time < last + Duration::from_millis(1)) || angles.contains(&None) {
            return;
        }
        let zero = FineAngle::from(sevenbot::Angle::from_register(0));
        let pose = angles.map(|angle| angle.unwrap_or(zero));
        self.moments.push(Moment { time, pose, vacuum });
    }

    /// The recording as a file; `None` if nothing was measured.
    #[must_use]
    pub fn finish(self) -> Option<String> {
        let lines = self.moments.iter().map(|moment| moment.line(FileVersion::Hundredths) + "\n");
        (!self.moments.is_empty()).then(|| head(FileVersion::Hundredths) + &lines.collect::<String>())
    }
}

/// Why a movement is not played.
#[derive(Clone, Debug, PartialEq)]
pub enum PlayRefusal {
    /// The text is no recording.
    NoRecording(RecordingError),
    /// It begins too far from where the arm stands.
    TooFar(StartTooFar),
}

/// A movement that is played.
#[derive(Debug)]
pub struct Player {
    moments: Vec<Moment>,
    /// The way to the first moment.
    approach: Approach,
    /// When the way began; `None` before the first poll.
    start: Option<Instant>,
    /// When the next point is due.
    due: Instant,
    vacuum: Option<bool>,
}

impl Player {
    /// Parses a recording, to be played from now on by the arm with these registers. With `approach` the arm goes to the
    /// first pose in this time, or longer if a joint would exceed its speed.
    ///
    /// # Errors
    /// The text is no recording; or without `approach` the first pose is further than 5 degrees from where a joint stands.
    pub fn new(
        text: &str,
        registers: &Snapshot,
        approach: Option<Duration>,
        now: Instant,
    ) -> Result<Self, PlayRefusal> {
        let moments: Vec<Moment> =
            Recording::parse(text).map_err(PlayRefusal::NoRecording)?.moments().collect();
        let first = moments.first().map_or([None; 7], |first| first.pose.map(Some));
        let rule = approach.map_or(ApproachRule::Near, ApproachRule::Within);
        let approach = Approach::plan(&standing(registers), &first, rule).map_err(PlayRefusal::TooFar)?;
        Ok(Self { moments, approach, start: None, due: now, vacuum: None })
    }

    /// How much was played, from 0 to 1.
    #[must_use]
    pub fn progress(&self, now: Instant) -> f64 {
        let Some((start, last)) = self.start.zip(self.moments.last()) else { return 0.0 };
        let played = elapsed(start, now).saturating_sub(self.approach.duration());
        (played.as_secs_f64() / last.time.as_secs_f64().max(0.001)).min(1.0)
    }

    /// Writes the points that are due: of the way to the first pose, then of the movement. False once it is over.
    pub fn poll(&mut self, now: Instant, client: &mut Client) -> bool {
        let (Some(first), Some(last)) = (self.moments.first().copied(), self.moments.last().copied()) else {
            return false;
        };
        let is_fine = has_extended_block(client.registers());
        let start = self.start.unwrap_or_else(|| {
            begin(client, now);
            now
        });
        self.start = Some(start);
        if now < self.due {
            return true;
        }
        self.due = now + protocol_core::time::Duration::from_micros(20_000);
        let Some(played) = elapsed(start, now).checked_sub(self.approach.duration()) else {
            let way =
                self.approach.at(elapsed(start, now)).map(|angle| angle.map_or(0.0, FineAngle::degrees));
            write_pose(client, now, &way, is_fine);
            return true;
        };
        let time = played + first.time;
        write_pose(client, now, &at(&self.moments, time), is_fine);
        let vacuum = self.moments.iter().rev().find(|moment| moment.time <= time).map(|moment| moment.vacuum);
        if vacuum != self.vacuum {
            self.vacuum = vacuum;
            client.write(now, VACUUM_PUMP.address, &[u8::from(vacuum == Some(true))]);
        }
        let is_over = time >= last.time;
        if is_over {
            end(client, now);
        }
        !is_over
    }
}

/// Where the arm with these registers stands.
fn standing(registers: &Snapshot) -> Standing {
    let state = ArmState::new(registers);
    let speeds = registers.joints(&SPEED).map(|steps| Speed::from_steps(steps).unwrap_or(Speed::MAXIMUM));
    Standing {
        measured: state.measured.map(|angle| angle.map(f64::from)),
        targets: state.targets.map(f64::from),
        speeds,
    }
}

fn elapsed(start: Instant, now: Instant) -> Duration {
    Duration::from_micros((now - start).as_micros())
}

/// Begins the stream of a player, if the arm takes one.
fn begin(client: &mut Client, now: Instant) {
    if has_extended_block(client.registers()) {
        let [low, high] = u16::try_from(PERIOD.as_millis()).unwrap_or(0).to_le_bytes();
        client.write(now, SET_POINT_PERIOD.address, &[low, high]);
        client.write(now, HOST_WATCHDOG.address, &[WATCHDOG]);
    }
}

/// Ends the stream of a player: later targets are approached by speed again.
pub fn end(client: &mut Client, now: Instant) {
    if has_extended_block(client.registers()) {
        client.write(now, HOST_WATCHDOG.address, &[0]);
        client.write(now, SET_POINT_PERIOD.address, &[0, 0]);
    }
}

fn write_pose(client: &mut Client, now: Instant, pose: &[f64; 7], is_fine: bool) {
    let angles = pose.map(|degrees| FineAngle::from_degrees(degrees.clamp(0.0, 180.0)));
    let hundredths = angles.map(|angle| angle.map_or(0, FineAngle::hundredths));
    if is_fine {
        client.write(now, FINE_TARGET.address, hundredths.map(u16::to_le_bytes).as_flattened());
    } else {
        let whole = angles.map(|angle| angle.map_or(0, |angle| angle.nearest().degrees()));
        client.write(now, TARGET_POSITION.address, &whole);
    }
}

/// The pose at a time, on a straight line between its neighbours, in degrees.
fn at(moments: &[Moment], time: Duration) -> [f64; 7] {
    let next = moments.partition_point(|moment| moment.time <= time);
    let before = next.checked_sub(1).and_then(|index| moments.get(index));
    let (Some(from), Some(to)) = (before.or(moments.first()), moments.get(next).or(moments.last())) else {
        return [90.0; 7];
    };
    let span = to.time.saturating_sub(from.time).as_secs_f64();
    let passed = time.saturating_sub(from.time).as_secs_f64();
    let part = if span > 0.0 { (passed / span).min(1.0) } else { 1.0 };
    let mut pose = from.pose.map(|angle| angle.degrees());
    for (angle, other) in pose.iter_mut().zip(to.pose) {
        *angle += (other.degrees() - *angle) * part;
    }
    pose
}

#[cfg(test)]
mod tests {
    use super::*;

    const WAVE: &str = "7bot-recording 2\n0 90 90 65 90 90 90 80 0\n2 120.5 90 65 90 90 90 80 1\n";

    fn seconds(seconds: u64) -> Instant {
        Instant::from_micros(seconds * 1_000_000)
    }

    #[test]
    fn points_lie_on_straight_lines() {
        let player = Player::new(WAVE, &registers(9_005), None, seconds(0)).expect("a recording");
        let first = |millis| at(&player.moments, Duration::from_millis(millis))[0];
        assert_eq!([0, 1_000, 2_000, 9_000].map(first), [90.0, 105.25, 120.5, 120.5]);
    }

    /// The registers of an arm in its standard pose, but for joint 1, whose angle is in hundredths of a degree.
    fn registers(joint_1: u16) -> Snapshot {
        let mut registers = Snapshot { address: 0, values: vec![0; 256] };
        let angles = [joint_1, 9_000, 6_500, 9_000, 9_000, 9_000, 8_000].map(u16::to_le_bytes);
        for first in [128, 142] {
            registers.values[first..first + 14].copy_from_slice(angles.as_flattened());
        }
        registers.values[191] = 1;
        registers
    }

    #[test]
    fn a_movement_that_begins_elsewhere_is_refused_or_approached() {
        let refused = Player::new(WAVE, &registers(10_000), None, seconds(0)).expect_err("10 degrees");
        let PlayRefusal::TooFar(far) = refused else { panic!("{refused:?}") };
        assert_eq!((far.joints.len(), far.joints[0].1, far.joints[0].2), (1, 100.0, 90.0));
        let way = Some(Duration::from_secs(2));
        let player = Player::new(WAVE, &registers(10_000), way, seconds(0)).expect("a way");
        assert_eq!(player.approach.duration(), Duration::from_secs(2));
        let near = Player::new(WAVE, &registers(9_400), None, seconds(0)).expect("near");
        assert_eq!(near.approach.duration(), Duration::from_millis(200));
    }

    #[test]
    fn a_recording_is_a_file_of_the_command_line() {
        let mut registers = Snapshot { address: 0, values: vec![0; 256] };
        registers.values[142..156].copy_from_slice(&[0x2D, 0x23].repeat(7));
        registers.values[191] = 1;
        let mut recorder = Recorder::new(seconds(1));
        for time in [1, 1, 2] {
            recorder.add(seconds(time), &ArmState::new(&registers), false);
        }
        let text = recorder.finish().expect("something was measured");
        let recording = Recording::parse(&text).expect("a recording");
        let moments: Vec<_> = recording.moments().map(|moment| (moment.time, moment.pose[6])).collect();
        let angle = FineAngle::from_hundredths(9_005).expect("an angle");
        assert_eq!(moments, [(Duration::ZERO, angle), (Duration::from_secs(1), angle)]);
        assert!(Recorder::new(seconds(1)).finish().is_none());
    }

    #[test]
    fn a_file_that_is_no_recording_is_refused() {
        let refused = Player::new("hello", &registers(9_000), None, seconds(0)).expect_err("no recording");
        assert_eq!(refused, PlayRefusal::NoRecording(RecordingError::NotARecording));
    }
}
