//! The fuzz targets. Each runs its input and panics if an invariant is violated.
//!
//! `verification/fuzz/` passes the inputs of the fuzzer. A test passes the files of the corpora to the functions in
//! [`TARGETS`], without a fuzzer and with any compiler.

use arbitrary::{Arbitrary, Unstructured};

pub mod controller;
pub mod deframer;
pub mod host_reply;
pub mod image_file;
pub mod journal;
pub mod register_ops;

/// The name of a target, and a function that runs the bytes of a corpus file.
pub type Target = (&'static str, fn(&[u8]));

/// All targets. The name of each is also that of its corpus in `verification/fuzz/corpus/`.
pub const TARGETS: [Target; 6] = [
    ("controller", |bytes| feed(bytes, |input| controller::run(&input))),
    ("deframer", |bytes| feed(bytes, |input| deframer::run(&input))),
    ("host_reply", |bytes| feed(bytes, |input| host_reply::run(&input))),
    ("image_file", |bytes| feed(bytes, |input| image_file::run(&input))),
    ("journal", |bytes| feed(bytes, |input| journal::run(&input))),
    ("register_ops", |bytes| feed(bytes, |input| register_ops::run(&input))),
];

/// Makes the input from the bytes in the same way as the fuzzer.
fn feed<'a, T: Arbitrary<'a>>(bytes: &'a [u8], run: impl FnOnce(T)) {
    if let Ok(input) = T::arbitrary_take_rest(Unstructured::new(bytes)) {
        run(input);
    }
}
