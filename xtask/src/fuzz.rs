//! `cargo xtask fuzz`: fuzzes each target for a time or a number of inputs, with the stable compiler.
//!
//! ```text
//!   fuzz_targets ── cargo build, with the compiler's coverage counters ──> target/fuzz/build
//!   corpus ───────> one program for each target ──> target/fuzz/TARGET   new inputs that reach more
//!                                               └─> target/fuzz/failures inputs that break a rule
//! ```
//!
//! The next run continues with the inputs of the last one. The fixed form starts with the corpus alone, and has a folder of its
//! own for new inputs. `verification/fuzz/README.md` describes the targets.

use std::fs;
use std::io;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};
use std::thread::{self, ScopedJoinHandle, available_parallelism};
use std::time::{SystemTime, UNIX_EPOCH};

use clap::Args;

use crate::run::{TaskResult, empty_folder, root, run, target_directory};
use crate::trials::Trials;

/// The targets, and the number of inputs in the fixed form, for about 15 s of one processor each. Measured inputs per second
/// in this time: `controller` 4,200, `deframer` 6,200, `host_reply` 3,900, `image_file` 1,900, `journal` 5,000,
/// `register_ops` 144,000. The rate falls while a target finds new inputs.
const TARGETS: [(&str, u32); 6] = [
    ("controller", 60_000),
    ("deframer", 100_000),
    ("host_reply", 60_000),
    ("image_file", 28_000),
    ("journal", 75_000),
    ("register_ops", 2_000_000),
];
/// The seed of the fixed form.
const FIXED_SEED: u32 = 1;
/// The largest size of an input in bytes.
const MAX_INPUT: usize = 512;
/// Flags that make the compiler count edges of the control flow and report comparisons, as libFuzzer needs. cargo-fuzz
/// passes the same flags. Only its address sanitizer needs a nightly compiler.
const COVERAGE: &str = "--cfg fuzzing -Cpasses=sancov-module -Cllvm-args=-sanitizer-coverage-level=4 \
    -Cllvm-args=-sanitizer-coverage-inline-8bit-counters -Cllvm-args=-sanitizer-coverage-pc-table \
    -Cllvm-args=-sanitizer-coverage-trace-compares";

/// The time and the seed.
#[derive(Args)]
pub(crate) struct FuzzArgs {
    /// Seconds for each of the six targets
    #[arg(long, default_value_t = 60)]
    pub(crate) seconds: u64,
    /// Seed of the fuzzer; without it, each run has another seed
    #[arg(long)]
    pub(crate) seed: Option<u32>,
    /// Do what `cargo xtask test` does: a fixed number of inputs, the same every time
    #[arg(long, conflicts_with_all = ["seconds", "seed"])]
    pub(crate) fixed: bool,
}

/// Fuzzes every target and prints the table.
pub(crate) fn check(options: &FuzzArgs) -> TaskResult {
    if options.fixed {
        return fixed();
    }
    let seed = options.seed.unwrap_or_else(random_seed);
    let mut trials = Trials::default();
    all(options.seconds, seed, &mut trials)?;
    trials.finish(u64::from(seed))
}

/// The fixed form: the same inputs every time, for the same code.
pub(crate) fn fixed() -> TaskResult {
    println!("fuzzing: a fixed number of inputs for each target, seed {FIXED_SEED}");
    let mut trials = Trials::default();
    fuzz_all(FIXED_SEED, None, &mut trials)?;
    trials.finish(u64::from(FIXED_SEED))
}

/// Fuzzes every target for this time, and adds the results to `trials`.
pub(crate) fn all(seconds: u64, seed: u32, trials: &mut Trials) -> TaskResult {
    println!("fuzzing: {seconds} s for each target, seed {seed}");
    fuzz_all(seed, Some(seconds), trials)
}

