//! The thread that owns the port, and calls to it.
//!
//! ```text
//!   Worker::call ── PortMessage ──▶ serve ──▶ Arm, or an open SetPointStream
//!        ▲                            │
//!        └────────── result ──────────┘
//! ```
//!
//! Calls run one after the other. Only a read may run while an earlier call waits for joints.

use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, channel, sync_channel};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::thread::{self, JoinHandle};
use std::time::Duration;

use pyo3::prelude::*;
use sevenbot::map::DEVICE_CODE;
use sevenbot::moves::MoveError;
use sevenbot::stream::StreamError;
use sevenbot::{Arm, OpenError, Span};

use crate::errors::{Closed, Raise};
use crate::motion;
use crate::place::{ArmPlace, no_thread};
use crate::progress::ProgressLine;
use crate::watch::{CallState, Inbox, PacedStream, PortMessage, StreamOrder, Watch};

/// Time between two checks of Python's signals.
pub(crate) const SIGNAL_PERIOD: Duration = Duration::from_millis(50);

/// What opens an arm. The flag is set when the caller no longer waits.
type Opener = Box<dyn FnOnce(Arc<AtomicBool>) -> Result<Arm, OpenError> + Send>;

struct PortThread {
    messages: Sender<PortMessage>,
    thread: JoinHandle<()>,
}

/// The thread that owns an arm. It ends when this is closed or dropped.
pub(crate) struct Worker {
    open: Mutex<Option<PortThread>>,
    /// How often [`Self::interrupt`] was called.
    stops: Arc<AtomicU64>,
    /// The process of the thread. A forked process does not have the thread.
    process: u32,
    shows_progress: AtomicBool,
}

