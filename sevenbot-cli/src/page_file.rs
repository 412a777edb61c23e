//! The files of the page, which are part of this program.

use std::borrow::Cow;

use rust_embed::RustEmbed;

use crate::command_error::CommandError;

/// The page, if `cargo xtask web` had built it before this program was built.
#[derive(RustEmbed)]
#[folder = "../web/dist"]
#[allow_missing = true]
struct PageFile;

/// A file by its path below the root, such as `index.html`.
pub(crate) fn find(path: &str) -> Option<Cow<'static, [u8]>> {
    PageFile::get(path).map(|file| file.data)
}

/// Fails if this program has no page.
pub(crate) fn check() -> Result<(), CommandError> {
    let missing =
        "this program was built without the page: in the project's folder, `cargo view` builds and opens it";
    find("index.html").map(drop).ok_or_else(|| CommandError::Usage(missing.to_owned()))
}
