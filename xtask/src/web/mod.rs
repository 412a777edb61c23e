//! `cargo xtask web`: the page in web/dist.
//!
//! ```text
//!   web/src  ── cargo ──▶ sevenbot_web.wasm ── wasm-bindgen ──▶ web/dist/sevenbot_web.js, sevenbot_web_bg.wasm
//!                                                                  └── split ──▶ web/dist/rest.wasm
//!   web/page ─────────────────────── copy ──▶ web/dist
//!   Blockly, web/block-editor ──────────────▶ web/dist/programs.js, which the page loads when programs are opened
//! ```
//!
//! wasm-bindgen is a library here, at exactly the version of the crate that the page is linked with. So no other program has
//! to be installed.

mod split;

use std::fs;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::Command;

use flate2::Compression;
use flate2::write::GzEncoder;
use torture::text_table::Column::{Left, Right};
use torture::text_table::TextTable;
use wasm_bindgen_cli_support::Bindgen;

use crate::blockly;
use crate::budget::{self, Figure};
use crate::run::{BROWSER, TaskResult, cargo, empty_folder, root, run, target_directory};

/// The profile of the page's module.
const PROFILE: &str = "web";
/// The editor of block programs. The first view does not load it.
pub(crate) const EDITOR: &str = "programs.js";
/// How the names of the files of the teacher's screen begin. It is another view, so these files are not part of the first view.
const TEACHER: &str = "teacher.";
/// The part of the module that the page loads after its first picture.
const REST: &str = "rest.wasm";

/// Builds the page, prints its size and compares it with its budget.
pub(crate) fn build() -> TaskResult {
    run("rustup", &format!("--quiet target add {BROWSER}"), &[])?;
    cargo(&format!("build --quiet --package sevenbot-web --lib --target {BROWSER} --profile {PROFILE}"))?;
    let dist = root().join("web/dist");
    empty_folder(&dist)?;
    copy_folder(&root().join("web/page"), &dist)?;
    bindgen(Bindgen::new().input_path(module(&target_directory())).web(true)?, &dist)?;
    split_module(&dist)?;
    fs::write(dist.join(EDITOR), blockly::script()?)?;
    let sizes = print_sizes(&dist)?;
    let all = sizes.iter().map(|(_, size)| size).sum();
    let is_first = |name: &str| name != EDITOR && name != REST && !name.starts_with(TEACHER);
    let first = sizes.iter().filter(|(name, _)| is_first(name)).map(|(_, size)| size).sum();
    let figures = [("page: first view with gzip, bytes", first), ("page: all files with gzip, bytes", all)];
    budget::check("web", &figures.map(|(name, size)| Figure::new(name, size)), false)
}

/// Leaves the functions that the first view needs in the module of the page, and puts the rest beside it.
fn split_module(dist: &Path) -> TaskResult {
    let module = dist.join("sevenbot_web_bg.wasm");
    let parts = split::split(&fs::read(&module)?)?;
    fs::write(module, parts.first)?;
    Ok(fs::write(dist.join(REST), parts.rest)?)
}

/// The page's module in a target directory of cargo.
pub(crate) fn module(target_directory: &Path) -> PathBuf {
    target_directory.join(BROWSER).join(PROFILE).join("sevenbot_web.wasm")
}

/// Writes the module of the page for browsers, and the script that loads it. The functions keep their names, by which
/// [`split`] chooses, unless `bindgen` is set to remove them.
pub(crate) fn bindgen(bindgen: &mut Bindgen, folder: &Path) -> TaskResult {
    let bindgen = bindgen.remove_producers_section(true).typescript(false);
    Ok(bindgen.generate(folder).map_err(|why| format!("wasm-bindgen: {why:#}"))?)
}

/// Builds the page, then runs `sevenbot view`, which contains it.
pub(crate) fn view(arguments: &[String]) -> TaskResult {
    build()?;
    let mut cargo = Command::new("cargo");
    cargo.args(["run", "--quiet", "--release", "--package", "sevenbot-cli", "--", "view"]).args(arguments);
    let status = cargo.status()?;
    if status.success() { Ok(()) } else { Err("`sevenbot view` failed".into()) }
}

fn copy_folder(from: &Path, to: &Path) -> TaskResult {
    fs::create_dir_all(to)?;
    for entry in fs::read_dir(from)? {
        let (path, copy) = (entry?.path(), |name: &Path| to.join(name));
        let name = PathBuf::from(path.file_name().unwrap_or_default());
        if path.is_dir() {
            copy_folder(&path, &copy(&name))?;
        } else {
            fs::copy(&path, copy(&name))?;
        }
    }
    Ok(())
}

/// Prints the size of each file. Returns the names and the sizes with gzip, in bytes.
fn print_sizes(dist: &Path) -> TaskResult<Vec<(String, u64)>> {
    let mut table = TextTable::new([Right("bytes"), Right("gzip"), Left("file")]);
    let mut sizes = Vec::new();
    for path in files(dist)? {
        let bytes = fs::read(&path)?;
        let compressed = compressed_size(&bytes)?;
        let name = path.strip_prefix(dist)?.display().to_string();
        table.add([bytes.len().to_string(), compressed.to_string(), name.clone()]);
        sizes.push((name, compressed));
    }
    println!("{table}");
    Ok(sizes)
}

/// All files below a folder, in the order of their names.
pub(crate) fn files(folder: &Path) -> TaskResult<Vec<PathBuf>> {
    let mut found = Vec::new();
    for entry in fs::read_dir(folder)? {
        let path = entry?.path();
        if path.is_dir() { found.extend(files(&path)?) } else { found.push(path) }
    }
    found.sort();
    Ok(found)
}

fn compressed_size(bytes: &[u8]) -> TaskResult<u64> {
    let mut encoder = GzEncoder::new(Vec::new(), Compression::best());
    encoder.write_all(bytes)?;
    Ok(u64::try_from(encoder.finish()?.len())?)
}
