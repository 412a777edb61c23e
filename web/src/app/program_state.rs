//! The state of the page for programs.

use crate::program::ProgramRun;

/// The program in the editor, and the one that runs.
#[derive(Default)]
pub(super) struct Programs {
    pub(super) run: Option<ProgramRun>,
    pub(super) is_open: bool,
    /// The program in the editor, as the JSON of a Blockly workspace.
    pub(super) text: String,
    /// The program to open when the editor is loaded.
    pub(super) wanted: Option<String>,
    /// The id of the lit block; empty if no block is lit.
    pub(super) lit: String,
    /// The name of the text that says how the last run ended; `None` before a run and after an edit.
    pub(super) ended: Option<&'static str>,
}
