//! Stops through real sockets, at random moments, beside programs that attack the server. Each stop reaches the arm. After it,
//! no target of another program reaches the arm, and the arm comes to rest where it was held.
//!
//! By default the test makes two stops beside each attack, and checks no times. With `SERVE_STOPS`, the number of stops beside
//! each attack, it also checks how long a stop takes, on a machine that does nothing else. `SERVE_ATTACK` selects one attack,
//! such as `Readers`. A hundred stops beside each attack take about seven minutes:
//!
//! ```sh
//! SERVE_STOPS=100 cargo test --release -p system-tests --test system serve::stops -- --nocapture
//! ```

mod attack;
mod gate;
pub(super) mod program;

use std::sync::{Arc, Mutex};
use std::thread;
use std::time::{Duration, Instant};

use system_tests::random::Random;
use system_tests::registers::TARGET_POSITION;
use system_tests::relay::Passing;
use system_tests::wait::wait_until;
use system_tests::write_request;

use self::attack::Attack;
use self::gate::Gate;
use self::program::{Program, TOKEN, stream};
use super::served::Served;

const SEED: u64 = 25;
/// The first register of the fine targets, the first register of the fine positions, and the number of bytes of each block.
const FINE_TARGET: u8 = 128;
const FINE_POSITION: u8 = 142;
const FINE: u8 = 14;
/// How long the test watches that nothing moves the arm: after each stop, and at rest after some stops.
const WATCHED: Duration = Duration::from_millis(60);
const WATCHED_AT_REST: Duration = Duration::from_millis(1_000);
/// The arm is watched at rest once in this number of stops, and at the end of an attack.
const BETWEEN_RESTS: usize = 50;
/// The most that a holding joint moves, in hundredths of a degree.
const STILL: u16 = 30;
/// The farthest that the weight of the arm moves a joint off its target, in hundredths of a degree.
const DROOP: u16 = 150;

/// The longest braking distance, in hundredths of a degree. A joint that is farther from the target of a stop is not braking:
/// on a busy machine the program had read the position long before. The server may hold such a joint where it is.
const LONGEST_BRAKING: u16 = 1_500;

/// The longest time until a stop reaches the arm. The line (115 200 baud) carries 230 bytes in this time, so at most 230 bytes
/// may reach the arm before the stop.
const LATEST: Duration = Duration::from_millis(20);
const MOST_BEFORE: u64 = 230;

/// A write of targets on the arm's line.
struct Target {
    at: Instant,
    /// Bytes to the arm before it.
    before: u64,
    frame: Vec<u8>,
}

/// What went to the arm: the number of all bytes, and the writes of targets in their order.
#[derive(Default)]
struct Sent {
    bytes: u64,
    targets: Vec<Target>,
}

type Line = Arc<Mutex<Sent>>;

struct StopTimes {
    /// From the write that holds the arm to its arrival on the arm's line.
    to_arm: Duration,
    /// Bytes that went to the arm meanwhile.
    bytes: u64,
    /// From the first read of the positions to the reply that confirms the targets, with all repeats.
    in_all: Duration,
}

#[test]
fn nothing_moves_the_arm_after_a_stop_whoever_attacks() {
    let campaign = std::env::var("SERVE_STOPS").ok().map(|text| text.parse().expect("a number"));
    let count = campaign.unwrap_or(2);
    println!("{count} stops beside each attack, seed {SEED}");
    let line = Line::default();
    let watched = Arc::clone(&line);
    let watch = move |passing: Passing<'_>| {
        let Passing::Request(frame) = passing else { return };
        let mut sent = watched.lock().expect("no panic");
        let before = sent.bytes;
        sent.bytes += u64::try_from(frame.len()).expect("small");
        if writes_targets(frame) {
            sent.targets.push(Target { at: Instant::now(), before, frame: frame.to_vec() });
        }
    };
    let served = Served::start_watched(1, &["--token", TOKEN], Box::new(watch));
    let mut random = Random::new(SEED);
    let mut stoppers = Program::of_each_kind(&served);
    let chosen = std::env::var("SERVE_ATTACK").ok();
    for attack in Attack::ALL {
        if chosen.as_ref().is_some_and(|chosen| *chosen != format!("{attack:?}")) {
            continue;
        }
        let times = beside(attack, &served, &line, &mut stoppers, count, &mut random);
        print(attack, &times);
        if campaign.is_some() {
            check_times(attack, &times);
        }
    }
}

/// Stops the arm again and again beside an attack.
fn beside(
    attack: Attack,
    served: &Served,
    line: &Line,
    stoppers: &mut [Program],
    count: usize,
    random: &mut Random,
) -> Vec<StopTimes> {
    let gate = &Gate::default();
    let mut times = Vec::new();
    thread::scope(|scope| {
        // Ends the programs, also if this thread panics.
        let _end = gate.ends_others();
        let mut streamer = Program::over_tcp(served);
        scope.spawn(move || {
            let _end = gate.ends_others();
            stream(&mut streamer, gate);
        });
        for _ in 0..attack.attackers() {
            scope.spawn(|| {
                let _end = gate.ends_others();
                attack.run(served, gate);
            });
        }
        for turn in 0..count {
            gate.release(attack.attackers() + 1);
            thread::sleep(Duration::from_millis(20 + random.below(130)));
            let stopper = &mut stoppers[turn % 3];
            let (stop, held) = stop(stopper, line);
            times.push(stop);
            thread::sleep(WATCHED);
            let context = format!("{attack:?}, stop {turn}");
            let request = write_request(FINE_TARGET, &held);
            check_rests(line, &request, &context);
            let target = stopper.read(FINE_TARGET, FINE);
            let moved = words(&target).zip(words(&held)).map(|(is, was)| is.abs_diff(was));
            let is_held = moved.clone().all(|distance| distance == 0 || distance > LONGEST_BRAKING);
            assert!(
                is_held,
                "{context}: nothing moves it: {held:?}, {target:?}\n{}",
                writes_since(line, &request)
            );
            if (turn + 1) % BETWEEN_RESTS == 0 || turn + 1 == count {
                check_is_at_rest(stopper, &target, &context);
            }
        }
    });
    times
}

