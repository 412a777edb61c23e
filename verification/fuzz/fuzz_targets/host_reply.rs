//! Feeds `torture::fuzz::host_reply`.

#![no_main]

use libfuzzer_sys::fuzz_target;
use torture::fuzz::host_reply::{Input, run};

fuzz_target!(|input: Input<'_>| run(&input));
