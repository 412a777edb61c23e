//! `cargo xtask docs`: writes and checks all generated files.

use std::fs;

use crate::generated::GeneratedFile;
use crate::run::{TaskResult, root};
use crate::{crate_graph, decisions, registers_md, ros_model};

const GENERATORS: [fn() -> TaskResult<Vec<GeneratedFile>>; 4] =
    [registers_md::files, ros_model::files, decisions::files, crate_graph::files];

pub(crate) fn write() -> TaskResult {
    for generate in GENERATORS {
        generate()?.into_iter().try_for_each(|(path, content)| fs::write(root().join(path), content))?;
    }
    Ok(())
}

/// Fails if a file differs from its generated content.
pub(crate) fn check() -> TaskResult {
    for (path, content) in
        GENERATORS.iter().map(|generate| generate()).collect::<TaskResult<Vec<_>>>()?.concat()
    {
        if fs::read(root().join(&path)).ok() != Some(content) {
            Err(format!("{path} is out of date: run `cargo xtask docs`"))?;
        }
        println!("{path} is up to date");
    }
    Ok(())
}
