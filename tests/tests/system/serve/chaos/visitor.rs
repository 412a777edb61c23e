//! A program that connects to the server again and again, and behaves at random each time.

use std::ops::AddAssign;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::thread;
use std::time::{Duration, Instant};

use system_tests::random::Random;
use system_tests::registers::SPEED;
use system_tests::relay::Passing;

use super::frame_visits::FrameVisit;
use super::sent_targets::SentTargets;
use super::visit::Visit;
use super::web_visits::WebVisit;
use super::wire::{Security, WayIn};
use crate::serve::line_history::LineHistory;

/// A reply that has not come after this time is lost. On a pseudo-terminal, bytes before the first reply start
/// the time again, because they may be for an earlier program.
const LOST: Duration = Duration::from_secs(30);
/// A reply is lost after this time even if other frames come: reports, and replies to an earlier program.
const LONGEST: Duration = Duration::from_secs(120);
/// If there was an outage during a request, a reply that has not come within this time of the request counts as cut, not as lost.
const AFTER_OUTAGE: Duration = Duration::from_secs(1);
/// The number of programs that have a register of their own, from [`SPEED`] on.
const OWNERS: u8 = 14;

/// What all programs share.
pub(crate) struct Chaos {
    pub(crate) security: Security,
    end: Instant,
    /// Ends all programs, also before `end`.
    is_over: AtomicBool,
    pub(crate) targets: SentTargets,
    history: LineHistory,
    /// The number of beginnings and ends of outages: odd from unplugging until the arm answers again.
    outages: AtomicU64,
    questions: AtomicU64,
}

impl Chaos {
    pub(crate) fn new(security: Security, length: Duration) -> Self {
        Self {
            security,
            end: Instant::now() + length,
            is_over: AtomicBool::new(false),
            targets: SentTargets::new(),
            history: LineHistory::default(),
            outages: AtomicU64::new(0),
            questions: AtomicU64::new(0),
        }
    }

    pub(crate) fn is_over(&self) -> bool {
        self.is_over.load(Ordering::SeqCst) || Instant::now() >= self.end
    }

    /// Ends all programs when it is dropped.
    pub(crate) const fn ends_at_drop(&self) -> End<'_> {
        End(self)
    }

    /// Notes that the arm is about to be unplugged, or that it answers again.
    pub(crate) fn turn_over(&self) {
        self.history.turn_over();
        self.outages.fetch_add(1, Ordering::SeqCst);
    }

    pub(crate) fn outages(&self) -> u64 {
        self.outages.load(Ordering::SeqCst).div_ceil(2)
    }

    /// Registers that no other program reads at about the same time: the first one, and how many.
    pub(super) fn question(&self) -> (u8, u8) {
        let number = self.questions.fetch_add(1, Ordering::SeqCst);
        let (address, count) = (60 + number % 100, 15 + number / 100 % 40);
        (u8::try_from(address).expect("small"), u8::try_from(count).expect("small"))
    }

    /// Notes a frame on the arm's line.
    pub(crate) fn note(&self, passing: Passing<'_>) {
        self.targets.note(passing);
        self.history.note(passing);
    }

    /// How many reads and replies the arm's line carried of late, and the age of the last ones.
    pub(crate) fn line_of_late(&self) -> String {
        self.history.of_late()
    }

    /// Begins the wait for the reply that holds `asked`: the first register, and how many.
    pub(super) fn wait(&self, asked: (u8, u8)) -> ReplyWait<'_> {
        ReplyWait {
            chaos: self,
            asked,
            sent: Instant::now(),
            quiet_since: Instant::now(),
            outages: self.outages.load(Ordering::SeqCst),
        }
    }
}

/// Ends all programs when it is dropped, also by a panic.
pub(crate) struct End<'a>(&'a Chaos);

impl Drop for End<'_> {
    fn drop(&mut self) {
        self.0.is_over.store(true, Ordering::SeqCst);
    }
}

