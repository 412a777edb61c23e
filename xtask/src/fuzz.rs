//! `cargo xtask fuzz`: inputs that a fuzzer makes up, for so long each target.
//!
//! Begins with the corpora of the repository. What it finds beyond them stays under `target/fuzz`, where the
//! next run goes on from. Knows nothing of what the targets try: `fuzz/README.md` does.

use std::fs;
use std::process::{Command, Stdio};

use clap::Args;

use crate::run::{Outcome, root, run};
use crate::table::Table;

/// The programs of `fuzz/`.
const TARGETS: [&str; 6] = ["controller", "deframer", "host_reply", "image_file", "journal", "register_ops"];
/// Bytes of an input, at most.
const LONGEST: usize = 512;
/// What a run needs.
const HOW_TO_GET_IT: &str =
    "`rustup toolchain install nightly --profile minimal` and `cargo install cargo-fuzz --locked` bring it";

/// For how long, and from where.
#[derive(Args)]
pub(crate) struct Options {
    /// Seconds for each of the six targets
    #[arg(long, default_value_t = 60)]
    pub(crate) seconds: u64,
    /// Where the fuzzer's chance begins
    #[arg(long, default_value_t = 1)]
    pub(crate) seed: u64,
}

/// Are the nightly compiler and cargo-fuzz here?
pub(crate) fn is_installed() -> bool {
    let works = |words: &str| {
        let program =
            Command::new("cargo").args(words.split(' ')).stdout(Stdio::null()).stderr(Stdio::null()).status();
        program.is_ok_and(|status| status.success())
    };
    works("+nightly --version") && works("+nightly fuzz --version")
}

/// Fuzzes every target, and prints the table.
pub(crate) fn check(options: &Options) -> Outcome {
    let mut table = Table::default();
    all(options, &mut table)?;
    table.finish(options.seed)
}

/// Likewise, into a table. Without its tools that is a row, and no failure.
pub(crate) fn all(options: &Options, table: &mut Table) -> Outcome {
    if !is_installed() {
        table.add(
            "fuzz",
            "0 executions",
            &format!("skipped, nightly or cargo-fuzz is missing: {HOW_TO_GET_IT}"),
        );
        return Ok(());
    }
    run("cargo", "+nightly fuzz build -s none", &[])?;
    TARGETS.into_iter().try_for_each(|target| one(target, options, table))
}

fn one(target: &str, options: &Options, table: &mut Table) -> Outcome {
    let Options { seconds, seed } = options;
    let found = format!("target/fuzz/{target}");
    fs::create_dir_all(root().join(&found))?;
    let words = format!(
        "+nightly fuzz run -s none {target} {found} fuzz/corpus/{target} -- -seed={seed} -max_len={LONGEST} \
         -max_total_time={seconds} -print_final_stats=1"
    );
    println!("{target}, {seconds} s");
    let output = Command::new("cargo").args(words.split_whitespace()).current_dir(root()).output()?;
    let said = String::from_utf8_lossy(&output.stderr);
    let many = format!("{} executions", executions(&said).unwrap_or(0));
    if output.status.success() {
        table.add(&format!("fuzz, {target}"), &many, "nothing");
    } else {
        println!("{said}");
        table.fail(&format!("fuzz, {target}"), &many, "FAILED: see above");
    }
    Ok(())
}

/// What libFuzzer counted.
fn executions(said: &str) -> Option<u64> {
    let count = said.lines().find_map(|line| line.strip_prefix("stat::number_of_executed_units:"))?;
    count.trim().parse().ok()
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
        for target in TARGETS {
            assert!(root().join(format!("fuzz/fuzz_targets/{target}.rs")).exists(), "{target}");
            assert!(root().join(format!("fuzz/corpus/{target}")).is_dir(), "{target}");
        }
    }
}
