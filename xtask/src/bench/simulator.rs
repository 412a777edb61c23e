//! A simulator under observation: what it takes of a core and of memory, and hosts that keep all of its arms busy.

use std::fs::{self, File, OpenOptions};
use std::io::{BufRead, BufReader, ErrorKind, Read, Write};
use std::os::unix::fs::OpenOptionsExt;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::thread::sleep;
use std::time::{Duration, Instant};

use protocol_core::registers::JOINTS;
use protocol_core::registers::map::{PRESENT_POSITION, SPEED, TARGET_POSITION};
use protocol_core::request::Request;
use rustix::event::{PollFd, PollFlags, Timespec, poll};
use rustix::fs::OFlags;

use crate::count::frame;
use crate::run::{Outcome, Running};

/// How long a share of a core is watched.
const WATCH: Duration = Duration::from_secs(5);
/// How long servos need at start, and hosts until all goes evenly, and longer.
const START: Duration = Duration::from_secs(2);
/// The period of a host that steers at 100 Hz..
const PERIOD: Duration = Duration::from_millis(10);
/// .. and what it takes at least for each arm, or this program would be what is measured.
const PERIOD_PER_ARM: Duration = Duration::from_micros(100);
/// How long an answer may take on a busy machine.
const PATIENCE: Timespec = Timespec { tv_sec: 20, tv_nsec: 0 };
/// Bytes of an answer to a read of seven registers.
const ANSWER: usize = 14;

/// A simulator that runs.
pub(crate) struct Simulator {
    process: Running,
    ports: Vec<PathBuf>,
}

impl Simulator {
    /// Starts one, with so many arms, and waits until they are up.
    pub(crate) fn start(program: &Path, arms: usize, options: &[&str]) -> Outcome<Self> {
        let child = Command::new(program)
            .args(["--quiet", "--arms", &arms.to_string()])
            .args(options)
            .stdout(Stdio::piped())
            .spawn()?;
        let mut process = Running(child);
        let lines = BufReader::new(process.0.stdout.take().ok_or("no output")?).lines();
        let ports = lines.take(arms).map(|line| {
            let line = line?;
            Ok(PathBuf::from(line.strip_prefix("ready ").ok_or("no port")?))
        });
        let ports = ports.collect::<Outcome<Vec<_>>>()?;
        sleep(START);
        Ok(Self { process, ports })
    }

    /// Opens the ports as a serial client does; reads do not wait.
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

    /// Time on a core so far, of its one thread.
    fn time_on_core(&self) -> Outcome<Duration> {
        let text = fs::read_to_string(format!("/proc/{}/schedstat", self.process.0.id()))?;
        let nanos = text.split_whitespace().next().ok_or("no time in schedstat")?;
        Ok(Duration::from_nanos(nanos.parse()?))
    }

    /// Memory that is its own and stands for no file, in KiB.
    pub(crate) fn memory(&self) -> Outcome<u64> {
        let text = fs::read_to_string(format!("/proc/{}/smaps_rollup", self.process.0.id()))?;
        let line = text.lines().find_map(|line| line.strip_prefix("Anonymous:")).ok_or("no memory")?;
        Ok(line.trim().trim_end_matches(" kB").parse()?)
    }

    /// The share of a core that it takes while it is left alone.
    pub(crate) fn share_idle(&self) -> Outcome<f64> {
        self.share_during(|| {
            sleep(WATCH);
            Ok(())
        })
    }

    /// The share of a core that it takes while all joints of all arms move, and every arm is asked for its positions
    /// a hundred times a second, or as often as this program can; and how often that was, in Hz.
    pub(crate) fn share_polled(&self) -> Outcome<(f64, f64)> {
        let mut ports = self.open()?;
        for port in &mut ports {
            port.write_all(&frame(Request::Write { address: SPEED.address, values: &[1; JOINTS] }))?;
            port.write_all(&frame(Request::Write {
                address: TARGET_POSITION.address,
                values: &[0; JOINTS],
            }))?;
        }
        ask(&mut ports, START)?;
        let mut rounds = 0;
        let start = Instant::now();
        let share = self.share_during(|| {
            rounds = ask(&mut ports, WATCH)?;
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

/// Asks every arm, and takes the answers a period later; round after round. Says how many.
fn ask(ports: &mut [File], time: Duration) -> Outcome<u32> {
    let question = frame(Request::Read { address: PRESENT_POSITION.address, count: PRESENT_POSITION.count });
    let period = PERIOD.max(PERIOD_PER_ARM * u32::try_from(ports.len())?);
    let start = Instant::now();
    let mut rounds = 0;
    while start.elapsed() < time {
        ports.iter_mut().try_for_each(|port| port.write_all(&question))?;
        rounds += 1;
        sleep((period * rounds).saturating_sub(start.elapsed()));
        ports.iter_mut().try_for_each(take_answer)?;
    }
    Ok(rounds)
}

/// Waits for an answer and checks that it is one.
pub(crate) fn take_answer(port: &mut File) -> Outcome {
    let mut answer = [0; ANSWER];
    let mut filled = 0;
    while let Some(room) = answer.get_mut(filled..).filter(|room| !room.is_empty()) {
        match port.read(room) {
            Ok(count) => filled += count,
            Err(error) if error.kind() == ErrorKind::WouldBlock => wait_for(port)?,
            Err(error) => Err(error)?,
        }
    }
    let head = [0xAA, 0x77, 3, PRESENT_POSITION.address, PRESENT_POSITION.count];
    if answer.starts_with(&head) { Ok(()) } else { Err("an arm answered something else")? }
}

fn wait_for(port: &File) -> Outcome {
    match poll(&mut [PollFd::new(port, PollFlags::IN)], Some(&PATIENCE))? {
        0 => Err("an arm does not answer")?,
        _ => Ok(()),
    }
}
