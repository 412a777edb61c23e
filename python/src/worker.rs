//! The thread that owns the port, and calls to it.
//!
//! ```text
//!   Worker::call ── Message ──▶ serve ──▶ Arm, or an open SetPointStream
//!        ▲                        │
//!        └──────── result ────────┘
//! ```

use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, SyncSender, channel, sync_channel};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::thread::{self, JoinHandle};
use std::time::Duration;

use pyo3::prelude::*;
use sevenbot::Arm;
use sevenbot::approach::FirstPoints;
use sevenbot::moves::{Observer, Stage};
use sevenbot::stream::{SetPointStream, StreamError, StreamOptions, StreamPace};

use crate::errors::{Closed, Raise};
use crate::progress::ProgressLine;

/// Time between two checks of Python's signals.
const SIGNAL_PERIOD: Duration = Duration::from_millis(50);

/// A stream, when its next point is due, and which joints had one.
pub(crate) struct PacedStream<'a> {
    pub(crate) stream: SetPointStream<'a>,
    pub(crate) pace: StreamPace,
    pub(crate) first: FirstPoints,
    /// The last point of each joint in degrees, and the target at the start where it had none.
    pub(crate) pose: [f64; 7],
}

impl<'a> PacedStream<'a> {
    fn open(arm: &'a mut Arm, options: StreamOptions) -> Result<Self, StreamError> {
        let mut stream = SetPointStream::open(arm, options)?;
        let pose = stream.arm().standing()?.targets;
        let pace = StreamPace::new(stream.arm().elapsed(), options.period());
        Ok(Self { stream, pace, first: FirstPoints::default(), pose })
    }
}

type ArmCall = Box<dyn FnOnce(&mut Arm) + Send>;
type StreamCall = Box<dyn FnOnce(&mut PacedStream<'_>) + Send>;
type StreamResult = SyncSender<Result<(), StreamError>>;

enum Message {
    Call(ArmCall),
    OpenStream(StreamOptions, StreamResult),
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
    fn goes_on(&self) -> bool {
        !self.is_interrupted.load(Ordering::Relaxed)
            && self.stops.load(Ordering::Relaxed) == self.stops_before
    }
}

/// The end of a [`CallState`] in the thread of the port.
pub(crate) struct Watch(Arc<CallState>);

impl Observer for Watch {
    fn goes_on(&mut self) -> bool {
        self.0.goes_on()
    }

    fn progress(&mut self, _: Stage, done: u64, total: u64) {
        self.0.done.store(done, Ordering::Relaxed);
        self.0.total.store(total, Ordering::Relaxed);
    }
}

/// The thread that owns an arm. It ends when this is closed or dropped.
pub(crate) struct Worker {
    open: Mutex<Option<(Sender<Message>, JoinHandle<()>)>>,
    /// How often [`Self::interrupt`] was called.
    stops: Arc<AtomicU64>,
}

impl Worker {
    pub(crate) fn start(arm: Arm) -> Self {
        let (messages, received) = channel();
        let thread = thread::spawn(move || serve(arm, &received));
        Self { open: Mutex::new(Some((messages, thread))), stops: Arc::default() }
    }

    /// Runs `work` in the thread of the port, and waits for it without the interpreter's lock. A signal of Python interrupts
    /// it.
    pub(crate) fn call<T: Send + 'static>(
        &self,
        py: Python<'_>,
        work: impl FnOnce(&mut Arm, &mut Watch) -> T + Send + 'static,
    ) -> PyResult<T> {
        let (result, signal) = self.call_until_signal(py, work)?;
        signal.map_or(Ok(result), Err)
    }

    /// As [`Self::call`]. A signal ends the work but does not replace its result.
    pub(crate) fn call_until_signal<T: Send + 'static>(
        &self,
        py: Python<'_>,
        work: impl FnOnce(&mut Arm, &mut Watch) -> T + Send + 'static,
    ) -> PyResult<(T, Option<PyErr>)> {
        let (reply, answer) = sync_channel(1);
        let state = self.new_state();
        let mut watch = Watch(Arc::clone(&state));
        // The caller has gone only if the interpreter ends.
        let call = move |arm: &mut Arm| drop(reply.send(work(arm, &mut watch)));
        self.send(py, Message::Call(Box::new(call)))?;
        wait(py, answer, &state)
    }

    /// Interrupts all calls so far, whether they run or wait.
    pub(crate) fn interrupt(&self) {
        self.stops.fetch_add(1, Ordering::Relaxed);
    }

    fn new_state(&self) -> Arc<CallState> {
        let stops_before = self.stops.load(Ordering::Relaxed);
        Arc::new(CallState { stops: Arc::clone(&self.stops), stops_before, ..CallState::default() })
    }

    pub(crate) fn open_stream(&self, py: Python<'_>, options: StreamOptions) -> PyResult<()> {
        let (reply, answer) = sync_channel(1);
        self.send(py, Message::OpenStream(options, reply))?;
        finish(py, wait(py, answer, &CallState::default())?)
    }

    /// As [`Self::call`], for the open stream.
    pub(crate) fn stream_call<T: Send + 'static>(
        &self,
        py: Python<'_>,
        work: impl FnOnce(&mut PacedStream<'_>, &mut Watch) -> T + Send + 'static,
    ) -> PyResult<T> {
        let (reply, answer) = sync_channel(1);
        let state = self.new_state();
        let mut watch = Watch(Arc::clone(&state));
        let call = move |stream: &mut PacedStream<'_>| drop(reply.send(work(stream, &mut watch)));
        self.send(py, Message::StreamCall(Box::new(call)))?;
        let (result, signal) = wait(py, answer, &state)?;
        signal.map_or(Ok(result), Err)
    }

    pub(crate) fn close_stream(&self, py: Python<'_>) -> PyResult<()> {
        let (reply, answer) = sync_channel(1);
        self.send(py, Message::CloseStream(reply))?;
        finish(py, wait(py, answer, &CallState::default())?)
    }

    /// Ends the thread, and waits until the port is closed.
    pub(crate) fn close(&self, py: Python<'_>) {
        let open = lock(&self.open).take();
        if let Some((messages, thread)) = open {
            drop(messages);
            // After a panic the thread has ended, too.
            py.detach(|| drop(thread.join()));
        }
    }

    pub(crate) fn is_open(&self) -> bool {
        lock(&self.open).is_some()
    }

    fn send(&self, py: Python<'_>, message: Message) -> PyResult<()> {
        let open = lock(&self.open);
        let sent = open.as_ref().and_then(|(messages, _)| messages.send(message).ok());
        sent.ok_or_else(|| Closed::raise_closed(py))
    }
}

