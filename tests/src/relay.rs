//! A port between a program and a simulator. A test acts on the arm at an exact frame, disturbs frames, or unplugs the port.
//!
//! ```text
//!   program ◀──▶ pseudo-terminal ◀── Relay ──▶ port of the simulator
//!                                      └── before a certain frame: the action of the test
//! ```
//!
//! What the test does at a frame does not depend on how fast the machine is.

use std::ffi::OsStr;
use std::os::fd::OwnedFd;
use std::os::unix::ffi::OsStrExt;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::{self, JoinHandle};

use rustix::event::{PollFd, PollFlags, Timespec, poll};
use rustix::fs::{Mode, OFlags, open};
use rustix::io::Errno;
use rustix::pty::{OpenptFlags, grantpt, openpt, ptsname, unlockpt};
use rustix::termios::{OptionalActions, tcgetattr, tcsetattr};

use crate::frames::{FrameSplitter, is_target};
use crate::wait::wait_for;

/// The longest wait for bytes, in nanoseconds. After it the relay checks whether it has to end.
const POLL_NANOS: i64 = 20_000_000;

/// The time of the action: directly before the relay passes this frame on. N counts from 1.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Moment {
    /// The Nth frame of the program.
    Request(u32),
    /// The Nth frame of the program after the first one that writes a target.
    AfterTarget(u32),
    /// The Nth frame of the arm.
    Reply(u32),
}

/// What the action of the test does to the line.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LineAction {
    /// The relay passes frames on.
    Nothing,
    /// The relay closes both ends, as when a cable is unplugged.
    Unplug,
}

