//! Parts of the tests of protocol-core and motion-core, for other seeds and inputs.

#[path = "../../../protocol-core/tests/all/disturbed_line/mod.rs"]
pub(crate) mod disturbed_line;
#[path = "../../../motion-core/tests/all/free_moves/mod.rs"]
pub(crate) mod free_moves;
#[path = "../../../protocol-core/tests/all/journal_world/mod.rs"]
pub(crate) mod journal_world;
#[path = "../../../protocol-core/tests/all/stream/mod.rs"]
pub(crate) mod stream;
