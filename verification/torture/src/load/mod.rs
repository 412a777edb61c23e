//! A client that keeps a port as busy as the line allows, and counts what does not come back.
//!
//! ```text
//!   window of reads ──▶ port ──▶ arm          every eighth request is a write; reports at 50 Hz all the while
//!   Answers         ◀── port ◀── answers, in the order of the reads, and reports between them
//! ```
//!
//! Knows frames and registers, not who is at the other end: the simulator, the emulated firmware, an arm.

mod memory;
mod round_trips;

use std::collections::VecDeque;
use std::fmt::{self, Display};
use std::io::{self, ErrorKind, IsTerminal, Read, Write};
use std::time::{Duration, Instant};

use clap::Args;
use protocol_core::registers::map::{
    FEEDBACK_FREQUENCY, PRESENT_POSITION, SPEED, STATUS_VERSION, TARGET_POSITION,
};
use protocol_core::request::{Reply, Request};
use protocol_core::wire::frame::{CRC_LENGTH, PREFIX_LENGTH};
use protocol_core::wire::{Deframer, FrameBuffer, ToHost, deframer};
use serialport::SerialPort;

use memory::Memory;
use round_trips::RoundTrips;

/// An answer that has not come after this long counts as lost: a busy machine may be late by seconds.
const PATIENCE: Duration = Duration::from_secs(60);
/// How long one look at the port waits for bytes.
const LOOK: Duration = Duration::from_millis(1);
/// Between two progress lines.
const PROGRESS_EVERY: Duration = Duration::from_secs(1);
/// Memory is compared from here on: by then every buffer has been used once.
const WARM_UP: Duration = Duration::from_secs(10);
/// Every so many requests is a write.
const WRITE_EVERY: u64 = 8;

/// What to load, and for how long.
#[derive(Clone, Debug, Args)]
pub struct Options {
    /// The port to load
    #[arg(long, value_name = "PATH")]
    pub port: String,

    /// For how many minutes
    #[arg(long, default_value_t = 1.0)]
    pub minutes: f64,

    /// The baud rate to ask for; a simulated port takes any
    #[arg(long, default_value_t = 115_200)]
    pub baud: u32,

    /// How many reads may be under way at once
    #[arg(long, default_value_t = 8, value_parser = clap::value_parser!(u32).range(1..=64))]
    pub window: u32,

    /// Watch the memory of this process as well
    #[arg(long)]
    pub pid: Option<u32>,
}

/// Why there was no load, or not to the end.
#[derive(Debug, thiserror::Error)]
pub enum Failure {
    /// The port cannot be opened.
    #[error("cannot open {port}: {cause}: is the simulator running?")]
    Port {
        /// Its name.
        port: String,
        /// The system's reason.
        cause: serialport::Error,
    },
    /// The port went away.
    #[error("the port is gone: {0}")]
    Gone(#[from] io::Error),
    /// The time is negative, or no number.
    #[error("--minutes {0}: use a number above 0")]
    Minutes(f64),
}

/// What the load came to.
#[derive(Debug, Default)]
pub struct Tally {
    reads: u64,
    writes: u64,
    answers: u64,
    reports: u64,
    lost: u64,
    /// Frames that answer nothing that was asked.
    strange: u64,
    damaged: u64,
    bytes: u64,
    /// Bytes that waited anywhere at once, at most: of requests that were not answered yet, and of their answers.
    most_waiting: (u64, u64),
    round_trips: RoundTrips,
    memory: Memory,
    elapsed: Duration,
}

impl Tally {
    /// Did every answer come, in order and undamaged?
    #[must_use]
    pub const fn is_clean(&self) -> bool {
        self.lost == 0 && self.strange == 0 && self.damaged == 0
    }
}

impl Display for Tally {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        let seconds = self.elapsed.as_secs_f64().max(1e-9);
        #[allow(clippy::cast_precision_loss)] // Shown with one decimal.
        let rate = |count: u64| count as f64 / seconds;
        writeln!(out, "time                        {seconds:.0} s")?;
        writeln!(out, "reads, writes               {}, {}", self.reads, self.writes)?;
        writeln!(out, "answers                     {} ({:.0}/s)", self.answers, rate(self.answers))?;
        writeln!(out, "reports                     {} ({:.2}/s)", self.reports, rate(self.reports))?;
        writeln!(out, "bytes from the arm          {} ({:.0}/s)", self.bytes, rate(self.bytes))?;
        writeln!(out, "answers lost                {}", self.lost)?;
        writeln!(out, "frames nobody asked for     {}", self.strange)?;
        writeln!(out, "frames damaged              {}", self.damaged)?;
        let (requests, answers) = self.most_waiting;
        writeln!(out, "waiting at once, at most    {requests} bytes of requests, {answers} of answers")?;
        writeln!(out, "round trip                  {}", self.round_trips)?;
        write!(out, "memory of the other end     {}", self.memory)
    }
}

