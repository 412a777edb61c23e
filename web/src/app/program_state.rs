//! What the page has of programs.

use crate::program::ProgramRun;

/// The program in the editor, and the one that runs.
#[derive(Default)]
pub(super) struct Programs {
    pub(super) run: Option<ProgramRun>,
    pub(super) is_open: bool,
    /// The program in the editor.
    pub(super) text: String,
    /// The program that is to be shown when the editor is there.
    pub(super) wanted: Option<String>,
    /// The block that is lit.
    pub(super) lit: String,
    /// The name of the text that says how the last run ended.
    pub(super) ended: Option<&'static str>,
}
