//! Parts of protocol-core's tests, for other seeds and inputs.

#[path = "../../../protocol-core/tests/all/disturbed_line/mod.rs"]
pub(crate) mod disturbed_line;
#[path = "../../../protocol-core/tests/all/journal_world/mod.rs"]
pub(crate) mod journal_world;
#[path = "../../../protocol-core/tests/all/stream/mod.rs"]
pub(crate) mod stream;