impl Worker {
    /// Starts a thread that opens an arm and owns it. Also returns the result of `seen`. The inner error is a failure to open the
    /// arm. A signal of Python ends the wait.
    pub(crate) fn start<T: Send + 'static>(
        py: Python<'_>,
        open: Opener,
        seen: fn(&mut Arm) -> T,
    ) -> PyResult<Result<(Self, T), OpenError>> {
        let ((messages, received), (reply, answer)) = (channel(), sync_channel(1));
        let stops = Arc::<AtomicU64>::default();
        let counted = Arc::clone(&stops);
        let is_cancelled = Arc::new(AtomicBool::new(false));
        let (place, flag) = (ArmPlace::take(py)?, Arc::clone(&is_cancelled));
        let thread = thread::Builder::new().name("sevenbot".to_owned()).spawn(move || {
            let _place = place;
            match open(flag) {
                Ok(mut arm) => {
                    let _ = reply.send(Ok(seen(&mut arm)));
                    serve(arm, &Inbox::new(received), &counted);
                }
                Err(error) => drop(reply.send(Err(error))),
            }
        });
        let thread = thread.map_err(|why| no_thread(py, &why.to_string()))?;
        let (opened, _) =
            wait(py, answer, &CallState::default(), SignalWait::AtMostUntilSignal(&is_cancelled))?;
        Ok(opened.map(|told| (Self::of(PortThread { messages, thread }, stops), told)))
    }

    fn of(port: PortThread, stops: Arc<AtomicU64>) -> Self {
        Self {
            open: Mutex::new(Some(port)),
            stops,
            process: std::process::id(),
            shows_progress: AtomicBool::new(true),
        }
    }

    /// Runs `work` in the thread of the port, and waits for it without the interpreter's lock. A signal of Python interrupts
    /// it.
    pub(crate) fn call<T: Send + 'static>(
        &self,
        py: Python<'_>,
        work: impl FnOnce(&mut Arm, &mut Watch<'_>) -> T + Send + 'static,
    ) -> PyResult<T> {
        let (result, signal) = self.call_until_signal(py, work)?;
        signal.map_or(Ok(result), Err)
    }

    /// As [`Self::call`], for a short read. It may run while another call waits for joints.
    pub(crate) fn read<T: Send + 'static>(
        &self,
        py: Python<'_>,
        work: impl FnOnce(&mut Arm) -> T + Send + 'static,
    ) -> PyResult<T> {
        let (reply, answer) = sync_channel(1);
        let state = Arc::<CallState>::default();
        let shared = Arc::clone(&state);
        let call = move |arm: &mut Arm, _: &Inbox| {
            if shared.claim() {
                drop(reply.send(work(arm)));
            }
        };
        self.send(py, PortMessage::Read(Box::new(call)))?;
        let (result, signal) = self.wait(py, answer, &state)?;
        signal.map_or(Ok(result), Err)
    }

    /// Is the arm open, and does it answer a read now?
    pub(crate) fn answers(&self, py: Python<'_>) -> PyResult<bool> {
        match self.read(py, |arm| arm.read_span(Span::of(&DEVICE_CODE)).is_ok()) {
            Err(error) if error.is_instance_of::<Closed>(py) => Ok(false),
            answered => answered,
        }
    }

    /// As [`Self::call`]. A signal ends the work but does not replace its result.
    pub(crate) fn call_until_signal<T: Send + 'static>(
        &self,
        py: Python<'_>,
        work: impl FnOnce(&mut Arm, &mut Watch<'_>) -> T + Send + 'static,
    ) -> PyResult<(T, Option<PyErr>)> {
        let (reply, answer) = sync_channel(1);
        let state = Arc::new(CallState::new(&self.stops));
        let shared = Arc::clone(&state);
        let call = move |arm: &mut Arm, inbox: &Inbox| {
            if shared.claim() {
                // The caller has gone only if the interpreter ends.
                drop(reply.send(work(arm, &mut Watch { state: shared, inbox })));
            }
        };
        self.send(py, PortMessage::Call(Box::new(call)))?;
        self.wait(py, answer, &state)
    }

    /// Interrupts all calls so far, whether they run or wait, except reads and the opening and closing of a stream.
    pub(crate) fn interrupt(&self) {
        self.stops.fetch_add(1, Ordering::Relaxed);
    }

    /// Waits this long in the time of the arm's line. An open stream goes on.
    pub(crate) fn sleep(&self, py: Python<'_>, time: Duration) -> PyResult<Result<(), MoveError>> {
        let (reply, answer) = sync_channel(1);
        let state = Arc::new(CallState::new(&self.stops));
        self.send(py, PortMessage::Sleep(time, Arc::clone(&state), reply))?;
        let (slept, signal) = self.wait(py, answer, &state)?;
        signal.map_or(Ok(slept), Err)
    }

    /// Makes the thread of the port send the points that are due. Does not wait.
    pub(crate) fn wake(&self, py: Python<'_>) -> PyResult<()> {
        self.send(py, PortMessage::Wake)
    }

    pub(crate) fn open_stream(&self, py: Python<'_>, order: StreamOrder) -> PyResult<()> {
        let (reply, answer) = sync_channel(1);
        let state = Arc::<CallState>::default();
        self.send(py, PortMessage::OpenStream(order, Arc::clone(&state), reply))?;
        let opened = self.wait(py, answer, &state).map_err(|error| {
            // The thread does not answer while another stream is open.
            let is_other_open = self.is_open() && error.is_instance_of::<Closed>(py);
            if is_other_open { Closed::raise_other_stream(py) } else { error }
        })?;
        if matches!(opened, (Ok(()), Some(_))) {
            // A signal ends the `with` statement before its body, so the caller does not close the stream.
            self.abandon_stream();
        }
        finish(py, opened)
    }

    /// Closes a stream that its caller has forgotten, without a wait.
    pub(crate) fn abandon_stream(&self) {
        let close = PortMessage::CloseStream(Arc::default(), sync_channel(1).0);
        if let Some(port) = lock(&self.open).as_ref() {
            // The thread may have ended.
            let _ = port.messages.send(close);
        }
    }

    /// As [`Self::call`], for the open stream.
    pub(crate) fn stream_call<T: Send + 'static>(
        &self,
        py: Python<'_>,
        work: impl FnOnce(&mut PacedStream<'_>, &mut Watch<'_>) -> T + Send + 'static,
    ) -> PyResult<T> {
        let (reply, answer) = sync_channel(1);
        let state = Arc::new(CallState::new(&self.stops));
        let shared = Arc::clone(&state);
        let call = move |stream: &mut PacedStream<'_>, inbox: &Inbox| {
            if shared.claim() {
                drop(reply.send(work(stream, &mut Watch { state: shared, inbox })));
            }
        };
        self.send(py, PortMessage::StreamCall(Box::new(call)))?;
        let (result, signal) = self.wait(py, answer, &state)?;
        signal.map_or(Ok(result), Err)
    }

    pub(crate) fn close_stream(&self, py: Python<'_>) -> PyResult<()> {
        let (reply, answer) = sync_channel(1);
        let state = Arc::<CallState>::default();
        self.send(py, PortMessage::CloseStream(Arc::clone(&state), reply))?;
        finish(py, self.wait(py, answer, &state)?)
    }

    /// Ends all calls so far and the thread, and waits until the port is closed. A forked process has nothing to close.
    pub(crate) fn close(&self, py: Python<'_>) {
        if self.is_forked() {
            return;
        }
        self.interrupt();
        let open = lock(&self.open).take();
        if let Some(PortThread { messages, thread }) = open {
            drop(messages);
            // After a panic the thread has ended, too.
            py.detach(|| drop(thread.join()));
        }
    }

    pub(crate) fn is_open(&self) -> bool {
        !self.is_forked() && lock(&self.open).is_some()
    }

    /// Whether long calls show their progress on a terminal.
    pub(crate) const fn progress_switch(&self) -> &AtomicBool {
        &self.shows_progress
    }

    pub(crate) fn is_forked(&self) -> bool {
        self.process != std::process::id()
    }

    fn send(&self, py: Python<'_>, message: PortMessage) -> PyResult<()> {
        if self.is_forked() {
            return Err(Closed::raise_forked(py));
        }
        let open = lock(&self.open);
        let sent = open.as_ref().and_then(|port| port.messages.send(message).ok());
        sent.ok_or_else(|| Closed::raise_closed(py))
    }

    fn wait<T: Send>(
        &self,
        py: Python<'_>,
        answer: Receiver<T>,
        state: &CallState,
    ) -> PyResult<(T, Option<PyErr>)> {
        wait(
            py,
            answer,
            state,
            SignalWait::ToTheEnd { shows_progress: self.shows_progress.load(Ordering::Relaxed) },
        )
    }
}

