//! Plays recordings: the page's shell around [`MovementRun`] and [`MoveWatch`].
//!
//! ```text
//!   PagePlayer: open the stream ──▶ way to the first pose ──▶ the movement ──▶ close the stream ──▶ PlayProgress
//!                └── both are written up to five times, until a read confirms them ────┘
//! ```

use std::time::Duration;

use host_link::sharing::{SharingCommand, SharingState};
use protocol_core::time::Instant;
use sevenbot::approach::{Approach, ApproachRule, Standing, StartTooFar};
use sevenbot::health::{MoveFault, MoveWatch};
use sevenbot::map::{SET_POINT_PERIOD, SPEED, TIME};
use sevenbot::movement_run::{MovementRun, RunStep};
use sevenbot::playback;
use sevenbot::point_path::PointPath;
use sevenbot::recording::{Recording, RecordingError};
use sevenbot::stream::{StreamOptions, WatchdogAction};
use sevenbot::{Health, Joint, Snapshot};

use crate::client::{BAUD, Client};
use crate::confirmed::{Confirmed, Unconfirmed, write_all};
use crate::stop::since_start;

/// Time between two points of a played movement, in milliseconds. A browser calls the page every 17 ms, so a point is sent up to
/// 17 ms late. So the points are within 8.5 ms of an even grid; D23 allows a quarter of the period, 12.5 ms.
const PERIOD_MS: u16 = 50;
const PERIOD: Duration = Duration::from_millis(50);
/// The host-link watchdog: the arm holds if the page sends nothing for 500 ms while it plays. In units of 10 ms (D24).
const WATCHDOG: u8 = 50;
/// The joints have this time to settle at the last pose of a movement.
const SETTLE_TIME: Duration = Duration::from_secs(2);
pub(crate) const ALL_JOINTS: u8 = 0x7F;

/// Why a movement cannot be played.
#[derive(Clone, Debug, PartialEq)]
pub enum PlayRefusal {
    /// The text is no recording, or the arm cannot follow it.
    NoRecording(RecordingError),
    /// Its first pose is too far from the present pose of the arm.
    TooFar(StartTooFar),
}

/// What [`PagePlayer::poll`] returns: whether the movement goes on or has ended.
#[derive(Clone, Debug, PartialEq)]
pub enum PlayProgress {
    /// The movement is not over yet.
    Playing,
    /// The arm is at its last pose.
    Played,
    /// The movement ended early, for this reason.
    Failed(PlayFailure),
}

/// Why a movement, a park or a program ends early.
#[derive(Clone, Debug, PartialEq)]
pub enum PlayFailure {
    /// The arm reports a problem, is not driven or does not answer, or another client has ended its stream.
    Arm(MoveFault),
    /// The page did not run for this time, so that the arm may have stopped meanwhile.
    Paused(Duration),
    /// The arm does not take written registers.
    NotTaken,
    /// These joints have not reached their targets: joint, position and target in degrees.
    NotReached(Vec<(Joint, u8, u8)>),
    /// Another client of the server has stopped the arm.
    StoppedByAnother,
}

impl From<Unconfirmed> for PlayFailure {
    fn from(_: Unconfirmed) -> Self {
        Self::NotTaken
    }
}

/// Tells a server that a new movement, park or program begins, so that an earlier stop by another client does not end it.
/// Writes nothing without a server.
pub(crate) fn start_anew(now: Instant, client: &mut Client) {
    if SharingState::of(client.registers()).is_some() {
        let (address, values) = SharingCommand::StartAnew.write();
        client.write(now, address, &values);
    }
}

/// The stages of a player, in their order.
#[derive(Debug)]
enum PlayerStage {
    Start,
    Opening(Confirmed),
    Way(MovementRun),
    Path(MovementRun),
    Closing(Confirmed),
    Settling(Instant),
}

/// Plays a recording on the arm, after the way to its first pose. [`Self::poll`] drives it.
#[derive(Debug)]
pub struct PagePlayer {
    recording: Recording,
    /// The path to the first moment.
    approach: Approach,
    /// An earlier stop by another client does not end this movement: see [`start_anew`].
    starts_anew: bool,
    is_fine: bool,
    /// The registers before the movement, with the speeds and times to restore.
    before: Snapshot,
    watch: MoveWatch,
    /// The round of the last registers that were checked.
    watched_round: u64,
    /// A fault that a stop by another client may have caused: the registers of the arm may show the effect of the stop one round
    /// before the server reports the stop.
    suspected: Option<MoveFault>,
    stage: PlayerStage,
}

