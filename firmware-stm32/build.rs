//! Tells the linker where things go: `memory.x` at the root of the workspace, and the scripts of cortex-m-rt
//! and defmt. Only the image is linked that way, so the flags stand here and not in `.cargo/config.toml`.

use std::path::PathBuf;
use std::{env, fs, io};

const MEMORY: &str = "../memory.x";

fn main() -> io::Result<()> {
    println!("cargo:rerun-if-changed={MEMORY}");
    println!("cargo:rerun-if-changed=build.rs");
    if env::var_os("CARGO_CFG_TARGET_OS").is_none_or(|os| os != "none") {
        return Ok(());
    }
    let out = PathBuf::from(env::var_os("OUT_DIR").ok_or(io::ErrorKind::NotFound)?);
    fs::copy(MEMORY, out.join("memory.x"))?;
    println!("cargo:rustc-link-search={}", out.display());
    for argument in ["-Tlink.x", "-Tdefmt.x", "--nmagic"] {
        println!("cargo:rustc-link-arg-bins={argument}");
    }
    Ok(())
}
