//! What the thread of Python tells the thread of the port, and what the two share during one call.

use std::cell::RefCell;
use std::collections::VecDeque;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, SyncSender};
use std::time::Duration;

use sevenbot::Arm;
use sevenbot::approach::{ApproachRule, FirstPoints};
use sevenbot::moves::{MoveError, Observer, Stage};
use sevenbot::simulated::SharedSimulation;
use sevenbot::stream::{LatestPoints, SetPointStream, StreamError, StreamOptions, StreamPace};

use crate::latest::LatestSlot;

/// While a call waits for joints, it serves the reads of other threads at least this often.
const BETWEEN_READS: Duration = Duration::from_millis(20);

/// The order of Python to open a stream.
pub(crate) struct StreamOrder {
    pub(crate) options: StreamOptions,
    pub(crate) rule: ApproachRule,
    pub(crate) slot: Arc<LatestSlot>,
    /// `None` for a real arm.
    pub(crate) simulation: Option<SharedSimulation>,
}

/// An open stream, with the time of its next point, and the joints that had a point.
pub(crate) struct PacedStream<'a> {
    pub(crate) stream: SetPointStream<'a>,
    pub(crate) pace: StreamPace,
    pub(crate) first: FirstPoints,
    pub(crate) rule: ApproachRule,
    /// The last point of each joint that `send` sent, in degrees; before it, the joint's target when the stream began, or began
    /// again.
    pub(crate) pose: [f64; 7],
    /// The points of a program that does not wait, and what it offers.
    pub(crate) points: LatestPoints,
    pub(crate) slot: Arc<LatestSlot>,
    /// The watchdog of the arm has acted since the last point.
    pub(crate) is_held: bool,
    /// The whole arm has failed since the last point: the next one is a first one.
    pub(crate) has_failed: bool,
    /// How often the arm has been stopped until now, and until the last check.
    pub(crate) stops: Arc<AtomicU64>,
    pub(crate) stops_before: u64,
    pub(crate) simulation: Option<SharedSimulation>,
    /// How often the simulated arm had been restored at the last check.
    pub(crate) restores: u64,
}

impl<'a> PacedStream<'a> {
    pub(crate) fn open(
        arm: &'a mut Arm,
        order: StreamOrder,
        stops: &Arc<AtomicU64>,
    ) -> Result<Self, StreamError> {
        let StreamOrder { options, rule, slot, simulation } = order;
        let mut stream = SetPointStream::open(arm, options)?;
        let pose = stream.arm().standing()?.targets;
        slot.open(pose);
        Ok(Self {
            pace: StreamPace::new(stream.arm().elapsed(), options.period()),
            stream,
            first: FirstPoints::default(),
            rule,
            pose,
            points: LatestPoints::new(options),
            slot,
            is_held: false,
            has_failed: false,
            stops: Arc::clone(stops),
            stops_before: stops.load(Ordering::Relaxed),
            restores: simulation.as_ref().map_or(0, SharedSimulation::restores),
            simulation,
        })
    }

    /// The time of the arm's line.
    pub(crate) fn elapsed(&mut self) -> Duration {
        self.stream.arm().elapsed()
    }

    /// Puts the registers back. Closes the slot for actions, even if the registers cannot be put back.
    pub(crate) fn close(self) -> Result<(), StreamError> {
        let closed = self.stream.close();
        self.slot.close();
        closed
    }
}

