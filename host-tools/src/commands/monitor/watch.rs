//! Who talks to the arm while the screen is drawn: takes samples, fulfils wishes, and finds the arm again when
//! it went away.
//!
//! Runs in a thread of its own: a port that does not answer holds up neither keys nor picture. Ends when
//! nobody wishes any more.

use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender};
use std::time::{Duration, Instant};

use sevenbot::change::Unchanged;
use sevenbot::map::{MOTOR_STATE, SPEED, TARGET_POSITION};
use sevenbot::{Angle, Arm, Error, Joint, Options, ports};

use super::sample::Sample;
use super::view::{News, Wish};

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
    pub(crate) fn run(mut self) {
        while self.look().is_ok() {}
    }

    /// Finds the arm and watches it for as long as it is there; then waits a little.
    fn look(&mut self) -> Result<(), Ended> {
        match self.open() {
            Ok(mut arm) => {
                let firmware = arm.identity().version();
                self.tell(News::Found { port: arm.port().to_owned(), firmware })?;
                match self.watch(&mut arm) {
                    Break::Ended => return Err(Ended),
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
                Ok(wish) => match grant(arm, wish) {
                    Ok(unchanged) => self.tell_refused(&unchanged)?,
                    Err(Error::NoAnswer { heard, .. }) => {
                        let news = News::Unanswered { damaged: heard.damaged_frames };
                        self.tell(news).map_err(|Ended| Break::Ended)?;
                    }
                    Err(error) => return Err(error.into()),
                },
                Err(RecvTimeoutError::Timeout) => return Ok(()),
                Err(RecvTimeoutError::Disconnected) => return Err(Break::Ended),
            }
        }
    }

    fn tell_refused(&self, unchanged: &[Unchanged]) -> Result<(), Break> {
        unchanged
            .first()
            .map_or(Ok(()), |first| self.tell(News::Refused(first.to_string())).map_err(|Ended| Break::Ended))
    }

    fn tell(&self, news: News) -> Result<(), Ended> {
        self.news.send(news).map_err(|_| Ended)
    }

    /// Waits; what is wished meanwhile has nobody to fulfil it.
    fn pause(&self, duration: Duration) -> Result<(), Ended> {
        let end = Instant::now() + duration;
        loop {
            match self.wishes.recv_timeout(end.saturating_duration_since(Instant::now())) {
                Ok(_) => {}
                Err(RecvTimeoutError::Timeout) => return Ok(()),
                Err(RecvTimeoutError::Disconnected) => return Err(Ended),
            }
        }
    }
}

/// Does what is wished, and says what did not take.
fn grant(arm: &mut Arm, wish: Wish) -> Result<Vec<Unchanged>, Error> {
    match wish {
        Wish::Nudge { joint, degrees } => nudge(arm, joint, degrees),
        Wish::Pace { joint, pace } => {
            let steps = register(arm, SPEED.of(joint))?;
            arm.write_checked(SPEED.address, &[pace.after(steps); 7])
        }
        Wish::State(state) => arm.write_checked(MOTOR_STATE.address, &[state]),
    }
}

/// What a register holds now. What the screen shows of it may be older than the last wish.
fn register(arm: &mut Arm, address: u8) -> Result<u8, Error> {
    Ok(arm.read(address, 1)?.first().copied().unwrap_or(0))
}

/// Moves a joint's target from where it is now.
fn nudge(arm: &mut Arm, joint: Joint, degrees: i16) -> Result<Vec<Unchanged>, Error> {
    let address = TARGET_POSITION.of(joint);
    let target = register(arm, address)?;
    let wanted = (i16::from(target) + degrees).clamp(0, i16::from(Angle::MAX_DEGREES));
    let wanted = u8::try_from(wanted).unwrap_or(target);
    arm.write_checked(address, &[wanted])
}
