//! The picture of the crates and their dependencies in docs/design.md, drawn from `cargo metadata`.

use std::fmt::Write;

use crate::generated::{self, GeneratedFile};
use crate::run::TaskResult;
use crate::workspace::{self, Package};

/// The line before the picture.
const BEGIN: &str = "<!-- begin: made by `cargo xtask docs` from `cargo metadata` -->\n";

/// The name of a group, and its crates.
type Group = (&'static str, &'static [&'static str]);

/// Every crate belongs to one group.
const GROUPS: [Group; 3] = [
    (
        "product",
        &[
            "protocol-core",
            "motion-core",
            "kinematics",
            "arm-model",
            "arm-sim",
            "firmware-stm32",
            "tty-ports",
            "host-link",
            "host-sim",
            "sevenbot",
            "recording-formats",
            "sevenbot-cli",
            "classroom",
            "sevenbot-serve",
            "sevenbot-python",
            "sevenbot-web",
            "block-programs",
            "exercises",
        ],
    ),
    (
        "proof",
        &[
            "browser-tests",
            "emulator",
            "flash-model",
            "linked-image",
            "replay",
            "system-tests",
            "torture",
            "xtask",
        ],
    ),
    ("measurement", &["bench", "footprint", "peers"]),
];

/// The document with the picture. Fails if a crate belongs to no group.
pub(crate) fn files() -> TaskResult<Vec<GeneratedFile>> {
    generated::with_section("docs/design.md", BEGIN, &picture(&workspace::packages()?)?)
}

/// A flowchart in the language of Mermaid.
fn picture(packages: &[Package]) -> TaskResult<String> {
    let mut text = "```mermaid\nflowchart TD\n".to_owned();
    for (group, crates) in GROUPS {
        writeln!(text, "    subgraph {group}")?;
        for name in crates {
            let package = packages.iter().find(|package| package.name == *name);
            let folder = package.ok_or_else(|| format!("the workspace has no crate {name}"))?.folder()?;
            writeln!(text, "        {name}[\"{}\"]", folder.display())?;
        }
        writeln!(text, "    end")?;
    }
    for package in packages {
        if !GROUPS.iter().any(|(_, crates)| crates.contains(&package.name.as_str())) {
            Err(format!("{} belongs to no group of xtask/src/crate_graph.rs", package.name))?;
        }
        for used in package.uses() {
            writeln!(text, "    {} --> {used}", package.name)?;
        }
    }
    Ok(text + "```\n")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_crate_and_every_dependency_is_drawn() {
        let packages = workspace::packages().unwrap();
        let picture = picture(&packages).unwrap();
        for package in &packages {
            assert!(picture.contains(&format!("        {}[", package.name)), "{}", package.name);
        }
        assert!(picture.contains("    motion-core --> protocol-core\n"));
        assert!(!picture.contains("motion-core --> arm-sim"), "only its tests use it");
    }

    #[test]
    fn a_missing_crate_is_refused() {
        let packages = workspace::packages().unwrap();
        assert!(picture(packages.get(1..).unwrap()).is_err());
    }
}
