//! What the fuzzer tries: each target makes something of its input, and panics where a rule does not hold.
//!
//! `verification/fuzz/` feeds them from the fuzzer. [`TARGETS`] feeds them from files, with no fuzzer and any compiler: so
//! the corpora are a test like any other.

use arbitrary::{Arbitrary, Unstructured};

pub mod controller;
pub mod deframer;
pub mod host_reply;
pub mod image_file;
pub mod journal;
pub mod register_ops;

/// A target by its name, and what tries the bytes of a corpus file on it.
pub type Target = (&'static str, fn(&[u8]));

/// All of them.
pub const TARGETS: [Target; 6] = [
    ("controller", |bytes| feed(bytes, |input| controller::run(&input))),
    ("deframer", |bytes| feed(bytes, |input| deframer::run(&input))),
    ("host_reply", |bytes| feed(bytes, |input| host_reply::run(&input))),
    ("image_file", |bytes| feed(bytes, |input| image_file::run(&input))),
    ("journal", |bytes| feed(bytes, |input| journal::run(&input))),
    ("register_ops", |bytes| feed(bytes, |input| register_ops::run(&input))),
];

/// Makes of the bytes what the fuzzer makes of them.
fn feed<'a, T: Arbitrary<'a>>(bytes: &'a [u8], run: impl FnOnce(T)) {
    if let Ok(input) = T::arbitrary_take_rest(Unstructured::new(bytes)) {
        run(input);
    }
}