/// A read under way.
#[derive(Clone, Copy, Debug)]
struct Awaited {
    address: u8,
    count: u8,
    since: Instant,
    /// Bytes sent until then.
    sent: u64,
}

struct Client {
    port: Box<dyn SerialPort>,
    deframer: Deframer<ToHost>,
    start: Instant,
    window: usize,
    under_way: VecDeque<Awaited>,
    requests: u64,
    /// Bytes sent, and how many of them were answered.
    sent: u64,
    answered: u64,
    tally: Tally,
}

/// Loads the port, and says what came of it.
///
/// # Errors
/// See [`Failure`].
pub fn run(options: &Options) -> Result<Tally, Failure> {
    let time = Duration::try_from_secs_f64(options.minutes * 60.0);
    let time = time.ok().filter(|time| !time.is_zero()).ok_or(Failure::Minutes(options.minutes))?;
    let mut client = Client::open(options)?;
    client.set(FEEDBACK_FREQUENCY.address, &[50])?;
    let mut next_progress = client.start + PROGRESS_EVERY;
    while client.start.elapsed() < time {
        client.fill_window()?;
        client.listen()?;
        client.give_up_on_lost();
        if Instant::now() >= next_progress {
            next_progress += PROGRESS_EVERY;
            client.look_at_memory(options.pid);
            client.show_progress(time);
        }
    }
    client.end()?;
    Ok(client.tally)
}

impl Client {
    fn open(options: &Options) -> Result<Self, Failure> {
        let port = serialport::new(&options.port, options.baud).timeout(LOOK).open();
        let port = port.map_err(|cause| Failure::Port { port: options.port.clone(), cause })?;
        Ok(Self {
            port,
            deframer: Deframer::new(deframer::gap(options.baud)),
            start: Instant::now(),
            window: usize::try_from(options.window).unwrap_or(1),
            under_way: VecDeque::new(),
            requests: 0,
            sent: 0,
            answered: 0,
            tally: Tally::default(),
        })
    }

    fn fill_window(&mut self) -> Result<(), Failure> {
        while self.under_way.len() < self.window {
            self.requests += 1;
            if self.requests.is_multiple_of(WRITE_EVERY) {
                self.write_something()?;
            } else {
                self.read_something()?;
            }
        }
        Ok(())
    }

    /// Reads of every length, none of which could be mistaken for a report.
    fn read_something(&mut self) -> Result<(), Failure> {
        let [a, b, ..] = self.requests.wrapping_mul(0x9E37_79B9_7F4A_7C15).to_be_bytes();
        let (address, count) = match a % 4 {
            0 => (STATUS_VERSION.address, 16),
            1 => (b % 50, 1 + a % 10),
            2 => (0, 61),
            _ => (TARGET_POSITION.address, 7),
        };
        self.send(&Request::Read { address, count })?;
        let (since, sent) = (Instant::now(), self.sent);
        self.under_way.push_back(Awaited { address, count, since, sent });
        self.tally.reads += 1;
        self.look_at_waiting();
        Ok(())
    }

    fn write_something(&mut self) -> Result<(), Failure> {
        let swing = u8::try_from(self.requests / 1_024 % 40).unwrap_or(0);
        let turn = (self.requests / WRITE_EVERY).is_multiple_of(2);
        if turn {
            self.set(SPEED.address, &[60; 7])
        } else {
            self.set(TARGET_POSITION.address, &[70 + swing; 6])
        }
    }

    fn set(&mut self, address: u8, values: &[u8]) -> Result<(), Failure> {
        self.tally.writes += 1;
        self.send(&Request::Write { address, values })
    }

