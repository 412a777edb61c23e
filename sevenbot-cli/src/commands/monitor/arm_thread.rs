//! Who talks to the arm while the screen is drawn: takes samples, fulfils commands, and finds the arm again when
//! it went away.
//!
//! Runs in a thread of its own: a port that does not answer holds up neither keys nor picture. Ends when
//! nobody commands any more.

use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender};
use std::time::{Duration, Instant};

use sevenbot::joints::JointSnapshot;
use sevenbot::map::{MOTOR_STATE, SPEED, TARGET_POSITION, motor_state};
use sevenbot::{Angle, Arm, ArmOptions, Error, Joint, ports};

use super::sample::Sample;
use super::view::{ArmEvent, UiCommand};
use crate::command_error::CommandError;
use crate::interrupt::{Interrupt, hold};
use crate::joint_move::step_target;
use crate::write_result::{all_taken, motors_obey};

/// How long to wait before looking for an arm again.
const RECONNECT_PERIOD: Duration = Duration::from_millis(500);
/// After so many lost answers in a row the arm counts as gone.
const MAX_UNANSWERED: u32 = 3;

/// The one who watches.
pub(crate) struct ArmThread {
    /// The port asked for; none: whichever leads to an arm.
    pub(crate) port: Option<String>,
    /// The port that was used last.
    pub(crate) last_port: String,
    /// How to talk to it.
    pub(crate) options: ArmOptions,
    /// Between two samples.
    pub(crate) period: Duration,
    pub(crate) start: Instant,
    pub(crate) events: Sender<ArmEvent>,
    pub(crate) commands: Receiver<UiCommand>,
    /// The arm that was watched at the end.
    pub(crate) arm: Option<Arm>,
}

/// Nobody listens any more.
struct ChannelClosed;

/// Why watching one arm came to an end.
enum WatchEnd {
    Quit,
    Lost(Error),
}

impl From<Error> for WatchEnd {
    fn from(error: Error) -> Self {
        Self::Lost(error)
    }
}

impl ArmThread {
    /// Watches, until nobody commands any more.
    /// After Ctrl-C the arm is made to hold: returns what became of that, or `None` if there was no arm.
    pub(crate) fn run(mut self) -> Option<Result<JointSnapshot, CommandError>> {
        while self.look().is_ok() {}
        let arm = self.arm.take();
        if Interrupt::is_requested() { arm.map(|mut arm| hold(&mut arm)) } else { None }
    }

    /// Finds the arm and watches it for as long as it is there; then waits a little.
    fn look(&mut self) -> Result<(), ChannelClosed> {
        match self.open() {
            Ok(mut arm) => {
                let firmware = arm.identity().version();
                self.tell(ArmEvent::Found { port: arm.port().to_owned(), firmware })?;
                match self.watch(&mut arm) {
                    WatchEnd::Quit => {
                        self.arm = Some(arm);
                        return Err(ChannelClosed);
                    }
                    WatchEnd::Lost(error) => self.tell(ArmEvent::Lost(error.to_string()))?,
                }
            }
            Err(reason) => self.tell(ArmEvent::Lost(reason))?,
        }
        self.pause(RECONNECT_PERIOD)
    }

    /// Opens the port that was asked for or used last, or else another one that leads to an arm.
    fn open(&mut self) -> Result<Arm, String> {
        // An answer that is missing is events, and the next sample asks again.
        let options = ArmOptions { attempts: 1, ..self.options };
        let error = match Arm::open_with(&self.last_port, options) {
            Ok(arm) => return Ok(arm),
            Err(error) => error.to_string(),
        };
        if self.port.is_none() {
            // Unplugged and plugged in again, it may have another name.
            let found = ports::probe(ports::available(), options.baud);
            if let Some(found) = found.into_iter().find(|found| found.answer.is_ok()) {
                self.last_port = found.port.name;
                return Arm::open_with(&self.last_port, options).map_err(|error| error.to_string());
            }
        }
        Err(error)
    }

