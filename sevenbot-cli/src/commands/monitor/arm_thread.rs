//! The thread that owns the arm: takes samples, executes commands, and reconnects after the arm was lost.
//!
//! It is a thread so that a silent port blocks neither keys nor drawing. It ends when the screen ends.

use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender};
use std::time::{Duration, Instant};

use sevenbot::cartesian::{Guard, Jog, JogAxes, Vector};
use sevenbot::joints::JointSnapshot;
use sevenbot::map::{MOTOR_STATE, SPEED, motor_state};
use sevenbot::moves::JointMove;
use sevenbot::{Angle, Arm, ArmOptions, Error, Joint, ports};

use super::sample::ArmSample;
use super::view::{ArmEvent, UiCommand};
use crate::command_error::CommandError;
use crate::interrupt::{Interrupt, hold};
use crate::step_target::step_target;

/// Time between two attempts to connect.
const RECONNECT_PERIOD: Duration = Duration::from_millis(500);
/// The arm is lost after this many consecutive unanswered samples.
const MAX_UNANSWERED: u32 = 3;

pub(crate) struct ArmThread {
    /// The port from the command line; `None`: any that leads to an arm.
    pub(crate) port: Option<String>,
    pub(crate) last_port: String,
    /// Baud rate, timeout, attempts and register map. The thread makes one attempt only.
    pub(crate) options: ArmOptions,
    /// Time between two samples.
    pub(crate) period: Duration,
    pub(crate) start: Instant,
    pub(crate) events: Sender<ArmEvent>,
    pub(crate) commands: Receiver<UiCommand>,
    /// The arm that was watched when the channel closed; Ctrl-C makes it hold.
    pub(crate) arm: Option<Arm>,
    /// The state after the last step of the tip; `None` before the first.
    pub(crate) jog: Option<Jog>,
    /// Limits the steps of the tip, and warns of steps of a joint; `None`: neither.
    pub(crate) guard: Option<Guard>,
}

/// The screen has closed its channel.
struct ChannelClosed;

