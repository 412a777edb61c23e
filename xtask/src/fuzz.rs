//! `cargo xtask fuzz`: inputs that a fuzzer makes up, so long or so many for each target, with the stable compiler.
//!
//! ```text
//!   fuzz_targets ── cargo build, with the compiler's coverage counters ──> target/fuzz/build
//!   corpus ───────> one program for each target ──> target/fuzz/TARGET   new inputs that reach more
//!                                               └─> target/fuzz/failures inputs that break a rule
//! ```
//!
//! The next run goes on from the inputs of the last. Knows nothing of what the targets try: `verification/fuzz/README.md`
//! does. `fuzz_targets` and `corpus` are beside it.

use std::fs;
use std::io;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};
use std::thread::{self, ScopedJoinHandle, available_parallelism};
use std::time::{SystemTime, UNIX_EPOCH};

use clap::Args;

use crate::run::{Outcome, root, run, target_directory};
use crate::trials::Trials;

/// The programs, and how many inputs each is given in the fixed form: some 15 s of one processor.
const TARGETS: [(&str, u32); 6] = [
    ("controller", 100_000),
    ("deframer", 100_000),
    ("host_reply", 1_000_000),
    ("image_file", 40_000),
    ("journal", 100_000),
    ("register_ops", 2_000_000),
];
/// The seed of the fixed form.
const FIXED_SEED: u32 = 1;
/// Bytes of an input, at most.
const LONGEST: usize = 512;
/// What makes the compiler count the edges of the control flow and report comparisons, as libFuzzer needs it.
/// cargo-fuzz passes the same flags. None of them needs a nightly compiler: the address sanitizer would.
const COVERAGE: &str = "--cfg fuzzing -Cpasses=sancov-module -Cllvm-args=-sanitizer-coverage-level=4 \
    -Cllvm-args=-sanitizer-coverage-inline-8bit-counters -Cllvm-args=-sanitizer-coverage-pc-table \
    -Cllvm-args=-sanitizer-coverage-trace-compares";

/// For how long, and from where.
#[derive(Args)]
pub(crate) struct Options {
    /// Seconds for each of the six targets
    #[arg(long, default_value_t = 60)]
    pub(crate) seconds: u64,
    /// Where the fuzzer's chance begins; another one in each run if this is left out
    #[arg(long)]
    pub(crate) seed: Option<u32>,
    /// What `cargo xtask test` does: so many inputs, the same every time
    #[arg(long, conflicts_with_all = ["seconds", "seed"])]
    pub(crate) fixed: bool,
}

/// Fuzzes every target, and prints the table.
pub(crate) fn check(options: &Options) -> Outcome {
    if options.fixed {
        return fixed();
    }
    let seed = options.seed.unwrap_or_else(another_seed);
    let mut trials = Trials::default();
    all(options.seconds, seed, &mut trials)?;
    trials.finish(u64::from(seed))
}

/// The fixed form: the same inputs every time, as long as the code is the same.
pub(crate) fn fixed() -> Outcome {
    println!("fuzzing: so many inputs for each target, seed {FIXED_SEED}");
    let mut trials = Trials::default();
    each(FIXED_SEED, None, &mut trials)?;
    trials.finish(u64::from(FIXED_SEED))
}

/// Fuzzes every target for so long, and adds the results to `trials`.
pub(crate) fn all(seconds: u64, seed: u32, trials: &mut Trials) -> Outcome {
    println!("fuzzing: {seconds} s for each target, seed {seed}");
    each(seed, Some(seconds), trials)
}

/// As many targets at once as there are processors. In the fixed form without `seconds`.
fn each(seed: u32, seconds: Option<u64>, trials: &mut Trials) -> Outcome {
    let programs = build()?;
    let at_once = available_parallelism().map_or(1, usize::from);
    for targets in TARGETS.chunks(at_once) {
        let outputs: Vec<_> = thread::scope(|scope| {
            let programs = &programs;
            let start = |&(target, inputs)| {
                scope.spawn(move || match seconds {
                    Some(seconds) => one(programs, target, seed, &format!("-max_total_time={seconds}")),
                    None => one_anew(programs, target, seed, &format!("-runs={inputs}")),
                })
            };
            let running: Vec<_> = targets.iter().map(start).collect();
            running.into_iter().map(ScopedJoinHandle::join).collect()
        });
        for ((target, _), output) in targets.iter().zip(outputs) {
            report(target, &output.map_err(|_| "a thread panicked")??, trials);
        }
    }
    Ok(())
}