impl Drop for Worker {
    fn drop(&mut self) {
        if self.is_forked() {
            // A forked process lacks the thread, which may have held the locks of the channel.
            let open = self.open.get_mut().unwrap_or_else(PoisonError::into_inner);
            std::mem::forget(open.take());
        }
    }
}

fn finish(py: Python<'_>, (result, signal): (Result<(), StreamError>, Option<PyErr>)) -> PyResult<()> {
    signal.map_or_else(|| result.map_err(|error| error.raise(py)), Err)
}

/// What a signal of Python does to a wait.
enum SignalWait<'a> {
    /// It interrupts the call, whose result follows soon. If the call has not begun yet, its caller leaves.
    ToTheEnd { shows_progress: bool },
    /// The caller leaves, and sets this flag.
    AtMostUntilSignal(&'a AtomicBool),
}

/// Waits for a result without the interpreter's lock.
fn wait<T: Send>(
    py: Python<'_>,
    mut answer: Receiver<T>,
    state: &CallState,
    how: SignalWait<'_>,
) -> PyResult<(T, Option<PyErr>)> {
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
            Err(RecvTimeoutError::Disconnected) => return Err(Closed::raise_no_stream(py)),
            Err(RecvTimeoutError::Timeout) => {}
        }
        if matches!(how, SignalWait::ToTheEnd { shows_progress: true }) {
            let (done, total) = state.progress();
            line.show(done, total);
        }
        let Err(raised) = py.check_signals() else { continue };
        state.interrupt();
        if let SignalWait::AtMostUntilSignal(is_left) = how {
            is_left.store(true, Ordering::Relaxed);
            return Err(raised);
        }
        if state.claim() {
            return Err(raised);
        }
        signal = Some(raised);
    }
}

fn serve(mut arm: Arm, inbox: &Inbox, stops: &Arc<AtomicU64>) {
    while let Some(message) = inbox.next() {
        match message {
            PortMessage::Call(call) | PortMessage::Read(call) => call(&mut arm, inbox),
            PortMessage::Sleep(_, state, _) | PortMessage::OpenStream(_, state, _) if !state.claim() => {}
            PortMessage::Sleep(time, state, slept) => {
                let _ = slept.send(motion::sleep(&mut arm, time, &mut Watch { state, inbox }));
            }
            PortMessage::OpenStream(order, _, opened) => match PacedStream::open(&mut arm, order, stops) {
                Ok(stream) => {
                    let _ = opened.send(Ok(()));
                    serve_stream(stream, inbox);
                }
                Err(error) => drop(opened.send(Err(error))),
            },
            // No stream is open. The caller sees the end of the channel.
            PortMessage::StreamCall(_) | PortMessage::CloseStream(..) | PortMessage::Wake => {}
        }
    }
}

/// Serves calls while a stream is open. Without a caller, and without actions of a program that does not wait, the stream sends
/// nothing, so that the arm's watchdog acts.
fn serve_stream(mut stream: PacedStream<'_>, inbox: &Inbox) {
    while let Some(message) = inbox.next_within(stream.wakes_in()) {
        if stream.simulation.is_none() || !matches!(message, PortMessage::Wake) {
            stream.lead(inbox);
        }
        match message {
            PortMessage::Call(call) | PortMessage::Read(call) => call(stream.stream.arm(), inbox),
            PortMessage::Sleep(_, state, _) if !state.claim() => {}
            PortMessage::Sleep(time, state, slept) => {
                let _ = slept.send(stream.sleep(time, &mut Watch { state, inbox }));
            }
            PortMessage::StreamCall(call) => call(&mut stream, inbox),
            PortMessage::OpenStream(..) | PortMessage::Wake => {}
            PortMessage::CloseStream(state, closed) => {
                state.claim();
                let _ = closed.send(stream.close());
                return;
            }
        }
    }
}

/// Locks a mutex, even if a thread panicked while it held the lock: no value is left half changed.
pub(crate) fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}
