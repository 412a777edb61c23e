//! The program is built again when the page in it has changed.

use std::path::Path;

fn main() {
    // A missing folder would count as changed in each build. web/dist changes its parent when it is made.
    let page = if Path::new("../web/dist").exists() { "../web/dist" } else { "../web" };
    println!("cargo::rerun-if-changed={page}");
}