fn finish(py: Python<'_>, (result, signal): (Result<(), StreamError>, Option<PyErr>)) -> PyResult<()> {
    result.map_err(|error| error.raise(py))?;
    signal.map_or(Ok(()), Err)
}

/// Waits for a result without the interpreter's lock. A signal interrupts the call; then its result follows at once.
fn wait<T: Send>(py: Python<'_>, mut answer: Receiver<T>, state: &CallState) -> PyResult<(T, Option<PyErr>)> {
    let mut line = ProgressLine::default();
    let mut signal = None;
    loop {
        let (receiver, received) = py.detach(move || {
            let received = answer.recv_timeout(SIGNAL_PERIOD);
            (answer, received)
        });
        answer = receiver;
        match received {
            Ok(result) => return Ok((result, signal)),
            Err(RecvTimeoutError::Disconnected) => return Err(Closed::raise_closed(py)),
            Err(RecvTimeoutError::Timeout) => {
                line.show(state.done.load(Ordering::Relaxed), state.total.load(Ordering::Relaxed));
            }
        }
        if let Err(raised) = py.check_signals() {
            state.is_interrupted.store(true, Ordering::Relaxed);
            signal = Some(raised);
        }
    }
}

fn serve(mut arm: Arm, messages: &Receiver<Message>) {
    while let Ok(message) = messages.recv() {
        match message {
            Message::Call(call) => call(&mut arm),
            Message::OpenStream(options, opened) => match PacedStream::open(&mut arm, options) {
                Ok(stream) => {
                    let _ = opened.send(Ok(()));
                    serve_stream(stream, messages);
                }
                Err(error) => drop(opened.send(Err(error))),
            },
            // No stream is open. The caller sees the end of the channel.
            Message::StreamCall(_) | Message::CloseStream(_) => {}
        }
    }
}

/// Serves calls while a stream is open. Without a caller the stream sends nothing, so that the arm's watchdog acts.
fn serve_stream(mut stream: PacedStream<'_>, messages: &Receiver<Message>) {
    while let Ok(message) = messages.recv() {
        match message {
            Message::Call(call) => call(stream.stream.arm()),
            Message::StreamCall(call) => call(&mut stream),
            Message::OpenStream(..) => {}
            Message::CloseStream(closed) => {
                let _ = closed.send(stream.stream.close());
                return;
            }
        }
    }
}

/// A panic while the lock is held leaves nothing half done.
pub(crate) fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}
