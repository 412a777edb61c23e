//! What the thread of Python tells the thread of the port, and what the two share during one call.

use std::cell::RefCell;
use std::collections::VecDeque;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::mpsc::{Receiver, SyncSender};
use std::time::Duration;

use sevenbot::Arm;
use sevenbot::approach::FirstPoints;
use sevenbot::moves::{Observer, Stage};
use sevenbot::stream::{SetPointStream, StreamError, StreamOptions, StreamPace};

/// The longest time that a read of another thread waits for an arm that moves.
const BETWEEN_READS: Duration = Duration::from_millis(20);

/// A stream, when its next point is due, and which joints had one.
pub(crate) struct PacedStream<'a> {
    pub(crate) stream: SetPointStream<'a>,
    pub(crate) pace: StreamPace,
    pub(crate) first: FirstPoints,
    /// The last point of each joint in degrees, and the target at the start where it had none.
    pub(crate) pose: [f64; 7],
    /// How often a simulated arm was restored when the stream began.
    pub(crate) restores: u64,
}

impl<'a> PacedStream<'a> {
    pub(crate) fn open(arm: &'a mut Arm, options: StreamOptions, restores: u64) -> Result<Self, StreamError> {
        let mut stream = SetPointStream::open(arm, options)?;
        let pose = stream.arm().standing()?.targets;
        let pace = StreamPace::new(stream.arm().elapsed(), options.period());
        Ok(Self { stream, pace, first: FirstPoints::default(), pose, restores })
    }
}

type ArmCall = Box<dyn FnOnce(&mut Arm, &Inbox) + Send>;
type StreamCall = Box<dyn FnOnce(&mut PacedStream<'_>, &Inbox) + Send>;
type StreamResult = SyncSender<Result<(), StreamError>>;

/// What the thread of the port shall do.
pub(crate) enum Message {
    Call(ArmCall),
    /// A short read, which changes nothing.
    Read(ArmCall),
    OpenStream(StreamOptions, u64, StreamResult),
    StreamCall(StreamCall),
    CloseStream(StreamResult),
}

/// What the two threads of a call share.
#[derive(Debug, Default)]
pub(crate) struct CallState {
    is_interrupted: AtomicBool,
    /// The number of stops so far, and that at the start of the call.
    stops: Arc<AtomicU64>,
    stops_before: u64,
    done: AtomicU64,
    total: AtomicU64,
}

impl CallState {
    /// The state of a new call.
    pub(crate) fn new(stops: &Arc<AtomicU64>) -> Self {
        let stops_before = stops.load(Ordering::Relaxed);
        Self { stops: Arc::clone(stops), stops_before, ..Self::default() }
    }

    /// A signal of Python ends the call.
    pub(crate) fn interrupt(&self) {
        self.is_interrupted.store(true, Ordering::Relaxed);
    }

    /// How much is done, and of how much.
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
    messages: Receiver<Message>,
    /// Those that came during a call and are no reads, oldest first.
    deferred: RefCell<VecDeque<Message>>,
}

impl Inbox {
    pub(crate) fn new(messages: Receiver<Message>) -> Self {
        Self { messages, deferred: RefCell::default() }
    }

    /// The next message; `None` if the arm is closed.
    pub(crate) fn next(&self) -> Option<Message> {
        let deferred = self.deferred.borrow_mut().pop_front();
        deferred.or_else(|| self.messages.recv().ok())
    }

    /// Runs the reads that other threads wait for. Keeps everything else for later, in its order.
    fn serve_reads(&self, arm: &mut Arm) {
        while let Ok(message) = self.messages.try_recv() {
            match message {
                Message::Read(call) => call(arm, self),
                other => self.deferred.borrow_mut().push_back(other),
            }
        }
    }
}

/// The end of a [`CallState`] in the thread of the port.
pub(crate) struct Watch<'a> {
    pub(crate) state: Arc<CallState>,
    pub(crate) inbox: &'a Inbox,
}

impl Watch<'_> {
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
