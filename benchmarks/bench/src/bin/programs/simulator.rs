//! A measured simulator: its processor time and memory, and hosts that poll all of its arms.

use std::error::Error;
use std::fs::{self, File, OpenOptions};
use std::io::{BufRead, BufReader, ErrorKind, Read, Write};
use std::os::unix::fs::OpenOptionsExt;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::thread::sleep;
use std::time::{Duration, Instant};

use protocol_core::registers::JOINTS;
use protocol_core::registers::map::{PRESENT_POSITION, SPEED, TARGET_POSITION};
use protocol_core::request::Request;
use protocol_core::wire::FrameBuffer;
use rustix::event::{PollFd, PollFlags, Timespec, poll};
use rustix::fs::OFlags;

/// A result whose error is printed.
pub(crate) type Outcome<T = ()> = Result<T, Box<dyn Error>>;

/// The time of a measurement.
const WATCH_TIME: Duration = Duration::from_secs(5);
/// The time to wait until the servos have started, and until the polling is steady.
const START_TIME: Duration = Duration::from_secs(2);
/// The shortest polling period: 100 Hz.
const PERIOD: Duration = Duration::from_millis(10);
/// The polling period is at least this long per arm, so that this program does not limit the rate.
const PERIOD_PER_ARM: Duration = Duration::from_micros(100);
/// The timeout of a reply, on a busy machine.
const TIMEOUT: Timespec = Timespec { tv_sec: 20, tv_nsec: 0 };
/// Bytes of the reply to a read of seven registers.
const REPLY_BYTES: usize = 14;

pub(crate) struct Simulator {
    process: Child,
    ports: Vec<PathBuf>,
}

impl Drop for Simulator {
    fn drop(&mut self) {
        // An error means that the process has ended.
        let _ = self.process.kill();
        let _ = self.process.wait();
    }
}

impl Simulator {
    /// Starts a simulator with this many arms, and waits until they have started.
    pub(crate) fn start(program: &Path, arms: usize, options: &[&str]) -> Outcome<Self> {
        let mut process = Command::new(program)
            .args(["--quiet", "--arms", &arms.to_string()])
            .args(options)
            .stdout(Stdio::piped())
            .spawn()?;
        let lines = BufReader::new(process.stdout.take().ok_or("no output")?).lines();
        let ports = lines.take(arms).map(|line| {
            let line = line?;
            Ok(PathBuf::from(line.strip_prefix("ready ").ok_or("no port")?))
        });
        let ports = ports.collect::<Outcome<Vec<_>>>()?;
        sleep(START_TIME);
        Ok(Self { process, ports })
    }

    /// Opens the ports like a serial client. Reads do not block.
    pub(crate) fn open(&self) -> Outcome<Vec<File>> {
        let flags = (OFlags::NOCTTY | OFlags::NONBLOCK).bits();
        let flags = i32::try_from(flags)?;
        let open = |port: &PathBuf| OpenOptions::new().read(true).write(true).custom_flags(flags).open(port);
        Ok(self.ports.iter().map(open).collect::<Result<_, _>>()?)
    }

    /// The port of the first arm.
    pub(crate) fn port(&self) -> &Path {
        self.ports.first().map_or(Path::new(""), PathBuf::as_path)
    }

    /// The processor time of the simulator's only thread.
    fn time_on_core(&self) -> Outcome<Duration> {
        let text = fs::read_to_string(format!("/proc/{}/schedstat", self.process.id()))?;
        let nanos = text.split_whitespace().next().ok_or("no time in schedstat")?;
        Ok(Duration::from_nanos(nanos.parse()?))
    }

    /// The simulator's anonymous memory in KiB.
    pub(crate) fn memory(&self) -> Outcome<u64> {
        let text = fs::read_to_string(format!("/proc/{}/smaps_rollup", self.process.id()))?;
        let line = text.lines().find_map(|line| line.strip_prefix("Anonymous:")).ok_or("no memory")?;
        Ok(line.trim().trim_end_matches(" kB").parse()?)
    }

    /// The share of a core that the idle simulator takes.
    pub(crate) fn share_idle(&self) -> Outcome<f64> {
        self.share_during(|| {
            sleep(WATCH_TIME);
            Ok(())
        })
    }

    /// The share of a core while all joints move and each arm is polled for its positions, up to a hundred times a second.
    /// Also returns the rate in Hz.
    pub(crate) fn share_polled(&self) -> Outcome<(f64, f64)> {
        let mut ports = self.open()?;
        for port in &mut ports {
            port.write_all(&frame(Request::Write { address: SPEED.address, values: &[1; JOINTS] }))?;
            port.write_all(&frame(Request::Write {
                address: TARGET_POSITION.address,
                values: &[0; JOINTS],
            }))?;
        }
        poll_arms(&mut ports, START_TIME)?;
        let mut rounds = 0;
        let start = Instant::now();
        let share = self.share_during(|| {
            rounds = poll_arms(&mut ports, WATCH_TIME)?;
            Ok(())
        })?;
        Ok((share, f64::from(rounds) / start.elapsed().as_secs_f64()))
    }

    fn share_during(&self, act: impl FnOnce() -> Outcome) -> Outcome<f64> {
        let (start, before) = (Instant::now(), self.time_on_core()?);
        act()?;
        let used = self.time_on_core()?.saturating_sub(before);
        Ok(used.as_secs_f64() / start.elapsed().as_secs_f64())
    }
}

/// Polls for this time: each round sends a read to every arm, waits for the end of the period, and receives the replies.
/// Returns the number of rounds.
fn poll_arms(ports: &mut [File], time: Duration) -> Outcome<u32> {
    let question = frame(Request::Read { address: PRESENT_POSITION.address, count: PRESENT_POSITION.count });
    let period = PERIOD.max(PERIOD_PER_ARM * u32::try_from(ports.len())?);
    let start = Instant::now();
    let mut rounds = 0;
    while start.elapsed() < time {
        ports.iter_mut().try_for_each(|port| port.write_all(&question))?;
        rounds += 1;
        sleep((period * rounds).saturating_sub(start.elapsed()));
        ports.iter_mut().try_for_each(receive_reply)?;
    }
    Ok(rounds)
}

/// Receives and checks a reply.
pub(crate) fn receive_reply(port: &mut File) -> Outcome {
    let mut reply = [0; REPLY_BYTES];
    let mut filled = 0;
    while let Some(room) = reply.get_mut(filled..).filter(|room| !room.is_empty()) {
        match port.read(room) {
            Ok(count) => filled += count,
            Err(error) if error.kind() == ErrorKind::WouldBlock => wait_for_bytes(port)?,
            Err(error) => Err(error)?,
        }
    }
    let head = [0xAA, 0x77, 3, PRESENT_POSITION.address, PRESENT_POSITION.count];
    if reply.starts_with(&head) { Ok(()) } else { Err("an arm sent another reply")? }
}

fn wait_for_bytes(port: &File) -> Outcome {
    match poll(&mut [PollFd::new(port, PollFlags::IN)], Some(&TIMEOUT))? {
        0 => Err("an arm does not reply")?,
        _ => Ok(()),
    }
}

pub(crate) fn frame(request: Request<'_>) -> Vec<u8> {
    let mut buffer = FrameBuffer::new();
    request.encode(&mut buffer);
    buffer.to_vec()
}
