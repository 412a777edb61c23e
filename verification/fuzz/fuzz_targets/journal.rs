//! Feeds `torture::fuzz::journal`.

#![no_main]

use libfuzzer_sys::fuzz_target;
use torture::fuzz::journal::{Input, run};

fuzz_target!(|input: Input| run(&input));
