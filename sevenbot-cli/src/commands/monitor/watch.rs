//! Who talks to the arm while the screen is drawn: takes samples, fulfils wishes, and finds the arm again when
//! it went away.
//!
//! Runs in a thread of its own: a port that does not answer holds up neither keys nor picture. Ends when
//! nobody wishes any more.

use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender};
use std::time::{Duration, Instant};

use sevenbot::joints::JointSnapshot;
use sevenbot::map::{MOTOR_STATE, SPEED, TARGET_POSITION, motor_state};
use sevenbot::{Angle, Arm, Error, Joint, Options, ports};

use super::sample::Sample;
use super::view::{News, Wish};
use crate::commands::{all_taken, motors_obey};
use crate::failure::Failure;
use crate::interrupt::{Interrupt, hold};
use crate::moving::stepped;

/// How long to wait before looking for an arm again.
const LOOK_AGAIN: Duration = Duration::from_millis(500);
/// After so many lost answers in a row the arm counts as gone.
const LOST_AFTER: u32 = 3;

/// The one who watches.
pub(crate) struct Watcher {
    /// The port asked for; none: whichever leads to an arm.
    pub(crate) port: Option<String>,
    /// The port that was used last.
    pub(crate) last_port: String,
    /// How to talk to it.
    pub(crate) options: Options,
    /// Between two samples.
    pub(crate) period: Duration,
    pub(crate) start: Instant,
    pub(crate) news: Sender<News>,
    pub(crate) wishes: Receiver<Wish>,
    /// The arm that was watched at the end.
    pub(crate) arm: Option<Arm>,
}

/// Nobody listens any more.
struct Ended;

/// Why watching one arm came to an end.
enum Break {
    Ended,
    Lost(Error),
}

impl From<Error> for Break {
    fn from(error: Error) -> Self {
        Self::Lost(error)
    }
}

impl Watcher {
    /// Watches, until nobody wishes any more.
    /// After Ctrl-C the arm is made to hold: returns what became of that, or `None` if there was no arm.
    pub(crate) fn run(mut self) -> Option<Result<JointSnapshot, Failure>> {
        while self.look().is_ok() {}
        let arm = self.arm.take();
        if Interrupt::is_wished() { arm.map(|mut arm| hold(&mut arm)) } else { None }
    }

    /// Finds the arm and watches it for as long as it is there; then waits a little.
    fn look(&mut self) -> Result<(), Ended> {
        match self.open() {
            Ok(mut arm) => {
                let firmware = arm.identity().version();
                self.tell(News::Found { port: arm.port().to_owned(), firmware })?;
                match self.watch(&mut arm) {
                    Break::Ended => {
                        self.arm = Some(arm);
                        return Err(Ended);
                    }
                    Break::Lost(error) => self.tell(News::Lost(error.to_string()))?,
                }
            }
            Err(reason) => self.tell(News::Lost(reason))?,
        }
        self.pause(LOOK_AGAIN)
    }

    /// Opens the port that was asked for or used last, or else another one that leads to an arm.
    fn open(&mut self) -> Result<Arm, String> {
        // An answer that is missing is news, and the next sample asks again.
        let options = Options { attempts: 1, ..self.options };
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
    fn watch(&self, arm: &mut Arm) -> Break {
        let mut unanswered = 0;
        let mut due = Instant::now();
        loop {
            let ended = match Sample::take(arm, self.start) {
                Ok(sample) => {
                    unanswered = 0;
                    self.tell(News::Sample(sample))
                }
                Err(Error::NoAnswer { heard, .. }) if unanswered + 1 < LOST_AFTER => {
                    unanswered += 1;
                    self.tell(News::Unanswered { damaged: heard.damaged_frames })
                }
                Err(error) => return Break::Lost(error),
            };
            due = (due + self.period).max(Instant::now());
            if let Err(reason) = ended.map_err(|Ended| Break::Ended).and_then(|()| self.fulfil(arm, due)) {
                return reason;
            }
        }
    }

    /// Does what is wished, until it is time for the next sample.
    fn fulfil(&self, arm: &mut Arm, due: Instant) -> Result<(), Break> {
        loop {
            match self.wishes.recv_timeout(due.saturating_duration_since(Instant::now())) {
                // A stop does not wait for the wishes before it.
                Ok(_) if Interrupt::is_wished() => return Err(Break::Ended),
                Ok(wish) => self.grant(arm, wish)?,
                Err(RecvTimeoutError::Timeout) => return Ok(()),
                Err(RecvTimeoutError::Disconnected) => return Err(Break::Ended),
            }
        }
    }

    /// Does what is wished, and tells what did not take.
    fn grant(&self, arm: &mut Arm, wish: Wish) -> Result<(), Break> {
        let (refusal, lost) = match fulfilled(arm, wish) {
            Ok(()) => return Ok(()),
            Err(Failure::Wire(error)) => (Failure::MayMove(error.to_string()), Some(error)),
            Err(failure) => (failure, None),
        };
        let refusal = refusal.message().unwrap_or_default();
        self.tell(News::Refused(refusal)).map_err(|Ended| Break::Ended)?;
        match lost {
            Some(error @ Error::Port(_)) => Err(error.into()),
            _ => Ok(()),
        }
    }

    fn tell(&self, news: News) -> Result<(), Ended> {
        self.news.send(news).map_err(|_| Ended)
    }

    /// Waits; what is wished meanwhile has nobody to fulfil it.
    fn pause(&self, duration: Duration) -> Result<(), Ended> {
        let end = Instant::now() + duration;
        loop {
            match self.wishes.recv_timeout(end.saturating_duration_since(Instant::now())) {
                Ok(_) => self.tell(News::Refused("there is no arm: nothing was written".to_owned()))?,
                Err(RecvTimeoutError::Timeout) => return Ok(()),
                Err(RecvTimeoutError::Disconnected) => return Err(Ended),
            }
        }
    }
}

/// Does what is wished, and makes sure of it.
fn fulfilled(arm: &mut Arm, wish: Wish) -> Result<(), Failure> {
    match wish {
        Wish::Nudge { joint, degrees } => nudge(arm, joint, degrees),
        Wish::Pace { joint, pace } => {
            let joints = arm.read(SPEED.of(joint), 1)?;
            let steps = joints.first().copied().unwrap_or(0);
            all_taken(&arm.write_checked(SPEED.address, &[pace.after(steps); 7])?)
        }
        // In the servo state already, the same state again would stop nothing.
        Wish::State(motor_state::SERVO) if arm.joints()?.is_driven() => hold(arm).map(drop),
        Wish::State(state) => motors_obey(arm.write_checked(MOTOR_STATE.address, &[state])),
    }
}

/// Moves a joint's target from where it is now. What the screen shows of it may be older than the last wish.
fn nudge(arm: &mut Arm, joint: Joint, degrees: i16) -> Result<(), Failure> {
    let wanted = stepped(&arm.wait_until_settled()?, joint, degrees)?.max(0);
    let wanted = u8::try_from(wanted).unwrap_or(u8::MAX).min(Angle::MAX_DEGREES);
    motors_obey(arm.write_checked(TARGET_POSITION.of(joint), &[wanted]))
}
