//! `cargo xtask replays`: recorded sessions are the same natively and in a WebAssembly module, and so are their replays.

use crate::run::{BROWSER, TaskResult, cargo, run, target_directory};

/// 50 sessions, each replayed twice.
pub(crate) fn short() -> TaskResult {
    compare(50, 2)
}

/// 1000 sessions, each replayed ten times.
pub(crate) fn long() -> TaskResult {
    compare(1_000, 10)
}

fn compare(sessions: u32, times: u32) -> TaskResult {
    run("rustup", &format!("--quiet target add {BROWSER}"), &[])?;
    cargo(&format!("build --quiet --release --package replay --lib --target {BROWSER}"))?;
    let module = target_directory().join(BROWSER).join("release/replay.wasm");
    let options = format!("--sessions {sessions} --times {times} --module {}", module.display());
    cargo(&format!("run --quiet --release --package replay -- {options}"))
}
