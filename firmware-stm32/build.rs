//! Passes the linker scripts to the linker: `memory.x` from the root of the workspace, `link.x` of cortex-m-rt, `defmt.x`.
//! The flags apply only to this package, so they are here and not in `.cargo/config.toml`.

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
