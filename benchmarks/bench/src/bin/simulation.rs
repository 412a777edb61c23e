//! `cargo xtask bench --simulation`: how many seconds of simulated arms pass in a second.
//!
//! All arms of a thread step together by 10 ms. *Idle* arms hold their pose. *Moving* arms follow a new target each second
//! with all joints. *Polled* arms move too, and in each step a host reads the positions of each and waits for the reply.

use std::error::Error;
use std::fs;
use std::thread;
use std::time::{Duration, Instant};

use arm_sim::request::Request;
use arm_sim::{Simulation, SimulationConfig};

/// The virtual time of a step.
const STEP: arm_sim::Duration = arm_sim::Duration::from_millis(10);
/// Steps in a second.
const STEPS: u64 = 100;
/// The time of a measurement.
const TIME: Duration = Duration::from_secs(2);
/// Bytes of the reply to a read of seven registers.
const REPLY_LENGTH: usize = 14;

/// What the arms do during a measurement; see the start of this file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Load {
    Idle,
    Moving,
    Polled,
}

fn main() -> Result<(), Box<dyn Error>> {
    println!("arm-seconds a second: how many times faster than real time all arms are together");
    println!(
        "{:>5} {:>8} {:>9} {:>9} {:>9} {:>12}",
        "arms", "threads", "idle", "moving", "polled", "KiB an arm"
    );
    for count in [1, 10, 100, 1_000] {
        for threads in [1, 2] {
            if threads > count {
                continue;
            }
            let [idle, moving, polled] =
                [Load::Idle, Load::Moving, Load::Polled].map(|load| arm_seconds(count, threads, load));
            let memory = memory_of(count)?;
            println!("{count:>5} {threads:>8} {idle:>9.0} {moving:>9.0} {polled:>9.0} {memory:>12.1}");
        }
    }
    Ok(())
}

/// The simulated arm-seconds in a real second, of all threads together.
fn arm_seconds(count: usize, threads: usize, load: Load) -> f64 {
    thread::scope(|scope| {
        let one = || scope.spawn(move || rate(&mut arms(count / threads), load));
        let all: Vec<_> = (0..threads).map(|_| one()).collect();
        all.into_iter().map(|thread| thread.join().unwrap_or(0.0)).sum::<f64>()
    })
}

/// Arms whose servos have started.
fn arms(count: usize) -> Vec<Simulation> {
    let mut first = Simulation::new(SimulationConfig::default());
    first.advance(arm_sim::Duration::from_millis(1_000));
    vec![first; count]
}

fn rate(arms: &mut [Simulation], load: Load) -> f64 {
    let (start, mut steps) = (Instant::now(), 0);
    while start.elapsed() < TIME {
        arms.iter_mut().for_each(|arm| step(arm, steps, load));
        steps += 1;
    }
    let seconds = steps as f64 / STEPS as f64;
    seconds * arms.len() as f64 / start.elapsed().as_secs_f64()
}

fn step(arm: &mut Simulation, number: u64, load: Load) {
    let end = arm.now() + STEP;
    if load != Load::Idle && number.is_multiple_of(STEPS) {
        let turn = if number.is_multiple_of(2 * STEPS) { 20 } else { 0 };
        let values = [90, 90, 65, 90, 90, 90, 80].map(|degrees| degrees + turn);
        arm.send_request(&Request::Write { address: 46, values: &values });
    }
    if load == Load::Polled {
        arm.send_request(&Request::Read { address: 54, count: 7 });
        arm.advance_until(STEP, |arm| arm.received().len() >= REPLY_LENGTH);
        arm.take_received();
    }
    arm.advance(end - arm.now());
}

/// How much this process grows for each of `count` arms, in KiB.
fn memory_of(count: usize) -> Result<f64, Box<dyn Error>> {
    let before = anonymous_memory()?;
    let arms = arms(count);
    let grown = anonymous_memory()?.saturating_sub(before);
    drop(arms);
    Ok(grown as f64 / count as f64)
}

/// The anonymous memory of this process, in KiB.
fn anonymous_memory() -> Result<u64, Box<dyn Error>> {
    let text = fs::read_to_string("/proc/self/smaps_rollup")?;
    let line = text.lines().find_map(|line| line.strip_prefix("Anonymous:")).ok_or("no memory")?;
    Ok(line.trim().trim_end_matches(" kB").parse()?)
}
