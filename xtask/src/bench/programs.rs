//! The programs on this machine: how large, how soon they are there, how long an answer takes, and how many arms
//! one simulator carries.

use std::fs;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

use protocol_core::registers::map::PRESENT_POSITION;
use protocol_core::request::Request;
use rustix::process::{Resource, Rlimit, getrlimit, setrlimit};

use super::simulator::{Simulator, take_answer};
use crate::count::frame;
use crate::run::{Outcome, cargo, target_directory};
use torture::text_table::Column::Right;
use torture::text_table::TextTable;

/// How often a program is started.
const STARTS: usize = 51;
/// How often an answer is waited for.
const ROUND_TRIPS: usize = 5_001;
/// How many arms one simulator carries, one size after the other.
const SIZES: [usize; 4] = [1, 10, 100, 1_000];

/// Measures and prints.
pub(crate) fn measure() -> Outcome {
    cargo("build --quiet --release --package host-sim --package sevenbot-cli")?;
    // A port open for each arm: more than a process may have by itself.
    let limit = getrlimit(Resource::Nofile);
    setrlimit(Resource::Nofile, Rlimit { current: limit.maximum, ..limit })?;
    let (host_sim, sevenbot) = (release("host-sim"), release("sevenbot"));
    for program in [&host_sim, &sevenbot] {
        println!("{:10} bytes: {}", fs::metadata(program)?.len(), program.display());
    }
    let arm = Simulator::start(&host_sim, 1, &["--eeprom", "none", "--unpaced"])?;
    let port = arm.port().display().to_string();
    print_times("sevenbot --version", starts(&sevenbot, &["--version"])?);
    print_times(
        "sevenbot get target-position, unpaced",
        starts(&sevenbot, &["--port", &port, "get", "target-position"])?,
    );
    print_times("read of 7 and its answer, unpaced", round_trips(&arm)?);
    drop(arm);
    print_arms(&host_sim)
}

fn release(program: &str) -> PathBuf {
    target_directory().join("release").join(program)
}

/// How long a program takes from its start to its end, each time.
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
        take_answer(port)?;
        Ok(start.elapsed())
    };
    (0..ROUND_TRIPS).map(|_| trip()).collect()
}

/// The median, and what one in a hundred is above.
fn print_times(what: &str, mut times: Vec<Duration>) {
    times.sort_unstable();
    let percentile = |part: usize| times.get(times.len() * part / 100).copied().unwrap_or_default();
    let millis = |time: Duration| time.as_secs_f64() * 1e3;
    println!("{:10.3} ms, 99 of 100 under {:.3} ms: {what}", millis(percentile(50)), millis(percentile(99)));
}

/// What arms take of a core when nobody asks, and with a host each that asks at 100 Hz, worked out from what was
/// measured: most of an answer costs the same however often there is one.
fn print_arms(program: &Path) -> Outcome {
    println!(
        "\nArms in one process, each with its settings in a file and its bytes paced at 115200 baud. Shares of a core;"
    );
    println!("busy: all joints move, and a host asks for the positions. Memory: anonymous, KiB");
    let columns = [
        "arms",
        "idle",
        "an arm",
        "asked at",
        "busy",
        "an answer",
        "an arm at 100 Hz",
        "arms a core",
        "memory",
    ];
    let mut table = TextTable::new(columns.map(Right));
    let mut memory = Vec::new();
    for size in SIZES {
        let folder = tempfile::tempdir()?;
        let image = folder.path().join("arm.bin").display().to_string();
        let arms = Simulator::start(program, size, &["--eeprom", &image])?;
        let idle = arms.share_idle()?;
        let (busy, rate) = arms.share_polled()?;
        let kibibytes = arms.memory()?;
        let answer = (busy - idle).max(0.0) / (rate * size as f64);
        let each = idle / size as f64;
        let at_100_hz = each + 100.0 * answer;
        table.add([
            size.to_string(),
            format!("{:.2} %", 100.0 * idle),
            format!("{:.3} %", 100.0 * each),
            format!("{rate:.1} Hz"),
            format!("{:.2} %", 100.0 * busy),
            format!("{:.1} us", 1e6 * answer),
            format!("{:.3} %", 100.0 * at_100_hz),
            format!("{:.0}", at_100_hz.recip()),
            kibibytes.to_string(),
        ]);
        memory.push((size, kibibytes));
    }
    print!("{table}");
    if let ([(1, one), ..], [.., (most, all)]) = (memory.as_slice(), memory.as_slice()) {
        let more = all.saturating_sub(*one) as f64 / (most - 1) as f64;
        println!("each arm more takes {more:.1} KiB");
    }
    Ok(())
}