    /// Watches one arm.
    fn watch(&self, arm: &mut Arm) -> WatchEnd {
        let mut unanswered = 0;
        let mut due = Instant::now();
        loop {
            let ended = match Sample::take(arm, self.start) {
                Ok(sample) => {
                    unanswered = 0;
                    self.tell(ArmEvent::Sample(sample))
                }
                Err(Error::NoAnswer { received, .. }) if unanswered + 1 < MAX_UNANSWERED => {
                    unanswered += 1;
                    self.tell(ArmEvent::Unanswered { damaged: received.damaged_frames })
                }
                Err(error) => return WatchEnd::Lost(error),
            };
            due = (due + self.period).max(Instant::now());
            if let Err(reason) =
                ended.map_err(|ChannelClosed| WatchEnd::Quit).and_then(|()| self.execute_until(arm, due))
            {
                return reason;
            }
        }
    }

    /// Does what is wished, until it is time for the next sample.
    fn execute_until(&self, arm: &mut Arm, due: Instant) -> Result<(), WatchEnd> {
        loop {
            match self.commands.recv_timeout(due.saturating_duration_since(Instant::now())) {
                // A stop does not wait for the commands before it.
                Ok(_) if Interrupt::is_requested() => return Err(WatchEnd::Quit),
                Ok(command) => self.execute(arm, command)?,
                Err(RecvTimeoutError::Timeout) => return Ok(()),
                Err(RecvTimeoutError::Disconnected) => return Err(WatchEnd::Quit),
            }
        }
    }

    /// Does what is wished, and tells what did not take.
    fn execute(&self, arm: &mut Arm, command: UiCommand) -> Result<(), WatchEnd> {
        let (refusal, lost) = match try_execute(arm, command) {
            Ok(()) => return Ok(()),
            Err(CommandError::Exchange(error)) => (CommandError::MayMove(error.to_string()), Some(error)),
            Err(failure) => (failure, None),
        };
        let refusal = refusal.message().unwrap_or_default();
        self.tell(ArmEvent::Refused(refusal)).map_err(|ChannelClosed| WatchEnd::Quit)?;
        match lost {
            Some(error @ Error::Port(_)) => Err(error.into()),
            _ => Ok(()),
        }
    }

    fn tell(&self, event: ArmEvent) -> Result<(), ChannelClosed> {
        self.events.send(event).map_err(|_| ChannelClosed)
    }

    /// Waits; what is wished meanwhile has nobody to fulfil it.
    fn pause(&self, duration: Duration) -> Result<(), ChannelClosed> {
        let end = Instant::now() + duration;
        loop {
            match self.commands.recv_timeout(end.saturating_duration_since(Instant::now())) {
                Ok(_) => self.tell(ArmEvent::Refused("there is no arm: nothing was written".to_owned()))?,
                Err(RecvTimeoutError::Timeout) => return Ok(()),
                Err(RecvTimeoutError::Disconnected) => return Err(ChannelClosed),
            }
        }
    }
}

/// Does what is wished, and makes sure of it.
fn try_execute(arm: &mut Arm, command: UiCommand) -> Result<(), CommandError> {
    match command {
        UiCommand::Nudge { joint, degrees } => nudge(arm, joint, degrees),
        UiCommand::SpeedChange { joint, change } => {
            let joints = arm.read(SPEED.of(joint), 1)?;
            let steps = joints.first().copied().unwrap_or(0);
            all_taken(&arm.write_checked(SPEED.address, &[change.after(steps); 7])?)
        }
        // In the servo state already, the same state again would stop nothing.
        UiCommand::State(motor_state::SERVO) if arm.joints()?.is_driven() => hold(arm).map(drop),
        UiCommand::State(state) => motors_obey(arm.write_checked(MOTOR_STATE.address, &[state])),
    }
}

/// Moves a joint's target from where it is now. What the screen shows of it may be older than the last command.
fn nudge(arm: &mut Arm, joint: Joint, degrees: i16) -> Result<(), CommandError> {
    let wanted = step_target(&arm.wait_until_settled()?, joint, degrees)?.max(0);
    let wanted = u8::try_from(wanted).unwrap_or(u8::MAX).min(Angle::MAX_DEGREES);
    motors_obey(arm.write_checked(TARGET_POSITION.of(joint), &[wanted]))
}
