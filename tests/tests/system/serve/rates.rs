//! How many reads the server answers, and how fast: one, ten and fifty programs for each kind of connection. This is a
//! measurement, not a check. It runs on demand, on a machine that does nothing else.
//!
//! ```sh
//! cargo test --release -p system-tests --test system serve::rates -- --ignored --nocapture
//! ```
//!
//! `SERVE_RATE_SECONDS` is the length of each row, 10 by default.

use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;
use std::time::{Duration, Instant};

use system_tests::process;
use system_tests::registers::PRESENT_POSITION;

use super::served::{Served, WebClient, names, simulator};
use super::stops::program::{Program, TOKEN};

/// Numbers of programs for each kind of connection.
const PROGRAMS: [usize; 3] = [1, 10, 50];
/// Programs that read 255 registers while another one times a small read.
const LONG_READERS: usize = 31;

/// Reads registers once.
type Read = Box<dyn FnMut() + Send>;

#[test]
#[ignore = "a measurement of some minutes"]
fn rates_and_times_of_small_reads() {
    println!("| way in | programs | replies/s | p50 ms | p99 ms |");
    println!("| --- | --- | --- | --- | --- |");
    let folder = tempfile::tempdir().expect("a folder");
    let arm = simulator(folder.path());
    let mut direct = Program::on_terminal(&folder.path().join("arm"));
    print_row("direct", vec![Box::new(move || drop(direct.read(PRESENT_POSITION, 7)))]);
    drop(arm);
    let served = Served::start(PROGRAMS[2], &["--token", TOKEN]);
    let before = process::kilobytes(&served.server);
    for count in PROGRAMS {
        let terminals = names(count).map(|name| Program::on_terminal(&served.folder.path().join(name)));
        print_row("pseudo-terminal", terminals.map(of_program).collect());
        print_row("TCP", (0..count).map(|_| of_program(Program::over_tcp(&served))).collect());
        print_row("Unix socket", (0..count).map(|_| of_program(Program::over_unix(&served))).collect());
        let web = || {
            let bearer = ("authorization", &*format!("Bearer {TOKEN}"));
            let mut client = WebClient::connect(&served, &[bearer]).expect("accepted");
            Box::new(move || drop(client.read(PRESENT_POSITION, 7))) as Read
        };
        print_row("WebSocket", (0..count).map(|_| web()).collect());
    }
    beside_long_readers(&served);
    println!(
        "memory of the server: {before} KiB before, {} KiB at the end",
        process::kilobytes(&served.server)
    );
}

fn of_program(mut program: Program) -> Read {
    Box::new(move || drop(program.read(PRESENT_POSITION, 7)))
}

fn beside_long_readers(served: &Served) {
    let is_over = &AtomicBool::new(false);
    thread::scope(|scope| {
        for _ in 0..LONG_READERS {
            let mut program = Program::over_tcp(served);
            scope.spawn(move || {
                while !is_over.load(Ordering::SeqCst) {
                    program.read(0, 255);
                }
            });
        }
        let small = of_program(Program::over_tcp(served));
        print_row(&format!("TCP, beside {LONG_READERS} readers of 255"), vec![small]);
        is_over.store(true, Ordering::SeqCst);
    });
}

/// Runs each program in a thread of its own, and prints a row of the table.
fn print_row(way: &str, programs: Vec<Read>) {
    let seconds = std::env::var("SERVE_RATE_SECONDS").map_or(10, |text| text.parse().expect("a number"));
    let count = programs.len();
    let start = Instant::now();
    let end = start + Duration::from_secs(seconds);
    let mut times: Vec<Duration> = thread::scope(|scope| {
        let running = programs.into_iter().map(|read| scope.spawn(move || times_of(read, end)));
        let running: Vec<_> = running.collect();
        running.into_iter().flat_map(|program| program.join().expect("no program fails")).collect()
    });
    let elapsed = start.elapsed().as_secs_f64();
    times.sort_unstable();
    let at = |share: usize| times[times.len() * share / 100].as_secs_f64() * 1e3;
    let rate = f64::from(u32::try_from(times.len()).expect("few")) / elapsed;
    println!("| {way} | {count} | {rate:.0} | {:.1} | {:.1} |", at(50), at(99));
}

fn times_of(mut read: Read, end: Instant) -> Vec<Duration> {
    let mut times = Vec::new();
    while Instant::now() < end {
        let start = Instant::now();
        read();
        times.push(start.elapsed());
    }
    times
}
