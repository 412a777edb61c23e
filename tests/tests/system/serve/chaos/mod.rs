//! Fifty programs connect, behave badly and disconnect, while the arm is unplugged: once by default, each minute in a longer
//! run. No reply is lost or reaches another program, and no target is carried out late.
//!
//! ```text
//!   Visitor ──▶ Wire: pseudo-terminal, Unix socket, TCP, WebSocket ──▶ server ──▶ relay ──▶ simulator
//!      └── what it sent, and when ──▶ SentTargets ◀── what reached the arm ──────────┘
//! ```
//!
//! The test lasts `SERVE_CHAOS_SECONDS`, by default 24 s. A campaign of an hour, with an outage each minute:
//!
//! ```sh
//! SERVE_CHAOS_SECONDS=3600 cargo test --release -p system-tests --test system serve::chaos -- --nocapture
//! ```

mod frame_visits;
mod sent_targets;
mod visit;
mod visitor;
mod web_visits;
mod wire;

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Child;
use std::sync::Arc;
use std::thread;
use std::time::{Duration, Instant};

use system_tests::process::kilobytes;
use system_tests::relay::Watch;
use system_tests::wait::wait_for;

use self::visitor::{Chaos, Tally, visit};
use self::wire::{Security, WayIn};
use super::served::{Served, names};

const TOKEN: &str = "correct-horse";
/// The number of programs: eight on pseudo-terminals, the others on the other kinds of connections in turn.
const TERMINALS: usize = 8;
const PROGRAMS: usize = 50;
/// The time to the first outage, the time between two outages, and the length of an outage. A missing reply counts as lost
/// only after a full wait (30 s) without an outage. So the time between two outages is longer than that wait.
const BEFORE_OUTAGES: Duration = Duration::from_secs(4);
const BETWEEN_OUTAGES: Duration = Duration::from_secs(56);
const OUTAGE: Duration = Duration::from_millis(3_500);
/// If `SERVE_CHAOS_SECONDS` is set, a target of this age is late. A target waits in the server for 200 ms at most; the rest
/// allows for times in which the system does not run a program. Other test runs use `OUTAGE`, because the machine may be busy.
const LATE: Duration = Duration::from_millis(2_000);
/// The timeout of one read in [`wait_for_arm`]. It is long: fifty programs use the line, and the machine may be busy.
const ANSWERED: Duration = Duration::from_secs(5);
/// KiB by which the memory of the server may grow.
const MOST_GROWTH: u64 = 8_192;

#[test]
fn fifty_chaotic_programs_lose_nothing_cross_nothing_and_move_nothing_late() {
    let campaign = std::env::var("SERVE_CHAOS_SECONDS").ok().map(|text| text.parse().expect("a number"));
    let seconds = campaign.unwrap_or(24);
    let seed = std::env::var("SERVE_CHAOS_SEED").map_or(25, |text| text.parse().expect("a number"));
    println!("{seconds} s, seed {seed}");
    run(Duration::from_secs(seconds), seed, if campaign.is_some() { LATE } else { OUTAGE });
}

fn run(length: Duration, seed: u64, late: Duration) {
    let certificate = |name: &str| -> PathBuf {
        Path::new(env!("CARGO_MANIFEST_DIR")).join("../sevenbot-serve/tests/certificate").join(name)
    };
    let path = |name: &str| certificate(name).to_str().expect("text").to_owned();
    let options = ["--token", TOKEN, "--tls-cert", &path("certificate.pem"), "--tls-key", &path("key.pem")];
    let security = Security::new(TOKEN, Some(certificate("certificate.pem")));
    let chaos = Arc::new(Chaos::new(security, length));
    let watch = || -> Watch {
        let chaos = Arc::clone(&chaos);
        Box::new(move |passing| chaos.note(passing))
    };
    let mut served = Served::start_watched(TERMINALS, &options, watch());
    wait_for_arm(&chaos, &served);
    let files = open_files(&served.server);
    let ways_in = ways_in(&served);
    let (total, memory) = thread::scope(|scope| {
        // Ends the programs, also if this thread panics.
        let _end = chaos.ends_at_drop();
        let mut programs = Vec::new();
        for (number, way_in) in (0..).zip(&ways_in) {
            let chaos = Arc::clone(&chaos);
            programs.push(scope.spawn(move || visit(&chaos, way_in, number, seed)));
            thread::sleep(Duration::from_millis(10));
        }
        let warm_up = Instant::now() + length / 8;
        let mut memory = None;
        let mut next_outage = Instant::now() + BEFORE_OUTAGES;
        while !chaos.is_over() {
            thread::sleep(Duration::from_millis(50));
            if memory.is_none() && Instant::now() >= warm_up {
                memory = Some(kilobytes(&served.server));
            }
            if Instant::now() >= next_outage {
                chaos.turn_over();
                served.unplug();
                thread::sleep(OUTAGE);
                served.plug(watch());
                wait_for_arm(&chaos, &served);
                chaos.turn_over();
                next_outage = Instant::now() + BETWEEN_OUTAGES;
            }
        }
        let mut total = Tally::default();
        for (program, way_in) in programs.into_iter().zip(&ways_in) {
            let tally = program.join().expect("no program fails");
            println!("{way_in:?}: {tally:?}");
            total += tally;
        }
        (total, memory.expect("a sample"))
    });
    check_ages(&chaos, late);
    check(&chaos, &served, total, memory, files);
}