type ArmCall = Box<dyn FnOnce(&mut Arm, &Inbox) + Send>;
type StreamCall = Box<dyn FnOnce(&mut PacedStream<'_>, &Inbox) + Send>;
type StreamResult = SyncSender<Result<(), StreamError>>;

/// What the thread of the port shall do.
pub(crate) enum PortMessage {
    Call(ArmCall),
    /// A short read, which changes nothing.
    Read(ArmCall),
    /// Wait this long, in the time of the arm's line.
    Sleep(Duration, Arc<CallState>, SyncSender<Result<(), MoveError>>),
    OpenStream(StreamOrder, Arc<CallState>, StreamResult),
    StreamCall(StreamCall),
    /// Runs also if its caller has left.
    CloseStream(Arc<CallState>, StreamResult),
    /// Send the points that are due. An arm in virtual time ignores this: it sends them while its time passes.
    Wake,
}

/// What the two threads of a call share.
#[derive(Debug, Default)]
pub(crate) struct CallState {
    /// True once the thread of the port has begun the call, or the caller has left before that.
    is_claimed: AtomicBool,
    is_interrupted: AtomicBool,
    /// The number of stops so far, and the number of stops at the start of the call.
    stops: Arc<AtomicU64>,
    stops_before: u64,
    done: AtomicU64,
    total: AtomicU64,
}

impl CallState {
    pub(crate) fn new(stops: &Arc<AtomicU64>) -> Self {
        let stops_before = stops.load(Ordering::Relaxed);
        Self { stops: Arc::clone(stops), stops_before, ..Self::default() }
    }

    /// Claims the call, for the thread of the port to run it, or for the caller to leave before it runs. True for the first of
    /// the two.
    pub(crate) fn claim(&self) -> bool {
        !self.is_claimed.swap(true, Ordering::Relaxed)
    }

    /// Ends the call because of a signal of Python.
    pub(crate) fn interrupt(&self) {
        self.is_interrupted.store(true, Ordering::Relaxed);
    }

    /// The work done so far, and the total work; 0 while the total is unknown.
    pub(crate) fn progress(&self) -> (u64, u64) {
        (self.done.load(Ordering::Relaxed), self.total.load(Ordering::Relaxed))
    }

    fn is_stopped(&self) -> bool {
        self.stops.load(Ordering::Relaxed) != self.stops_before
    }

    fn goes_on(&self) -> bool {
        !self.is_interrupted.load(Ordering::Relaxed) && !self.is_stopped()
    }
}

/// The messages to the thread of the port.
pub(crate) struct Inbox {
    messages: Receiver<PortMessage>,
    /// The messages that came during a call and are not reads, oldest first.
    deferred: RefCell<VecDeque<PortMessage>>,
}

impl Inbox {
    pub(crate) fn new(messages: Receiver<PortMessage>) -> Self {
        Self { messages, deferred: RefCell::default() }
    }

    /// The next message; `None` if the arm is closed.
    pub(crate) fn next(&self) -> Option<PortMessage> {
        let deferred = self.deferred.borrow_mut().pop_front();
        deferred.or_else(|| self.messages.recv().ok())
    }

    /// As [`Self::next`], but [`PortMessage::Wake`] after this time.
    pub(crate) fn next_within(&self, time: Option<Duration>) -> Option<PortMessage> {
        let Some(time) = time else { return self.next() };
        if let Some(deferred) = self.deferred.borrow_mut().pop_front() {
            return Some(deferred);
        }
        match self.messages.recv_timeout(time) {
            Ok(message) => Some(message),
            Err(RecvTimeoutError::Timeout) => Some(PortMessage::Wake),
            Err(RecvTimeoutError::Disconnected) => None,
        }
    }

    /// Runs the reads that other threads wait for, and drops [`PortMessage::Wake`]. Keeps everything else for later, in its order.
    fn serve_reads(&self, arm: &mut Arm) {
        while let Ok(message) = self.messages.try_recv() {
            match message {
                PortMessage::Read(call) => call(arm, self),
                PortMessage::Wake => {}
                other => self.deferred.borrow_mut().push_back(other),
            }
        }
    }
}

/// A [`CallState`] as the thread of the port uses it.
pub(crate) struct Watch<'a> {
    pub(crate) state: Arc<CallState>,
    pub(crate) inbox: &'a Inbox,
}

impl<'a> Watch<'a> {
    /// For work that no call waits for. A stop after this ends the work.
    pub(crate) fn of_no_call(stops: &Arc<AtomicU64>, inbox: &'a Inbox) -> Self {
        Self { state: Arc::new(CallState::new(stops)), inbox }
    }

    /// Did another thread stop the arm during this call?
    pub(crate) fn is_stopped(&self) -> bool {
        self.state.is_stopped()
    }
}

impl Observer for Watch<'_> {
    fn goes_on(&mut self) -> bool {
        self.state.goes_on()
    }

    fn progress(&mut self, _: Stage, done: u64, total: u64) {
        self.state.done.store(done, Ordering::Relaxed);
        self.state.total.store(total, Ordering::Relaxed);
    }

    fn pause(&mut self, arm: &mut Arm, time: Duration) {
        let end = arm.now() + time;
        loop {
            self.inbox.serve_reads(arm);
            let left = end.saturating_duration_since(arm.now());
            if left.is_zero() {
                return;
            }
            arm.sleep(left.min(BETWEEN_READS));
        }
    }
}