impl PagePlayer {
    /// Parses a recording, to be played from now on by the arm with these registers. With `approach`, the arm goes to the first
    /// pose in this time, or longer if a joint would exceed its speed.
    ///
    /// # Errors
    /// - The text is no recording.
    /// - A joint cannot follow the recording at its speed.
    /// - Without `approach`: a joint is more than 5 degrees from the first pose.
    pub fn new(
        text: &str,
        registers: &Snapshot,
        approach: Option<Duration>,
        now: Instant,
    ) -> Result<Self, PlayRefusal> {
        let recording = Recording::parse(text).map_err(PlayRefusal::NoRecording)?;
        let rule = approach.map_or(ApproachRule::Near, ApproachRule::Within);
        let player = Self::along(recording, registers, rule, now)?;
        Ok(Self { starts_anew: true, ..player })
    }

    /// As [`Self::new`], for a line in a program of blocks: a stop by another client ends it, even a stop before the line.
    ///
    /// # Errors
    /// A joint cannot follow the recording at its speed, or `rule` does not allow the distance to the first pose.
    pub(crate) fn along(
        recording: Recording,
        registers: &Snapshot,
        rule: ApproachRule,
        now: Instant,
    ) -> Result<Self, PlayRefusal> {
        recording.check_speeds(1.0).map_err(PlayRefusal::NoRecording)?;
        let first = recording.moments().next().map_or([None; 7], |first| first.pose.map(Some));
        let approach = Approach::plan(&Standing::of(registers), &first, rule).map_err(PlayRefusal::TooFar)?;
        let is_fine = registers.has_extended_block();
        let watch = MoveWatch::new(since_start(now), ALL_JOINTS, BAUD);
        Ok(Self {
            recording,
            approach,
            starts_anew: false,
            is_fine,
            before: registers.clone(),
            watch: if is_fine { watch.with_period(PERIOD_MS) } else { watch },
            watched_round: 0,
            suspected: None,
            stage: PlayerStage::Start,
        })
    }

    /// Sets the registers whose speeds and times are restored at the end.
    #[must_use]
    pub fn restoring(self, before: Snapshot) -> Self {
        Self { before, ..self }
    }

    /// The part of the movement that was played, from 0 to 1.
    #[must_use]
    pub fn progress(&self) -> f64 {
        match &self.stage {
            PlayerStage::Path(run) => {
                let part = |count| f64::from(u32::try_from(count).unwrap_or(u32::MAX));
                let (done, all) = run.progress();
                part(done) / part(all).max(1.0)
            }
            PlayerStage::Start | PlayerStage::Opening(_) | PlayerStage::Way(_) => 0.0,
            PlayerStage::Closing(_) | PlayerStage::Settling(_) => 1.0,
        }
    }

    /// The registers before the movement, with the speeds and times to restore.
    #[must_use]
    pub fn into_before(self) -> Snapshot {
        self.before
    }

    /// The speeds of the joints before the movement, as in registers 32 to 38.
    #[must_use]
    pub fn speeds(&self) -> [u8; 7] {
        self.before.joints(&SPEED)
    }

    /// Writes the points that are due. Call it with each picture.
    pub fn poll(&mut self, now: Instant, client: &mut Client) -> PlayProgress {
        match self.advance(now, client) {
            Ok(progress) => progress,
            Err(failure) => {
                self.end(now, client);
                PlayProgress::Failed(failure)
            }
        }
    }

    /// Ends the stream after a stop. The stop itself restores the speeds.
    pub fn end_stream(&self, now: Instant, client: &mut Client) {
        if self.is_fine && !matches!(self.stage, PlayerStage::Start | PlayerStage::Settling(_)) {
            client.write(now, SET_POINT_PERIOD.address, &[0; 4]);
        }
    }

    /// Ends the movement early: closes the stream, and restores speeds and times. The arm stops at the last point that was sent.
    pub fn end(&self, now: Instant, client: &mut Client) {
        if !matches!(self.stage, PlayerStage::Start | PlayerStage::Settling(_)) {
            write_all(&self.closing_frames(), now, client);
        }
    }

