//! The page in a browser: as one file from the disk, and as a folder under a path of a web server.

use std::fs;
use std::io::Write;
use std::path::Path;
use std::process::{Command, Stdio};

use base64::Engine;
use base64::prelude::BASE64_URL_SAFE_NO_PAD;
use flate2::Compression;
use flate2::write::DeflateEncoder;
use tempfile::TempDir;

use crate::dist::page::{file_name, folder_name};
use crate::dist::release::Release;
use crate::run::{ChildProcess, TaskResult, run_command, wait_for};

/// Serves a folder at a free port, and writes the port to a file.
const SERVER: &str = "
import functools, http.server, sys
handler = functools.partial(http.server.SimpleHTTPRequestHandler, directory=sys.argv[1])
server = http.server.ThreadingHTTPServer(('127.0.0.1', 0), handler)
open(sys.argv[2], 'w').write(f'{server.server_port}\\n')
server.serve_forever()
";
/// A program with one block after its start, and the text of this block in Python.
const PROGRAM: &str = r#"{"blocks": {"blocks": [{"type": "arm_start", "id": "a", "next": {"block":
    {"type": "arm_vacuum", "id": "b", "fields": {"STATE": "ON"}}}}]}}"#;
const PYTHON: &str = "arm.set(\"vacuum-pump\", 1)";
/// The page has drawn its joints when it contains this text at least seven times. The slider of the time line counts, too.
const SLIDER: &str = "type=\"range\"";
const JOINTS: usize = 7;

/// Opens both forms of the page.
pub(super) fn both(release: &Release) -> TaskResult {
    shows_joints(&format!("file://{}", fs::canonicalize(release.path(&file_name(release)))?.display()))?;
    let folder = TempDir::new()?;
    let below = folder.path().join("any/path");
    let mut unzip = Command::new("python3");
    unzip.args(["-m", "zipfile", "-e"]).arg(release.path(&folder_name(release)));
    run_command(unzip.arg(&below))?;
    let (_server, port) = serve(folder.path())?;
    shows_joints(&format!("http://127.0.0.1:{port}/any/path/sevenbot-page/"))
}

fn serve(folder: &Path) -> TaskResult<(ChildProcess, u16)> {
    let note = folder.join("port.txt");
    let mut python = Command::new("python3");
    python.args(["-c", SERVER]).arg(folder).arg(&note).stderr(Stdio::null());
    let server = ChildProcess(python.spawn()?);
    let port = wait_for("the port of the web server", || {
        Ok(fs::read_to_string(&note).ok().and_then(|text| text.strip_suffix('\n')?.parse().ok()))
    })?;
    Ok((server, port))
}

/// The address of the page with a program in it, as the page makes it.
fn with_program(address: &str) -> TaskResult<String> {
    let mut encoder = DeflateEncoder::new(Vec::new(), Compression::best());
    encoder.write_all(PROGRAM.as_bytes())?;
    Ok(format!("{address}#program={}", BASE64_URL_SAFE_NO_PAD.encode(encoder.finish()?)))
}

/// Checks that the page at this address starts, and that it shows the joints and the program in its address.
fn shows_joints(address: &str) -> TaskResult {
    let profile = TempDir::new()?;
    let mut browser = Command::new("chromium");
    browser.args(["--headless", "--no-sandbox", "--enable-unsafe-swiftshader", "--disable-dev-shm-usage"]);
    browser.arg(format!("--user-data-dir={}", profile.path().display()));
    // The budget is virtual time of the page, not real time.
    browser
        .args(["--virtual-time-budget=20000", "--dump-dom", &with_program(address)?])
        .stderr(Stdio::null());
    let page = String::from_utf8(browser.output()?.stdout)?;
    let joints = page.matches(SLIDER).count();
    if joints < JOINTS {
        return Err(format!("{address}: the page shows {joints} joints:\n{page}").into());
    }
    if !page.contains(PYTHON) || !page.contains("blocklyBlockCanvas") {
        return Err(format!("{address}: the page does not show the program of its address:\n{page}").into());
    }
    println!("{address}: the page shows its joints and a program");
    Ok(())
}
