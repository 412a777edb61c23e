//! The page: as a folder for any web server, and as one file that a browser opens from a disk or a USB stick.

use std::env;
use std::fs;
use std::path::PathBuf;
use std::process::Command;

use base64::Engine;
use base64::prelude::BASE64_STANDARD;
use wasm_bindgen_cli_support::Bindgen;

use super::archive::{PackedFile, zip};
use super::platform::{build_directory, reproducible};
use super::release::Release;
use crate::run::{BROWSER, TaskResult, root, run_command};
use crate::web::{self, files};

/// Parts of `index.html` that the page in one file replaces.
const STYLE: &str = r#"<link rel="stylesheet" href="style.css">"#;
const SCRIPT: &str = r#"<script type="module" src="start.js"></script>"#;
const ICON: &str = r#"href="icon.svg""#;
const POLICY: &str = "default-src 'self'; script-src 'self' 'wasm-unsafe-eval'; img-src 'self' data:;";
/// The policy of the page in one file. A page from a disk may not load other files, so this page contains everything.
const OWN_POLICY: &str = "default-src 'none'; script-src 'unsafe-inline' 'wasm-unsafe-eval'; \
                          style-src 'unsafe-inline'; img-src data:;";
/// The element that holds the editor of block programs in the page in one file. The page in a folder loads the editor instead.
const EDITOR: [&str; 2] = ["<script type=\"text/plain\" id=\"programs\">", "</script>"];

/// The name of the page as a packed folder.
pub(super) fn folder_name(release: &Release) -> String {
    release.name("sevenbot-page", ".zip")
}

/// The name of the page as one file.
pub(super) fn file_name(release: &Release) -> String {
    release.name("sevenbot-page", ".html")
}

/// Builds the page in web/dist, which `sevenbot` contains.
pub(super) fn build(release: &Release) -> TaskResult {
    let mut web = Command::new(env::current_exe()?);
    reproducible(&mut web, release, BROWSER)?;
    run_command(web.arg("web"))
}

/// Writes both forms of the page that was built.
pub(super) fn write(release: &Release) -> TaskResult {
    let dist = root().join("web/dist");
    let mut packed = Vec::new();
    for path in files(&dist)? {
        let name = path.strip_prefix(&dist)?.display().to_string();
        packed.push(PackedFile::text(name, fs::read(&path)?).below("sevenbot-page"));
    }
    fs::write(release.path(&folder_name(release)), zip(&packed)?)?;
    Ok(fs::write(release.path(&file_name(release)), in_one_file()?)?)
}

/// The page as one file, which contains all files that the page loads.
fn in_one_file() -> TaskResult<String> {
    let read = |name: &str| fs::read_to_string(root().join("web/page").join(name));
    let mut page = read("index.html")?;
    let icon = format!(r#"href="data:image/svg+xml;base64,{}""#, BASE64_STANDARD.encode(read("icon.svg")?));
    let style = format!("<style>\n{}</style>", read("style.css")?);
    let script = format!("{}\n{}", editor()?, script()?);
    for (loaded, own) in [(POLICY, OWN_POLICY), (ICON, &icon), (STYLE, &style), (SCRIPT, &script)] {
        if page.matches(loaded).count() != 1 {
            return Err(format!("web/page/index.html does not contain `{loaded}` once").into());
        }
        page = page.replace(loaded, own);
    }
    Ok(page)
}

/// The editor of block programs as text. The page turns the text into a script when the editor is needed.
fn editor() -> TaskResult<String> {
    let [begin, end] = EDITOR;
    let code = fs::read_to_string(root().join("web/dist").join(web::EDITOR))?;
    // In strings of the script, the escaped forms mean the same, but do not end the element.
    let code = code.replace("</script", "<\\/script").replace("<!--", "<\\!--");
    Ok(format!("{begin}{code}{end}"))
}

/// The program of the page, with its module as text.
fn script() -> TaskResult<String> {
    let folder: PathBuf = build_directory().join("page");
    let mut bindgen = Bindgen::new();
    bindgen.input_path(web::module(&build_directory())).no_modules(true)?.remove_name_section(true);
    web::bindgen(&mut bindgen, &folder)?;
    let code = fs::read_to_string(folder.join("sevenbot_web.js"))?;
    let module = BASE64_STANDARD.encode(fs::read(folder.join("sevenbot_web_bg.wasm"))?);
    // Wait for the body, as a script of the type `module` does.
    Ok(format!(
        "<script>\n{code}\naddEventListener(\"DOMContentLoaded\", async () => {{\n  \
         const module = Uint8Array.from(atob(\"{module}\"), (letter) => letter.charCodeAt(0));\n  \
         await wasm_bindgen({{ module_or_path: module }});\n  wasm_bindgen.start();\n  window.sevenbot = wasm_bindgen;\n}});\n</script>"
    ))
}