/// Builds the programs and says where they are.
fn build() -> Outcome<PathBuf> {
    let folder = target_directory().join("fuzz/build");
    let host = host()?;
    let words = format!(
        "build --quiet --release --manifest-path verification/fuzz/Cargo.toml --target {host} --target-dir {}",
        folder.display()
    );
    run("cargo", &words, &[("RUSTFLAGS", COVERAGE)])?;
    Ok(folder.join(host).join("release"))
}

/// The triple of this machine. Named as the target, it keeps the flags from build scripts and macros.
fn host() -> Outcome<String> {
    let output = Command::new("rustc").arg("-vV").current_dir(root()).output()?;
    let said = String::from_utf8(output.stdout)?;
    let host = said.lines().find_map(|line| line.strip_prefix("host: "));
    Ok(host.ok_or("`rustc -vV` names no host")?.to_owned())
}

/// Goes on from the inputs of the last run.
fn one(programs: &Path, target: &str, seed: u32, amount: &str) -> io::Result<Output> {
    fuzz(programs, target, seed, amount, &target_directory().join("fuzz").join(target))
}

/// Begins with the corpus alone.
fn one_anew(programs: &Path, target: &str, seed: u32, amount: &str) -> io::Result<Output> {
    let found = target_directory().join("fuzz/fixed").join(target);
    if found.exists() {
        fs::remove_dir_all(&found)?;
    }
    fuzz(programs, target, seed, amount, &found)
}

fn fuzz(programs: &Path, target: &str, seed: u32, amount: &str, found: &Path) -> io::Result<Output> {
    let failures = failures();
    fs::create_dir_all(found)?;
    fs::create_dir_all(&failures)?;
    let mut command = Command::new(programs.join(target));
    command.current_dir(root()).arg(found).arg(format!("verification/fuzz/corpus/{target}"));
    command.arg(format!("-artifact_prefix={}/{target}-", failures.display()));
    command.args([format!("-seed={seed}"), format!("-max_len={LONGEST}"), amount.to_owned()]);
    // Inputs that another program adds meanwhile would make two runs differ.
    command.args(["-reload=0", "-print_final_stats=1"]);
    command.output()
}

/// Where inputs that break a rule are kept.
fn failures() -> PathBuf {
    target_directory().join("fuzz/failures")
}

fn report(target: &str, output: &Output, trials: &mut Trials) {
    let said = String::from_utf8_lossy(&output.stderr);
    let (name, many) = (format!("fuzz, {target}"), format!("{} executions", executions(&said).unwrap_or(0)));
    if output.status.success() {
        trials.add(&name, &many, "nothing");
    } else {
        println!("{said}");
        trials.fail(&name, &many, &format!("FAILED: see above, and {}", failures().display()));
    }
}

/// What libFuzzer counted.
fn executions(said: &str) -> Option<u64> {
    let count = said.lines().find_map(|line| line.strip_prefix("stat::number_of_executed_units:"))?;
    count.trim().parse().ok()
}

/// A seed from the clock. libFuzzer takes 0 for "choose one", so it is never 0.
fn another_seed() -> u32 {
    let time = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
    time.subsec_nanos() | 1
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_count_is_one_line_of_many() {
        let said = "Done 12 runs\nstat::number_of_executed_units: 1393173\nstat::peak_rss_mb:   29\n";
        assert_eq!(executions(said), Some(1_393_173));
        assert_eq!(executions("error: no such target"), None);
    }

    #[test]
    fn every_target_has_its_program_and_its_corpus() {
        for (target, _) in TARGETS {
            assert!(root().join(format!("verification/fuzz/fuzz_targets/{target}.rs")).exists(), "{target}");
            assert!(root().join(format!("verification/fuzz/corpus/{target}")).is_dir(), "{target}");
        }
    }
}