    fn advance(&mut self, now: Instant, client: &mut Client) -> Result<PlayProgress, PlayFailure> {
        match &mut self.stage {
            PlayerStage::Start => {
                if self.starts_anew {
                    start_anew(now, client);
                }
                self.stage = PlayerStage::Opening(Confirmed::write(self.opening_frames(), now, client));
            }
            PlayerStage::Opening(opening) => {
                if opening.poll(now, client)? {
                    self.stage = PlayerStage::Way(self.way(now));
                }
            }
            PlayerStage::Way(_) | PlayerStage::Path(_) => {
                self.watch(now, client)?;
                if self.suspected.is_none() {
                    self.drive(now, client)?;
                }
            }
            PlayerStage::Closing(closing) => {
                if closing.poll(now, client)? {
                    self.stage = PlayerStage::Settling(now);
                }
            }
            PlayerStage::Settling(since) => {
                let away = Health::new(client.registers()).away_from_targets(ALL_JOINTS);
                if away.is_empty() {
                    return Ok(PlayProgress::Played);
                }
                if since_start(now) >= since_start(*since) + SETTLE_TIME {
                    return Err(PlayFailure::NotReached(away));
                }
            }
        }
        Ok(PlayProgress::Playing)
    }

    /// Fails if the arm does not carry out the movement, or another client has stopped the arm.
    fn watch(&mut self, now: Instant, client: &Client) -> Result<(), PlayFailure> {
        if client.rounds() != self.watched_round {
            self.watched_round = client.rounds();
            let sharing = SharingState::of(client.registers());
            if sharing.is_some_and(|sharing| sharing.is_stopped) {
                return Err(PlayFailure::StoppedByAnother);
            }
            if let Some(fault) = self.suspected.take() {
                return Err(PlayFailure::Arm(fault));
            }
            match self.watch.registers(since_start(now), client.registers()) {
                Err(fault) if sharing.is_some() => self.suspected = Some(fault),
                seen => seen.map_err(PlayFailure::Arm)?,
            }
        }
        // Fails if the arm is silent. The client reads all registers in any case, so the span to read is not needed.
        self.watch.question(since_start(now)).map(drop).map_err(PlayFailure::Arm)
    }

    fn drive(&mut self, now: Instant, client: &mut Client) -> Result<(), PlayFailure> {
        let (PlayerStage::Way(run) | PlayerStage::Path(run)) = &mut self.stage else { return Ok(()) };
        loop {
            match run.poll(since_start(now)) {
                RunStep::Wait(_) => return Ok(()),
                RunStep::Over => break,
                RunStep::Paused(time) => return Err(PlayFailure::Paused(time)),
                step => {
                    write_all(&step.frames(), now, client);
                }
            }
        }
        self.stage = match &self.stage {
            PlayerStage::Way(_) => PlayerStage::Path(self.path(now, client)),
            _ => PlayerStage::Closing(Confirmed::write(self.closing_frames(), now, client)),
        };
        Ok(())
    }

    fn way(&self, now: Instant) -> MovementRun {
        let now = since_start(now);
        if self.is_fine {
            return MovementRun::approach(self.approach, now, PERIOD);
        }
        let first = self.recording.moments().next();
        let way = first.map_or_else(Vec::new, |first| playback::steps(&self.approach.recording(first), 1.0));
        MovementRun::in_steps(way, now)
    }

    /// Creates the run of the movement. On an arm with the extended block, the points determine the speed, so this also sets the
    /// speed registers to the maximum.
    fn path(&self, now: Instant, client: &mut Client) -> MovementRun {
        if !self.is_fine {
            return MovementRun::in_steps(playback::steps(&self.recording, 1.0), since_start(now));
        }
        client.write(now, SPEED.address, &[0; 7]);
        MovementRun::along(PointPath::new(&self.recording, 1.0), None, since_start(now), PERIOD)
    }

    fn opening_frames(&self) -> Vec<(u8, Vec<u8>)> {
        let options = StreamOptions::new(PERIOD_MS).filter(|_| self.is_fine);
        let options = options.map(|options| options.with_watchdog(WATCHDOG, WatchdogAction::Hold));
        options.map(|options| (SET_POINT_PERIOD.address, options.registers().to_vec())).into_iter().collect()
    }

    fn closing_frames(&self) -> Vec<(u8, Vec<u8>)> {
        let stream = self.is_fine.then(|| (SET_POINT_PERIOD.address, vec![0; 4]));
        let [speeds, times] = [SPEED, TIME].map(|row| (row.address, self.before.joints(&row).to_vec()));
        stream.into_iter().chain([speeds, times]).collect()
    }
}

#[cfg(test)]
mod tests;