/// Checks that the arm comes to rest near `held`, and stays there.
#[track_caller]
fn check_is_at_rest(program: &mut Program, held: &[u8], context: &str) {
    let mut at_rest = program.read(FINE_POSITION, FINE);
    wait_until("the arm rests", || {
        thread::sleep(Duration::from_millis(200));
        let before = std::mem::replace(&mut at_rest, program.read(FINE_POSITION, FINE));
        farthest(&before, &at_rest) <= STILL
    });
    let off = farthest(held, &at_rest);
    assert!(off <= DROOP, "{context}: at rest {off} hundredths from where it was stopped");
    thread::sleep(WATCHED_AT_REST);
    let moved = farthest(&at_rest, &program.read(FINE_POSITION, FINE));
    assert!(moved <= STILL, "{context}: moved by {moved} hundredths");
}

/// Stops the arm: reads the positions, writes them as targets, and reads the targets back. Repeats this until the targets equal
/// the positions. Returns the times, and these targets.
fn stop(stopper: &mut Program, line: &Line) -> (StopTimes, Vec<u8>) {
    let start = Instant::now();
    for _ in 0..100 {
        let held = stopper.read(FINE_POSITION, FINE);
        line.lock().expect("no panic").targets.clear();
        let request = write_request(FINE_TARGET, &held);
        let sent = Instant::now();
        stopper.send(&request);
        // From now on the server can know of the stop.
        let bytes_at_sending = line.lock().expect("no panic").bytes;
        if stopper.read(FINE_TARGET, FINE) != held {
            continue;
        }
        let in_all = start.elapsed();
        let line = line.lock().expect("no panic");
        if let Some(arrived) = line.targets.iter().find(|target| target.frame == request) {
            let bytes = arrived.before.saturating_sub(bytes_at_sending);
            return (StopTimes { to_arm: arrived.at - sent, bytes, in_all }, held);
        }
    }
    panic!("the arm did not take a stop");
}

/// Checks that since the stop no frame reached the arm that begins with a coarse target. This covers the targets of all other
/// programs, except those of [`Attack::LongWrites`], whose frames begin before the targets.
#[track_caller]
fn check_rests(line: &Line, stop: &[u8], context: &str) {
    let line = line.lock().expect("no panic");
    let place = line.targets.iter().position(|target| target.frame == stop).expect("the stop");
    let is_coarse = |target: &&Target| (TARGET_POSITION..FINE_TARGET).contains(&target.frame[3]);
    let after = line.targets[place..].iter().filter(is_coarse);
    assert_eq!(after.count(), 0, "{context}: a target came after it");
}

/// The writes of targets since the stop, for a message.
fn writes_since(line: &Line, stop: &[u8]) -> String {
    let line = line.lock().expect("no panic");
    let place = line.targets.iter().position(|target| target.frame == stop).expect("the stop");
    let start = line.targets[place].at;
    let text = |target: &Target| format!("{:?}: {:?}", target.at - start, target.frame);
    line.targets[place..].iter().map(text).collect::<Vec<_>>().join("\n")
}

/// Does the frame write targets, of this map or of the maker's?
fn writes_targets(frame: &[u8]) -> bool {
    let &[_, _, 4 | 6, address, count, ..] = frame else { return false };
    let holds =
        |first: u8, registers: u8| address < first + registers && address.saturating_add(count) > first;
    holds(TARGET_POSITION, 7) || holds(FINE_TARGET, FINE)
}

fn farthest(one: &[u8], other: &[u8]) -> u16 {
    words(one).zip(words(other)).map(|(one, other)| one.abs_diff(other)).max().expect("joints")
}

fn words(bytes: &[u8]) -> impl Iterator<Item = u16> + Clone {
    bytes.chunks_exact(2).map(|word| u16::from_le_bytes([word[0], word[1]]))
}

fn print(attack: Attack, times: &[StopTimes]) {
    let of = |select: fn(&StopTimes) -> f64| {
        let mut all: Vec<_> = times.iter().map(select).collect();
        all.sort_by(f64::total_cmp);
        let at = |share: usize| all[(all.len() * share / 100).min(all.len() - 1)];
        [at(50), at(99), at(100)]
    };
    println!(
        "{attack:?}: {} stops, p50, p99 and most: on the line after {:.1?} ms, confirmed after {:.1?} ms, bytes before it {:?}",
        times.len(),
        of(|stop| stop.to_arm.as_secs_f64() * 1e3),
        of(|stop| stop.in_all.as_secs_f64() * 1e3),
        of(|stop| f64::from(u32::try_from(stop.bytes).expect("few")))
    );
}

/// Checks that at least 99 of 100 stops are within the bounds, in time and in bytes.
fn check_times(attack: Attack, times: &[StopTimes]) {
    let late = |is_late: fn(&&StopTimes) -> bool| times.iter().filter(is_late).count();
    let (in_time, in_bytes) = (late(|stop| stop.to_arm > LATEST), late(|stop| stop.bytes > MOST_BEFORE));
    assert!(
        in_time.max(in_bytes) <= times.len() / 100,
        "{attack:?}: {in_time} stops took more than {LATEST:?}, and {in_bytes} waited for more than {MOST_BEFORE} bytes"
    );
}
