//! Feeds `torture::fuzz::register_ops`.

#![no_main]

use libfuzzer_sys::fuzz_target;
use torture::fuzz::register_ops::{Input, run};

fuzz_target!(|input: Input<'_>| run(&input));