/// A frame that the relay is about to pass on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Passing<'a> {
    /// From the program to the arm.
    Request(&'a [u8]),
    /// From the arm to the program.
    Reply(&'a [u8]),
}

/// Sees each frame before it is passed on.
pub type Watch = Box<dyn FnMut(Passing<'_>) + Send>;

/// What the relay does besides passing frames on.
pub struct RelayPlan {
    /// When the action takes place.
    pub moment: Moment,
    /// What the test does at this moment. The result says what happens to the line.
    pub action: Box<dyn FnMut() -> LineAction + Send>,
    /// If true, the relay makes the checksum of every 9th request, every 9th report and every 7th other frame of the arm wrong.
    /// These numbers let at least one of three successive tries of a read succeed.
    pub is_noisy: bool,
}

/// A port for a program. It exists until this value is dropped, or the action unplugs the line.
pub struct Relay {
    path: PathBuf,
    /// Keeps the raw mode while no program has the port open.
    _terminal: OwnedFd,
    is_over: Arc<AtomicBool>,
    thread: Option<JoinHandle<bool>>,
}

impl Relay {
    /// Opens a port that leads to the arm at `port`.
    #[must_use]
    pub fn open(port: &Path, plan: RelayPlan) -> Self {
        Self::open_with(port, plan, Box::new(|_| ()))
    }

    /// Opens a port that leads to the arm at `port`, and shows each frame to `watch`.
    #[must_use]
    pub fn open_watched(port: &Path, watch: Watch) -> Self {
        let plan = RelayPlan {
            moment: Moment::Request(u32::MAX),
            action: Box::new(|| LineAction::Nothing),
            is_noisy: false,
        };
        Self::open_with(port, plan, watch)
    }

    fn open_with(port: &Path, plan: RelayPlan, watch: Watch) -> Self {
        let master = openpt(OpenptFlags::RDWR | OpenptFlags::NOCTTY | OpenptFlags::CLOEXEC).expect("a port");
        grantpt(&master).and_then(|()| unlockpt(&master)).expect("a port");
        let name = ptsname(&master, Vec::new()).expect("a name");
        let path = PathBuf::from(OsStr::from_bytes(name.to_bytes()));
        let terminal =
            open(&path, OFlags::RDWR | OFlags::NOCTTY | OFlags::CLOEXEC, Mode::empty()).expect("a port");
        let mut mode = tcgetattr(&terminal).expect("a mode");
        mode.make_raw();
        tcsetattr(&terminal, OptionalActions::Now, &mode).expect("raw mode");
        let is_over = Arc::new(AtomicBool::new(false));
        let line = Line {
            program: master,
            arm: open_arm(port),
            is_over: Arc::clone(&is_over),
            requests: FrameSplitter::new(false),
            replies: FrameSplitter::new(true),
            after_target: None,
            plan,
            watch,
            has_acted: false,
            reports: 0,
            answers: 0,
        };
        let thread = Some(thread::spawn(move || line.run()));
        Self { path, _terminal: terminal, is_over, thread }
    }

    /// The path of the port that the program opens.
    #[must_use]
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Ends the relay. Returns whether the action took place.
    #[must_use]
    pub fn end(mut self) -> bool {
        self.stop()
    }

    fn stop(&mut self) -> bool {
        self.is_over.store(true, Ordering::SeqCst);
        self.thread.take().is_some_and(|thread| thread.join().expect("the relay"))
    }
}

impl Drop for Relay {
    fn drop(&mut self) {
        self.stop();
    }
}

/// Opens the port of the arm. Another program may have it open for a moment.
fn open_arm(port: &Path) -> OwnedFd {
    let flags = OFlags::RDWR | OFlags::NOCTTY | OFlags::NONBLOCK | OFlags::CLOEXEC;
    wait_for("the port of the arm", || open(port, flags, Mode::empty()).map_err(|error| error.to_string()))
}

/// Both ends, and the frames between them.
struct Line {
    program: OwnedFd,
    arm: OwnedFd,
    is_over: Arc<AtomicBool>,
    requests: FrameSplitter,
    replies: FrameSplitter,
    /// Frames of the program since the first target.
    after_target: Option<u32>,
    plan: RelayPlan,
    watch: Watch,
    has_acted: bool,
    /// The number of reports from the arm on a noisy line. `answers` counts the arm's other frames.
    reports: u32,
    answers: u32,
}

impl Line {
    /// Passes bytes on until the test ends the relay or the action unplugs the line. Returns whether the action took place.
    fn run(mut self) -> bool {
        while !self.is_over.load(Ordering::SeqCst) && self.pass_bytes() == LineAction::Nothing {}
        self.has_acted
    }

    fn pass_bytes(&mut self) -> LineAction {
        let mut ends = [PollFd::new(&self.program, PollFlags::IN), PollFd::new(&self.arm, PollFlags::IN)];
        let timeout = Timespec { tv_sec: 0, tv_nsec: POLL_NANOS };
        // A signal ends the wait, too.
        let _ = poll(&mut ends, Some(&timeout));
        let [has_requests, has_replies] = ends.map(|end| end.revents().contains(PollFlags::IN));
        if has_requests {
            read(&self.program, &mut self.requests);
        }
        while let Some(frame) = self.requests.next() {
            if self.pass_request(frame) == LineAction::Unplug {
                return LineAction::Unplug;
            }
        }
        if has_replies {
            read(&self.arm, &mut self.replies);
        }
        while let Some(frame) = self.replies.next() {
            if self.pass_reply(frame) == LineAction::Unplug {
                return LineAction::Unplug;
            }
        }
        LineAction::Nothing
    }

    fn pass_request(&mut self, mut frame: Vec<u8>) -> LineAction {
        self.after_target = self.after_target.map(|count| count + 1);
        let moment = self.plan.moment;
        let is_due = moment == Moment::Request(self.requests.count())
            || self.after_target.is_some_and(|count| moment == Moment::AfterTarget(count));
        if is_target(&frame) {
            self.after_target.get_or_insert(0);
        }
        if is_due && self.act() == LineAction::Unplug {
            return LineAction::Unplug;
        }
        if self.plan.is_noisy {
            disturb(&mut frame, self.requests.count(), 9);
        }
        (self.watch)(Passing::Request(&frame));
        pass_on(&self.arm, &frame);
        LineAction::Nothing
    }

    fn pass_reply(&mut self, mut frame: Vec<u8>) -> LineAction {
        if self.plan.moment == Moment::Reply(self.replies.count()) && self.act() == LineAction::Unplug {
            return LineAction::Unplug;
        }
        if self.plan.is_noisy {
            // Reports and answers have separate counters. With a common counter, regular reports between the answers could
            // cause every answer to be disturbed, or none.
            let (count, each) =
                if is_report(&frame) { (&mut self.reports, 9) } else { (&mut self.answers, 7) };
            *count += 1;
            disturb(&mut frame, *count, each);
        }
        (self.watch)(Passing::Reply(&frame));
        let _ = rustix::io::write(&self.program, &frame);
        LineAction::Nothing
    }

    /// Runs the action of the plan at the first call only.
    fn act(&mut self) -> LineAction {
        let is_first = !std::mem::replace(&mut self.has_acted, true);
        if is_first { (self.plan.action)() } else { LineAction::Nothing }
    }
}

/// Reads at most 4096 bytes from the source into the splitter.
fn read(source: &OwnedFd, splitter: &mut FrameSplitter) {
    let mut chunk = [0; 4096];
    let length = rustix::io::read(source, &mut chunk).unwrap_or(0);
    splitter.push(&chunk[..length]);
}

/// Writes a frame. Gives up without an error if the arm takes no bytes for a second or is gone: a test may cause this.
fn pass_on(arm: &OwnedFd, frame: &[u8]) {
    let mut rest = frame;
    while !rest.is_empty() {
        match rustix::io::write(arm, rest) {
            Ok(count) => rest = rest.get(count..).unwrap_or_default(),
            Err(Errno::AGAIN | Errno::INTR) => {
                let timeout = Timespec { tv_sec: 1, tv_nsec: 0 };
                if poll(&mut [PollFd::new(arm, PollFlags::OUT)], Some(&timeout)).is_ok_and(|ready| ready == 0)
                {
                    return;
                }
            }
            Err(_) => return,
        }
    }
}

/// Makes the checksum of a frame wrong if `number` is a multiple of `each`.
fn disturb(frame: &mut [u8], number: u32, each: u32) {
    if let Some(last) = frame.last_mut()
        && number.is_multiple_of(each)
    {
        *last ^= 0x55;
    }
}

/// Does the frame hold registers 142 to 155 or 142 to 183, as reports do if register 189 is 1 or 2?
fn is_report(frame: &[u8]) -> bool {
    matches!(frame, [_, _, 0x03, 142, 14 | 42, ..])
}