    fn send(&mut self, request: &Request<'_>) -> Result<(), Failure> {
        let mut frame = FrameBuffer::new();
        request.encode(&mut frame);
        self.sent += frame.len() as u64;
        let mut rest = frame.as_slice();
        while !rest.is_empty() {
            match self.port.write(rest) {
                Ok(count) => rest = rest.get(count..).unwrap_or(&[]),
                // The port is full: what comes back makes room.
                Err(error) if is_for_later(&error) => self.listen()?,
                Err(error) => return Err(error.into()),
            }
        }
        Ok(())
    }

    fn listen(&mut self) -> Result<(), Failure> {
        let mut bytes = [0; 4_096];
        let count = match self.port.read(&mut bytes) {
            Ok(0) => return Err(io::Error::from(ErrorKind::UnexpectedEof).into()),
            Ok(count) => count,
            Err(error) if is_for_later(&error) => 0,
            Err(error) => return Err(error.into()),
        };
        self.tally.bytes += count as u64;
        let mut rest = bytes.get(..count).unwrap_or(&[]);
        // Silence is never told to the deframer: a busy machine may hold up the rest of an answer for longer than a
        // sender may pause (D4), and that answer is not lost.
        while !rest.is_empty() {
            let taken = self.deframer.push(self.now(), rest);
            rest = rest.get(taken..).unwrap_or(&[]);
            self.take_frames();
        }
        Ok(())
    }

    fn take_frames(&mut self) {
        while let Some(found) = self.deframer.pull() {
            let Ok(Some(reply)) = found.map(Reply::from_frame) else {
                self.tally.damaged += 1;
                continue;
            };
            let (address, count) = (reply.address, u8::try_from(reply.values.len()).unwrap_or(0));
            if (address, count) == (PRESENT_POSITION.address, PRESENT_POSITION.count) {
                self.tally.reports += 1;
            } else {
                self.take_answer(address, count);
            }
        }
    }

    /// Answers come in the order of the reads: one that is for a later read says that those before are lost.
    fn take_answer(&mut self, address: u8, count: u8) {
        let is_for = |awaited: &Awaited| (awaited.address, awaited.count) == (address, count);
        let Some(place) = self.under_way.iter().position(is_for) else {
            self.tally.strange += 1;
            return;
        };
        self.tally.lost += place as u64;
        self.tally.answers += 1;
        let answered = self.under_way.drain(..=place).next_back();
        let Some(read) = answered else { return };
        self.answered = read.sent;
        self.tally.round_trips.add(read.since.elapsed());
    }

    /// But for reports, more than this cannot be in any queue between here and the arm's registers.
    fn look_at_waiting(&mut self) {
        let answer = |read: &Awaited| (PREFIX_LENGTH + usize::from(read.count) + CRC_LENGTH) as u64;
        let waiting = (self.sent - self.answered, self.under_way.iter().map(answer).sum());
        let most = &mut self.tally.most_waiting;
        *most = (most.0.max(waiting.0), most.1.max(waiting.1));
    }

    fn give_up_on_lost(&mut self) {
        while self.under_way.front().is_some_and(|first| first.since.elapsed() > PATIENCE) {
            self.under_way.pop_front();
            self.tally.lost += 1;
        }
    }

    fn look_at_memory(&mut self, pid: Option<u32>) {
        if let Some(pid) = pid.filter(|_| self.start.elapsed() > WARM_UP) {
            self.tally.memory.look(pid);
        }
    }

    fn show_progress(&self, time: Duration) {
        if io::stderr().is_terminal() {
            let (now, all) = (self.start.elapsed().as_secs(), time.as_secs());
            let Tally { answers, lost, .. } = self.tally;
            let _ = write!(io::stderr(), "\r{now} of {all} s, {answers} answers, {lost} lost   ");
        }
    }

    /// No more requests; what is under way may still come.
    fn end(&mut self) -> Result<(), Failure> {
        self.tally.elapsed = self.start.elapsed();
        self.set(FEEDBACK_FREQUENCY.address, &[0])?;
        while !self.under_way.is_empty() {
            self.listen()?;
            self.give_up_on_lost();
        }
        Ok(())
    }

    fn now(&self) -> protocol_core::time::Instant {
        let micros = self.start.elapsed().as_micros();
        protocol_core::time::Instant::from_micros(u64::try_from(micros).unwrap_or(u64::MAX))
    }
}

fn is_for_later(error: &io::Error) -> bool {
    matches!(error.kind(), ErrorKind::TimedOut | ErrorKind::Interrupted | ErrorKind::WouldBlock)
}
