//! Feeds `torture::fuzz::image_file`.

#![no_main]

use libfuzzer_sys::fuzz_target;
use torture::fuzz::image_file::{Input, run};

fuzz_target!(|input: Input<'_>| run(&input));