/// Why sampling of one arm ended.
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
    /// Runs until the screen ends. After Ctrl-C makes the arm hold, and returns the result. `None`: there was no Ctrl-C, or there
    /// is no arm.
    pub(crate) fn run(mut self) -> Option<Result<JointSnapshot, CommandError>> {
        while self.look().is_ok() {}
        let arm = self.arm.take();
        if Interrupt::is_requested() { arm.map(|mut arm| hold(&mut arm)) } else { None }
    }

    /// Connects to the arm and samples it until it is lost, then pauses.
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

    /// Opens the port used last. If that fails, and the command line names no port, searches for another one that leads to an
    /// arm.
    fn open(&mut self) -> Result<Arm, String> {
        // One attempt: the screen counts each missing answer, and the next sample asks again.
        let options = ArmOptions { attempts: 1, ..self.options };
        let error = match Arm::open_with(&self.last_port, options) {
            Ok(arm) => return Ok(arm),
            Err(error) => error.to_string(),
        };
        if self.port.is_none() {
            // A port may have another name after it was plugged in again.
            let found = ports::probe(ports::available(), options.baud);
            if let Some(found) = found.into_iter().find(|found| found.answer.is_ok()) {
                self.last_port = found.port.name;
                return Arm::open_with(&self.last_port, options).map_err(|error| error.to_string());
            }
        }
        Err(error)
    }

    /// Samples one arm and executes commands, until the arm is lost or the monitor quits.
    fn watch(&mut self, arm: &mut Arm) -> WatchEnd {
        let mut unanswered = 0;
        let mut due = Instant::now();
        loop {
            let ended = match ArmSample::take(arm, self.start) {
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

    /// Executes commands until the next sample is due.
    fn execute_until(&mut self, arm: &mut Arm, due: Instant) -> Result<(), WatchEnd> {
        loop {
            match self.commands.recv_timeout(due.saturating_duration_since(Instant::now())) {
                // A stop goes before pending commands.
                Ok(_) if Interrupt::is_requested() => return Err(WatchEnd::Quit),
                Ok(command) => self.execute(arm, command)?,
                Err(RecvTimeoutError::Timeout) => return Ok(()),
                Err(RecvTimeoutError::Disconnected) => return Err(WatchEnd::Quit),
            }
        }
    }

    /// Executes a command, and reports a warning or a refusal to the screen. Fails only if the port or the screen is gone.
    fn execute(&mut self, arm: &mut Arm, command: UiCommand) -> Result<(), WatchEnd> {
        let (refusal, lost) = match self.try_execute(arm, command) {
            Ok(None) => return Ok(()),
            Ok(Some(warning)) => {
                return self.tell(ArmEvent::Warned(warning)).map_err(|ChannelClosed| WatchEnd::Quit);
            }
            Err(CommandError::Exchange(error)) => (CommandError::MayMove(error.into()), Some(error)),
            Err(failure) => (failure, None),
        };
        let refusal = refusal.message().unwrap_or_default();
        self.tell(ArmEvent::Refused(refusal)).map_err(|ChannelClosed| WatchEnd::Quit)?;
        match lost {
            Some(error @ Error::Port(_)) => Err(error.into()),
            _ => Ok(()),
        }
    }

    /// Executes a command and verifies it. Returns a warning for the user, if there is one.
    fn try_execute(&mut self, arm: &mut Arm, command: UiCommand) -> Result<Option<String>, CommandError> {
        let guard = self.guard.as_ref();
        match command {
            UiCommand::Nudge { joint, degrees } => return nudge(arm, guard, joint, degrees),
            UiCommand::Jog { axes, millimetres } => jog_tip(arm, &mut self.jog, guard, axes, millimetres)?,
            UiCommand::SpeedChange { joint, change } => {
                let joints = arm.read(SPEED.of(joint), 1)?;
                let steps = joints.first().copied().unwrap_or(0);
                arm.write_checked(SPEED.address, &[change.after(steps); 7])?;
            }
            UiCommand::Stop => hold(arm).map(drop)?,
            // Writing state 1 again does not stop an arm in state 1.
            UiCommand::State(motor_state::SERVO) if arm.joints()?.is_driven() => hold(arm).map(drop)?,
            UiCommand::State(motor_state::SERVO) => arm.engage_and_watch()?,
            UiCommand::State(state) => arm.write_motion(MOTOR_STATE.address, &[state])?,
        }
        Ok(None)
    }

    fn tell(&self, event: ArmEvent) -> Result<(), ChannelClosed> {
        self.events.send(event).map_err(|_| ChannelClosed)
    }

    /// Waits. Refuses commands meanwhile, because there is no arm.
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

/// Changes a joint's target by some degrees. Reads the target first, because the target on the screen may be old. Returns a
/// warning if the guard would not allow the pose.
fn nudge(
    arm: &mut Arm,
    guard: Option<&Guard>,
    joint: Joint,
    degrees: i16,
) -> Result<Option<String>, CommandError> {
    arm.end_abandoned_stream()?;
    let joints = arm.wait_until_settled()?;
    let wanted = step_target(&joints, joint, degrees)?.max(0);
    let wanted = u8::try_from(wanted).unwrap_or(u8::MAX).min(Angle::MAX_DEGREES);
    JointMove::begin(arm, Joint::ALL.map(|other| (other == joint).then_some(wanted)))?;
    let mut targets = joints.targets();
    for (target, _) in targets.iter_mut().zip(Joint::ALL).filter(|(_, other)| *other == joint) {
        *target = wanted;
    }
    let [t1, t2, t3, t4, t5, ..] = targets.map(f64::from);
    let breach = guard.and_then(|guard| guard.check_pose([t1, t2, t3, t4, t5]).err());
    Ok(breach.map(|breach| breach.to_string()))
}

/// Moves the tip by some millimetres. Reads the targets first, because the targets on the screen may be old.
fn jog_tip(
    arm: &mut Arm,
    jog: &mut Option<Jog>,
    guard: Option<&Guard>,
    axes: JogAxes,
    millimetres: [i16; 3],
) -> Result<(), CommandError> {
    arm.end_abandoned_stream()?;
    let joints = arm.wait_until_settled()?;
    for joint in Joint::ALL {
        // Fails if the joint does not answer, or may still have its target of power-up.
        step_target(&joints, joint, 0)?;
    }
    let targets = joints.targets().map(Angle::from_register);
    let [x, y, z] = millimetres.map(f64::from);
    let next = Jog::step(*jog, targets, axes, Vector::new(x, y, z), guard);
    let next = next.map_err(|reason| CommandError::Arm(format!("no step: {reason}")))?;
    JointMove::begin(arm, next.targets.map(|target| Some(target.degrees())))?;
    *jog = Some(next);
    Ok(())
}