/// Prints the ages of the targets that reached the arm, and checks that each is less than `late`.
fn check_ages(chaos: &Chaos, late: Duration) {
    let (ages, sent) = chaos.targets.ages();
    let age = |share: usize| ages.get(ages.len() * share / 1_000).copied().unwrap_or_default();
    println!("{} outages; {} of {sent} targets reached the arm", chaos.outages(), ages.len());
    println!(
        "their ages: p50 {:?}, p99 {:?}, p99.9 {:?}, at most {:?}",
        age(500),
        age(990),
        age(999),
        ages.last()
    );
    assert!(ages.len() > 100, "something happened");
    assert!(ages.last().is_some_and(|&age| age < late), "a late target: {:?}", ages.last());
}

fn check(chaos: &Chaos, served: &Served, total: Tally, memory: u64, files: usize) {
    println!("all: {total:?}");
    let at_end = kilobytes(&served.server);
    println!("memory of the server: {memory} KiB after the first eighth, {at_end} KiB at the end");
    assert_eq!((total.lost, total.crossed), (0, 0));
    assert!(total.replies > 100 && chaos.outages() > 0, "something happened");
    assert!(at_end <= memory + MOST_GROWTH, "the server grows");
    wait_for("no place stays taken", || {
        let open = open_files(&served.server);
        if open <= files { Ok(()) } else { Err(format!("{open} open files, {files} before")) }
    });
}

/// The way of each program to the server.
fn ways_in(served: &Served) -> Vec<WayIn> {
    let address = |stream: std::net::TcpStream| stream.peer_addr().expect("an address").to_string();
    let (tcp, web) = (address(served.connect()), address(served.connect_web()));
    let terminals = names(TERMINALS).map(|name| WayIn::Terminal(served.folder.path().join(name)));
    let others = (TERMINALS..PROGRAMS).map(|number| match number % 4 {
        0 => WayIn::Unix(served.local_socket()),
        1 => WayIn::Web { address: web.clone(), is_page: false },
        2 => WayIn::Web { address: web.clone(), is_page: true },
        _ => WayIn::Tcp(tcp.clone()),
    });
    let mut all: Vec<WayIn> = terminals.chain(others).collect();
    // The first programs have registers of their own. The rotation gives them all kinds of connections.
    all.rotate_left(TERMINALS / 2);
    all
}

/// Waits until the arm answers a program that connects. The text of a failure describes the line, the server and the simulator.
fn wait_for_arm(chaos: &Chaos, served: &Served) {
    wait_for("the arm answers", || {
        served.ask_for_arm(ANSWERED).map_err(|error| {
            let load = fs::read_to_string("/proc/loadavg").expect("the load of the machine");
            format!(
                "{error}; {}; server: {}, {} open files; simulator: {}; load {}",
                chaos.line_of_late(),
                state_of(&served.server),
                open_files(&served.server),
                state_of(&served.simulator),
                load.trim()
            )
        })
    });
}

/// The state letter of a process from `/proc`, such as R for running, and the processor time that it has used.
fn state_of(process: &Child) -> String {
    let stat = fs::read_to_string(format!("/proc/{}/stat", process.id())).expect("its state");
    let (_, fields) = stat.rsplit_once(')').expect("a name");
    let fields: Vec<&str> = fields.split_whitespace().collect();
    format!("{}, {} + {} ticks of processor", fields[0], fields[11], fields[12])
}

fn open_files(process: &Child) -> usize {
    fs::read_dir(format!("/proc/{}/fd", process.id())).expect("its files").count()
}
