//! Rebuilds the program when the embedded web page has changed.

use std::path::Path;

fn main() {
    // Cargo treats a missing path as changed in every build. So watch `web` until `web/dist` exists: creating `web/dist`
    // changes its parent.
    let page = if Path::new("../web/dist").exists() { "../web/dist" } else { "../web" };
    println!("cargo::rerun-if-changed={page}");
}
