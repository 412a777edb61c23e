//! `cargo xtask bench --programs`: size, start and round trip of the host programs, and the load of many arms in one simulator.
//!
//! The measured programs are in the folder of this one, from the same build.

mod simulator;

use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};
use std::{env, fs};

use protocol_core::registers::map::PRESENT_POSITION;
use protocol_core::request::Request;
use rustix::process::{Resource, Rlimit, getrlimit, setrlimit};

use simulator::{Outcome, Simulator, frame, receive_reply};

/// Number of starts of a program.
const STARTS: usize = 51;
const ROUND_TRIPS: usize = 5_001;
/// Numbers of arms in one simulator.
const SIZES: [usize; 4] = [1, 10, 100, 1_000];

fn main() -> Outcome {
    // Each arm needs an open port: more files than a process may open by default.
    let limit = getrlimit(Resource::Nofile);
    setrlimit(Resource::Nofile, Rlimit { current: limit.maximum, ..limit })?;
    let (host_sim, sevenbot) = (beside_this("host-sim")?, beside_this("sevenbot")?);
    for program in [&host_sim, &sevenbot] {
        println!("{:10} bytes: {}", fs::metadata(program)?.len(), program.display());
    }
    let arm = Simulator::start(&host_sim, 1, &["--eeprom", "none", "--unpaced"])?;
    let port = arm.port().display().to_string();
    print_percentiles("sevenbot --version", starts(&sevenbot, &["--version"])?);
    print_percentiles(
        "sevenbot get target-position, unpaced",
        starts(&sevenbot, &["--port", &port, "get", "target-position"])?,
    );
    print_percentiles("read of 7 and its reply, unpaced", round_trips(&arm)?);
    drop(arm);
    print_arms(&host_sim)
}

/// The path of a program in the folder of this one.
fn beside_this(program: &str) -> Outcome<PathBuf> {
    Ok(env::current_exe()?.with_file_name(program))
}

/// The run times of a program, each from its start to its end.
fn starts(program: &Path, arguments: &[&str]) -> Outcome<Vec<Duration>> {
    let run = || {
        let start = Instant::now();
        let status = Command::new(program).args(arguments).stdout(Stdio::null()).status()?;
        let took = start.elapsed();
        if status.success() { Ok(took) } else { Err(format!("{} failed: {status}", program.display()))? }
    };
    (0..STARTS).map(|_| run()).collect()
}

fn round_trips(arm: &Simulator) -> Outcome<Vec<Duration>> {
    let mut ports = arm.open()?;
    let port = ports.first_mut().ok_or("no port")?;
    let question = frame(Request::Read { address: PRESENT_POSITION.address, count: PRESENT_POSITION.count });
    let mut trip = || {
        let start = Instant::now();
        port.write_all(&question)?;
        receive_reply(port)?;
        Ok(start.elapsed())
    };
    (0..ROUND_TRIPS).map(|_| trip()).collect()
}

/// Prints the median and the 99th percentile.
fn print_percentiles(what: &str, mut times: Vec<Duration>) {
    times.sort_unstable();
    let percentile = |part: usize| times.get(times.len() * part / 100).copied().unwrap_or_default();
    let millis = |time: Duration| time.as_secs_f64() * 1e3;
    println!("{:10.3} ms, 99 of 100 under {:.3} ms: {what}", millis(percentile(50)), millis(percentile(99)));
}

/// Prints the load of idle arms, and of arms that a host polls at up to 100 Hz each. The load at 100 Hz is computed from the cost
/// of a reply, which hardly depends on the rate.
fn print_arms(program: &Path) -> Outcome {
    println!(
        "\nArms in one process, each with its settings in a file and its bytes paced at 115200 baud. Shares of a core;"
    );
    println!("busy: all joints move, and a host polls the positions. Memory: anonymous, KiB");
    let columns = [
        "arms",
        "idle",
        "per arm",
        "polled at",
        "busy",
        "per reply",
        "per arm at 100 Hz",
        "arms per core",
        "memory",
    ];
    print_row(columns.map(str::to_owned));
    let mut memory = Vec::new();
    for size in SIZES {
        let load = ArmsLoad::measure(program, size)?;
        print_row(load.row());
        memory.push((size, load.kibibytes));
    }
    if let ([(1, one), ..], [.., (most, all)]) = (memory.as_slice(), memory.as_slice()) {
        let more = all.saturating_sub(*one) as f64 / (most - 1) as f64;
        println!("each further arm takes {more:.1} KiB");
    }
    Ok(())
}

/// The load of some arms in one process.
struct ArmsLoad {
    size: usize,
    /// Shares of a core while the arms are idle, and while a host polls each of them.
    idle: f64,
    busy: f64,
    /// How often the host polls each arm, in Hz.
    rate: f64,
    kibibytes: u64,
}

impl ArmsLoad {
    fn measure(program: &Path, size: usize) -> Outcome<Self> {
        let folder = tempfile::tempdir()?;
        let image = folder.path().join("arm.bin").display().to_string();
        let arms = Simulator::start(program, size, &["--eeprom", &image])?;
        let idle = arms.share_idle()?;
        let (busy, rate) = arms.share_polled()?;
        Ok(Self { size, idle, busy, rate, kibibytes: arms.memory()? })
    }

    fn row(&self) -> [String; 9] {
        let size = self.size as f64;
        let reply = (self.busy - self.idle).max(0.0) / (self.rate * size);
        let each = self.idle / size;
        let at_100_hz = each + 100.0 * reply;
        [
            self.size.to_string(),
            format!("{:.2} %", 100.0 * self.idle),
            format!("{:.3} %", 100.0 * each),
            format!("{:.1} Hz", self.rate),
            format!("{:.2} %", 100.0 * self.busy),
            format!("{:.1} us", 1e6 * reply),
            format!("{:.3} %", 100.0 * at_100_hz),
            format!("{:.0}", at_100_hz.recip()),
            self.kibibytes.to_string(),
        ]
    }
}

fn print_row(cells: [String; 9]) {
    println!("{}", cells.map(|cell| format!("{cell:>18}")).concat());
}
