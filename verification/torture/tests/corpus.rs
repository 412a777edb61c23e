//! Runs every input of the fuzz corpora without a fuzzer.

#![allow(clippy::panic, clippy::unwrap_used)] // A panic is a failed test.

use std::fs;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::{Path, PathBuf};

use torture::fuzz::TARGETS;

fn corpus(target: &str) -> Vec<PathBuf> {
    let directory = Path::new(env!("CARGO_MANIFEST_DIR")).join("../fuzz/corpus").join(target);
    let entries = fs::read_dir(&directory).unwrap_or_else(|why| panic!("{}: {why}", directory.display()));
    let mut files: Vec<_> = entries.map(|entry| entry.unwrap().path()).collect();
    files.sort();
    files
}

#[test]
fn no_input_of_the_corpora_violates_a_rule() {
    for (target, run) in TARGETS {
        let files = corpus(target);
        assert!(files.len() >= 20, "the corpus of {target} has {} inputs", files.len());
        for file in &files {
            let bytes = fs::read(file).unwrap();
            catch_unwind(AssertUnwindSafe(|| run(&bytes)))
                .unwrap_or_else(|_| panic!("{target} fails on {}", file.display()));
        }
        println!("{target}: {} inputs", files.len());
    }
}
