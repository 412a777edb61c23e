//! Feeds `torture::fuzz::deframer`.

#![no_main]

use libfuzzer_sys::fuzz_target;
use torture::fuzz::deframer::{Input, run};

fuzz_target!(|input: Input<'_>| run(&input));