/// Fuzzes as many targets at once as there are processors. `seconds` is `None` for the fixed form.
fn fuzz_all(seed: u32, seconds: Option<u64>, trials: &mut Trials) -> TaskResult {
    let programs = build()?;
    let at_once = available_parallelism().map_or(1, usize::from);
    for targets in TARGETS.chunks(at_once) {
        let outputs: Vec<_> = thread::scope(|scope| {
            let programs = &programs;
            let start = |&(target, inputs)| {
                scope.spawn(move || match seconds {
                    Some(seconds) => {
                        fuzz_further(programs, target, seed, &format!("-max_total_time={seconds}"))
                    }
                    None => fuzz_from_corpus(programs, target, seed, &format!("-runs={inputs}")),
                })
            };
            let running: Vec<_> = targets.iter().map(start).collect();
            running.into_iter().map(ScopedJoinHandle::join).collect()
        });
        for ((target, _), output) in targets.iter().zip(outputs) {
            add_result(target, &output.map_err(|_| "a thread panicked")??, trials);
        }
    }
    Ok(())
}

/// Builds the programs and returns their folder.
fn build() -> TaskResult<PathBuf> {
    let folder = target_directory().join("fuzz/build");
    let host = host()?;
    let words = format!(
        "build --quiet --release --manifest-path verification/fuzz/Cargo.toml --target {host} --target-dir {}",
        folder.display()
    );
    run("cargo", &words, &[("RUSTFLAGS", COVERAGE)])?;
    Ok(folder.join(host).join("release"))
}

/// The target triple of this machine. With an explicit target, cargo does not apply the flags to build scripts and macros.
fn host() -> TaskResult<String> {
    let output = Command::new("rustc").arg("-vV").current_dir(root()).output()?;
    let output = String::from_utf8(output.stdout)?;
    let host = output.lines().find_map(|line| line.strip_prefix("host: "));
    Ok(host.ok_or("`rustc -vV` names no host")?.to_owned())
}

/// Continues with the inputs of the last run.
fn fuzz_further(programs: &Path, target: &str, seed: u32, amount: &str) -> io::Result<Output> {
    fuzz(programs, target, seed, amount, &target_directory().join("fuzz").join(target))
}

/// Starts with the corpus alone.
fn fuzz_from_corpus(programs: &Path, target: &str, seed: u32, amount: &str) -> io::Result<Output> {
    let inputs_found = target_directory().join("fuzz/fixed").join(target);
    empty_folder(&inputs_found)?;
    fuzz(programs, target, seed, amount, &inputs_found)
}

fn fuzz(programs: &Path, target: &str, seed: u32, amount: &str, inputs_found: &Path) -> io::Result<Output> {
    let failures = failures();
    fs::create_dir_all(inputs_found)?;
    fs::create_dir_all(&failures)?;
    let mut command = Command::new(programs.join(target));
    command.current_dir(root()).arg(inputs_found).arg(format!("verification/fuzz/corpus/{target}"));
    command.arg(format!("-artifact_prefix={}/{target}-", failures.display()));
    command.args([format!("-seed={seed}"), format!("-max_len={MAX_INPUT}"), amount.to_owned()]);
    // New inputs of another program would make two runs differ.
    command.args(["-reload=0", "-print_final_stats=1"]);
    command.output()
}

/// The folder for inputs that violate a rule.
fn failures() -> PathBuf {
    target_directory().join("fuzz/failures")
}

fn add_result(target: &str, output: &Output, trials: &mut Trials) {
    let printed = String::from_utf8_lossy(&output.stderr);
    let (name, number) =
        (format!("fuzz, {target}"), format!("{} executions", executions(&printed).unwrap_or(0)));
    if output.status.success() {
        trials.add(&name, &number, "none");
    } else {
        println!("{printed}");
        trials.fail(&name, &number, &format!("FAILED: see above, and {}", failures().display()));
    }
}

/// The number of executions that libFuzzer reports.
fn executions(output: &str) -> Option<u64> {
    let count = output.lines().find_map(|line| line.strip_prefix("stat::number_of_executed_units:"))?;
    count.trim().parse().ok()
}

/// A seed from the clock. It is never 0, because libFuzzer selects its own seed for 0.
fn random_seed() -> u32 {
    let time = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
    time.subsec_nanos() | 1
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_number_of_executions_is_read_from_its_line() {
        let output = "Done 12 runs\nstat::number_of_executed_units: 1393173\nstat::peak_rss_mb:   29\n";
        assert_eq!(executions(output), Some(1_393_173));
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
