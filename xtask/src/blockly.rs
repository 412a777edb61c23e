//! Blockly, the editor of block programs: fetched from the npm registry once, and checked.
//!
//! ```text
//!   registry.npmjs.org ──▶ target/blockly/blockly-13.3.0.tgz ──▶ checked ──▶ programs.js, with web/block-editor
//! ```

use std::collections::BTreeMap;
use std::fmt::Write;
use std::fs;
use std::io::Read;
use std::path::PathBuf;
use std::process::Command;

use base64::Engine;
use base64::prelude::BASE64_STANDARD;
use flate2::read::GzDecoder;
use sha2::{Digest, Sha512};

use crate::run::{TaskResult, root, target_directory};

/// Name, version and licence, for the list of licences of a release.
pub(crate) const NAME: &str = "Blockly 13.3.0 (npm): Apache-2.0";
const URL: &str = "https://registry.npmjs.org/blockly/-/blockly-13.3.0.tgz";
/// The SHA-512 of this version in base64, as the registry publishes it.
const INTEGRITY: &str =
    "qAHFGMGTSF67Lupr3pjZz9LQu4JCFdN76CMZxegBKiveZreK08yXhaCz0g9q9/xe5GEdoeFT3POAlQavPIRPEw==";
const CORE: &str = "blockly_compressed.js";
const BLOCKS: &str = "blocks_compressed.js";
const LICENCE: &str = "LICENSE";
/// The languages of the page, and Blockly's texts in them.
const TEXTS: [(&str, &str); 2] = [("en", "msg/en.js"), ("zh-CN", "msg/zh-hans.js")];
/// Pictures that styles name, with their types. They go into the styles, so that nothing is loaded for them.
const PICTURES: [(&str, &str); 3] = [
    ("handclosed.cur", "image/x-icon"),
    ("handdelete.cur", "image/x-icon"),
    ("sprites.svg", "image/svg+xml"),
];
/// Blockly's code for a style element. The policy of the page forbids such elements, so the styles go into a template element,
/// from which the editor reads them.
const STYLE: &str = "createElement(\"style\")";
const STYLE_TEXT: &str = "createElement(\"template\")";

/// The files of the package by their names.
struct Package(BTreeMap<String, Vec<u8>>);

/// The script of the editor: Blockly, its texts, the table of our blocks, and the code that connects them with the page.
pub(crate) fn script() -> TaskResult<String> {
    let package = Package::fetch()?;
    let mut script = package.core()?;
    script.push_str(&package.text(BLOCKS)?);
    script.push_str("\nvar blocklyTexts = {};\n");
    for (language, file) in TEXTS {
        let texts = package.text(file)?;
        // The file adds its texts to this `Blockly.Msg`.
        writeln!(
            script,
            "(function () {{ {texts} }}).call({{ Blockly: {{ Msg: blocklyTexts[\"{language}\"] = {{}} }} }});"
        )?;
    }
    let folder = root().join("web/block-editor");
    let table: serde_json::Value = serde_json::from_str(&fs::read_to_string(folder.join("blocks.json"))?)?;
    writeln!(script, "var blockTable = {table};\nBlockly.defineBlocksWithJsonArray(blockTable.blocks);")?;
    script.push_str(&fs::read_to_string(folder.join("editor.js"))?);
    Ok(script)
}

pub(crate) fn licence() -> TaskResult<String> {
    Package::fetch()?.text(LICENCE)
}

impl Package {
    fn fetch() -> TaskResult<Self> {
        let path = target_directory().join("blockly").join(URL.rsplit('/').next().unwrap_or_default());
        let bytes = match fs::read(&path) {
            Ok(bytes) if is_right(&bytes) => bytes,
            _ => download(&path)?,
        };
        let mut archive = tar::Archive::new(GzDecoder::new(bytes.as_slice()));
        let mut files = BTreeMap::new();
        for entry in archive.entries()? {
            let mut entry = entry?;
            let name = entry.path()?.strip_prefix("package")?.display().to_string();
            let mut content = Vec::new();
            entry.read_to_end(&mut content)?;
            files.insert(name, content);
        }
        Ok(Self(files))
    }

    fn bytes(&self, name: &str) -> TaskResult<&[u8]> {
        Ok(self.0.get(name).ok_or_else(|| format!("Blockly's package has no {name}"))?)
    }

    fn text(&self, name: &str) -> TaskResult<String> {
        Ok(String::from_utf8(self.bytes(name)?.to_vec())?)
    }

    /// Blockly without blocks, with two changes: it contains its pictures instead of loading them, and its style elements become
    /// template elements.
    fn core(&self) -> TaskResult<String> {
        let mut core = self.text(CORE)?;
        for (name, kind) in PICTURES {
            let picture = BASE64_STANDARD.encode(self.bytes(&format!("media/{name}"))?);
            core = core.replace(&format!("<<<PATH>>>/{name}"), &format!("data:{kind};base64,{picture}"));
        }
        if core.matches("<<<PATH>>>/").count() != 1 || core.matches(STYLE).count() != 2 {
            return Err("Blockly loads pictures or makes styles that `cargo xtask web` does not know".into());
        }
        Ok(core.replace(STYLE, STYLE_TEXT))
    }
}

fn download(path: &PathBuf) -> TaskResult<Vec<u8>> {
    println!("fetching {URL}");
    let mut curl = Command::new("curl");
    let output = curl
        .args(["--fail", "--silent", "--show-error", "--location", "--retry", "3", "--max-time", "300", URL])
        .output();
    let output = output.map_err(|why| format!("cannot start curl, which fetches {URL}: {why}"))?;
    if !output.status.success() {
        let why = String::from_utf8_lossy(&output.stderr);
        let place = path.display();
        return Err(format!(
            "cannot fetch Blockly from {URL}: {why}. Without a network, put the file at {place}"
        )
        .into());
    }
    if !is_right(&output.stdout) {
        return Err(format!("{URL} is not the file whose SHA-512 this program knows").into());
    }
    fs::create_dir_all(path.parent().ok_or("no folder")?)?;
    fs::write(path, &output.stdout)?;
    Ok(output.stdout)
}

fn is_right(bytes: &[u8]) -> bool {
    BASE64_STANDARD.encode(Sha512::digest(bytes)) == INTEGRITY
}
