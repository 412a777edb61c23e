//! Programs of blocks: edits, stores, saves, opens, shares and runs them.

use block_programs::{Program, ProgramError, python};
use protocol_core::time::Instant;
use sevenbot::Snapshot;

use super::dom::set_attribute;
use super::editor::Editor;
use super::files;
use super::page::App;
use super::storage;
use crate::program::{ProgramProgress, ProgramRun, RunMode};
use crate::words;

/// The key of the program in the browser's storage.
const KEPT: &str = "program";

impl App {
    /// Carries out the action of a button. Returns false if the action does not belong to programs.
    pub(super) fn act_on_program(&mut self, action: &str) -> bool {
        match action {
            "programs" => self.toggle_programs(),
            "run" => self.run_program(RunMode::Running),
            "step" => self.run_program(RunMode::SingleSteps),
            "add-pose" => Editor.add_pose(self.client.state().angles().map(hundredths)),
            "save-program" => files::save(&self.dom, "program.json", &self.programs.text),
            "save-python" => {
                if let Some(python) = self.python() {
                    files::save(&self.dom, "program.py", &python);
                }
            }
            "copy-python" => {
                if let Some(python) = self.python() {
                    Editor.copy(&python);
                }
            }
            "share" => self.share(),
            _ => return false,
        }
        true
    }

    pub(super) fn toggle_programs(&mut self) {
        self.programs.is_open = !self.programs.is_open;
        let is_open = self.programs.is_open;
        self.dom.set_hidden("program", !is_open);
        for main in self.dom.all("main") {
            set_attribute(&main, "class", if is_open { "programming" } else { "" });
        }
        for button in self.dom.all("[data-action=programs]") {
            set_attribute(&button, "aria-pressed", if is_open { "true" } else { "false" });
        }
        if is_open && Editor.load(&self.dom, Self::show_editor, Self::say_that_there_is_no_editor).is_err() {
            self.say_that_there_is_no_editor();
        }
    }

    fn say_that_there_is_no_editor(&mut self) {
        self.dom.notice(self.language.text("no-editor"));
    }

    /// Shows the editor after it was loaded, with the stored program. The program of the page's address, or the program in
    /// `Programs::wanted`, replaces the stored one.
    fn show_editor(&mut self) {
        let Some(element) = self.dom.element("blocks") else { return };
        Editor.open(&element, self.language.tag(), Self::program_changed);
        if let Some(kept) = storage::load(KEPT) {
            Editor.show(&kept, false);
        }
        self.program_changed();
        self.open_link();
        if let Some(wanted) = self.programs.wanted.take() {
            self.open_program(wanted);
        }
    }

    /// Opens the panel of programs with this program. The user can undo the replacement of the old program.
    pub(super) fn show_in_editor(&mut self, text: String) {
        if !self.programs.is_open {
            self.toggle_programs();
        }
        if Editor.is_loaded() {
            self.open_program(text);
        } else {
            self.programs.wanted = Some(text);
        }
    }

    /// Shows the editor in the language of the page.
    pub(super) fn translate_editor(&mut self) {
        if let Some(element) = self.dom.element("blocks") {
            Editor.open(&element, self.language.tag(), Self::program_changed);
            self.programs.lit.clear();
            self.program_changed();
        }
    }

    /// Handles a change of the program: stores it, and shows it as Python, or shows its fault.
    fn program_changed(&mut self) {
        let Some(text) = Editor.text() else { return };
        storage::save(KEPT, &text);
        if text != self.programs.text {
            self.programs.ended = None;
            self.end_preview();
            self.dom.set_hidden("link-row", true);
            Editor.warn(None, "");
        }
        self.programs.text = text;
        let shown = match Program::parse(&self.programs.text) {
            Ok(program) => python(&program),
            Err(error) => format!("# {}\n", words::program_fault(self.language, &error.fault)),
        };
        self.dom.set_text("python", &shown);
    }

