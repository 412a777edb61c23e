//! Feeds `torture::fuzz::controller`.

#![no_main]

use libfuzzer_sys::fuzz_target;
use torture::fuzz::controller::{Input, run};

fuzz_target!(|input: Input<'_>| run(&input));
