//! `cargo xtask deny`: what may come in with a dependency. The rules are in `deny.toml`.
//!
//! Knows nothing of the rules. The advisories' database is a git repository somewhere else: where it is out of
//! reach, that is said and is no failure.

use std::process::{Command, Stdio};

use crate::run::{Outcome, cargo, root};

fn works(words: &str) -> bool {
    let mut program = Command::new("cargo");
    program.args(words.split(' ')).current_dir(root()).stdout(Stdio::null()).stderr(Stdio::null());
    program.status().is_ok_and(|status| status.success())
}

/// Licences, versions and sources. Says so where cargo-deny is missing.
pub(crate) fn rules() -> Outcome {
    if works("deny --version") {
        cargo("deny --log-level error check bans licenses sources")
    } else {
        println!("skipped: `cargo install cargo-deny --locked` brings what is missing");
        Ok(())
    }
}

/// Likewise, and the advisories.
pub(crate) fn check() -> Outcome {
    rules()?;
    if works("deny fetch db") {
        cargo("deny check --disable-fetch advisories")
    } else {
        println!("advisories: NOT CHECKED, their database is out of reach");
        Ok(())
    }
}