    /// The program as Python. If the program has a fault, shows it and returns `None`.
    fn python(&self) -> Option<String> {
        match Program::parse(&self.programs.text) {
            Ok(program) => Some(python(&program)),
            Err(error) => {
                self.show_program_error(&error);
                None
            }
        }
    }

    pub(super) fn show_program_error(&self, error: &ProgramError) {
        let text = words::program_fault(self.language, &error.fault);
        Editor.warn(error.block.as_deref(), &text);
        self.dom.notice(&text);
    }

    /// Begins the program, or continues the running one in this mode.
    fn run_program(&mut self, mode: RunMode) {
        if let Some(run) = &mut self.programs.run {
            run.go_on(mode);
            return self.show_time_line(None);
        }
        if self.is_stopping() {
            return;
        }
        match Program::parse(&self.programs.text) {
            Err(error) => self.show_program_error(&error),
            Ok(program) => {
                self.show_time_line(None);
                let before = self.registers_before_movement();
                let now = self.now();
                self.programs.run = Some(ProgramRun::new(&program, mode, &before, now));
                self.programs.ended = None;
                Editor.warn(None, "");
                self.dom.end_notice();
            }
        }
    }

    /// Continues the running program. If it fails, shows the reason at its block and as a notice.
    pub(super) fn run_on(&mut self, now: Instant) {
        let Some(run) = &mut self.programs.run else { return };
        let failure = match run.poll(now, &mut self.client) {
            ProgramProgress::Running | ProgramProgress::Waiting => return,
            ProgramProgress::Over => None,
            ProgramProgress::Failed(failure) => Some(failure),
        };
        let run = self.programs.run.take();
        self.programs.ended = Some(if failure.is_some() { "program-ended" } else { "program-over" });
        if let Some(failure) = failure {
            let text = words::program_failure(self.language, &failure);
            let block = failure.block().or(run.as_ref().and_then(ProgramRun::block));
            Editor.warn(block.map(|block| &**block), &text);
            self.dom.notice(&text);
        }
    }

    /// Lights the block of the running program or of the time line, and shows the state of the program.
    pub(super) fn show_program(&mut self) {
        let running = self.programs.run.as_ref().and_then(ProgramRun::block).map(ToString::to_string);
        let lit = running.or_else(|| self.time_lines.block()).unwrap_or_default();
        if lit != self.programs.lit {
            Editor.light(Some(lit.as_str()).filter(|lit| !lit.is_empty()));
            self.programs.lit = lit;
        }
        let doing = match &self.programs.run {
            Some(run) if run.is_waiting() => Some("program-waits"),
            Some(_) => Some("program-runs"),
            None => self.programs.ended,
        };
        self.dom.set_text("program-state", doing.map_or("", |name| self.language.text(name)));
    }

    /// Ends the running program, because something else is about to move the arm. Returns the registers from before the program;
    /// `None` if no program runs.
    pub(super) fn end_program(&mut self) -> Option<Snapshot> {
        let (run, now) = (self.programs.run.take()?, self.now());
        let before = run.before().clone();
        run.end(now, &mut self.client);
        self.programs.ended = Some("program-ended");
        Some(before)
    }

    /// Stops the arm and ends the program, if one runs. Returns whether one ran.
    pub(super) fn stop_program(&mut self, now: Instant) -> bool {
        let Some(run) = self.programs.run.take() else { return false };
        run.stop(now, &mut self.client);
        self.programs.ended = Some("program-ended");
        true
    }

    /// Opens the text of a program, from a file, a link or a solution.
    pub(super) fn open_program(&mut self, text: String) {
        if let Err(error) = Program::parse(&text) {
            return self.show_program_error(&ProgramError { block: None, ..error });
        }
        let why = Editor.show(&text, true);
        if why.is_empty() {
            self.dom.end_notice();
            self.program_changed();
        } else {
            self.dom.notice(&format!("{} {why}", self.language.text("no-program")));
        }
    }
}

/// Rounds to two decimals, as a block shows an angle.
fn hundredths(degrees: f32) -> f64 {
    (f64::from(degrees) * 100.0).round() / 100.0
}