/// The wait of a program for a reply.
pub(super) struct ReplyWait<'a> {
    chaos: &'a Chaos,
    asked: (u8, u8),
    sent: Instant,
    /// When bytes for an earlier program were last received; at first, when the wait began.
    quiet_since: Instant,
    outages: u64,
}

impl ReplyWait<'_> {
    /// Was the arm unplugged during the wait, so that the reply may be missing?
    pub(super) fn may_be_cut(&self) -> bool {
        let now = self.chaos.outages.load(Ordering::SeqCst);
        self.outages % 2 == 1 || now != self.outages
    }

    /// Notes that frames for an earlier program were received. They come before this reply.
    pub(super) fn progress(&mut self) {
        self.quiet_since = Instant::now();
    }

    /// Why the wait has ended; `None` while it goes on.
    pub(super) fn ended(&self) -> Option<Answer> {
        let elapsed = self.sent.elapsed();
        if elapsed >= AFTER_OUTAGE && self.may_be_cut() {
            return Some(Answer::Cut);
        }
        (self.quiet_since.elapsed() >= LOST || elapsed >= LONGEST).then(|| self.lost())
    }

    /// The reply is lost. Prints the frames on the line and the outages around this time.
    pub(super) fn lost(&self) -> Answer {
        println!("lost: {}", self.chaos.history.told(self.sent, self.asked));
        Answer::Lost
    }
}

/// The outcome of a question.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Answer {
    /// The reply came, with the written value if the program wrote one.
    Replied,
    /// No reply, or one without the written value, because the arm was unplugged.
    Cut,
    /// No reply, although the arm was connected.
    Lost,
    /// Another frame than the reply.
    Crossed,
    /// The server has ended the connection.
    Ended,
}

/// Counts of what happened to the connections and questions of a program.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Tally {
    pub(crate) visits: usize,
    /// Connections that the server refused, or that ended before their first reply.
    pub(crate) turned_away: usize,
    pub(crate) replies: usize,
    /// Questions without their reply because of an outage.
    pub(crate) cut: usize,
    pub(crate) lost: usize,
    pub(crate) crossed: usize,
    /// Connections that ended early, before or after their first reply.
    pub(crate) ended: usize,
    pub(crate) resets: usize,
}

impl Tally {
    pub(super) fn note(&mut self, answer: Answer) {
        match answer {
            Answer::Replied => self.replies += 1,
            Answer::Cut => self.cut += 1,
            Answer::Lost => self.lost += 1,
            Answer::Crossed => self.crossed += 1,
            Answer::Ended => self.ended += 1,
        }
    }
}

impl AddAssign for Tally {
    fn add_assign(&mut self, other: Self) {
        self.visits += other.visits;
        self.turned_away += other.turned_away;
        self.replies += other.replies;
        self.cut += other.cut;
        self.lost += other.lost;
        self.crossed += other.crossed;
        self.ended += other.ended;
        self.resets += other.resets;
    }
}

/// Connects again and again until the chaos is over, and counts visits, replies and refusals.
pub(crate) fn visit(chaos: &Chaos, way_in: &WayIn, number: u8, seed: u64) -> Tally {
    let mut random = Random::new(seed ^ u64::from(number) << 32);
    let mut tally = Tally::default();
    let own = (number < OWNERS).then(|| SPEED + number);
    while !chaos.is_over() {
        let before = tally.replies;
        tally.visits += 1;
        let last = match way_in {
            WayIn::Web { address, is_page } => {
                WebVisit::open(chaos, address, *is_page).map(|visit| visit.run(own, &mut random, &mut tally))
            }
            _ => FrameVisit::open(chaos, way_in).map(|visit| visit.run(own, &mut random, &mut tally)),
        };
        match last {
            Some(Answer::Replied) => {}
            // The server keeps the requests of an ended connection for 200 ms at most. After this longer pause, none of them is
            // left.
            Some(Answer::Cut) => thread::sleep(Duration::from_millis(400)),
            None | Some(Answer::Ended) if tally.replies == before => {
                tally.turned_away += 1;
                thread::sleep(Duration::from_millis(50));
            }
            _ => thread::sleep(Duration::from_millis(50)),
        }
    }
    tally
}
