//! Programs of blocks: edited, kept over a reload, saved, opened, shared by a link, and run.

use block_programs::{Program, ProgramError, python};
use protocol_core::time::Instant;
use sevenbot::Snapshot;

use super::dom::set_attribute;
use super::editor::Editor;
use super::files;
use super::page::App;
use super::storage;
use crate::program::{Pace, ProgramProgress, ProgramRun};
use crate::words;

/// The name of the program in the browser's storage.
const KEPT: &str = "program";

impl App {
    /// Does what a button asks for. Returns whether it is one of programs.
    pub(super) fn act_on_program(&mut self, action: &str) -> bool {
        match action {
            "programs" => self.toggle_programs(),
            "run" => self.run_program(Pace::Running),
            "step" => self.run_program(Pace::SingleSteps),
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

    /// The editor is there: shows it with the program of before, or with that of the address.
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

    /// Opens the view of programs with this program. Undo brings the last one back.
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

    /// The editor in another language.
    pub(super) fn translate_editor(&mut self) {
        if let Some(element) = self.dom.element("blocks") {
            Editor.open(&element, self.language.tag(), Self::program_changed);
            self.programs.lit.clear();
            self.program_changed();
        }
    }

    /// Keeps the program, and shows it as Python or says what is missing.
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

    /// The program as Python; says why there is none.
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

    /// Begins the program, or goes on with it.
    fn run_program(&mut self, pace: Pace) {
        if let Some(run) = &mut self.programs.run {
            run.go_on(pace);
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
                self.programs.run = Some(ProgramRun::new(&program, pace, &before, now));
                self.programs.ended = None;
                Editor.warn(None, "");
                self.dom.end_notice();
            }
        }
    }

    /// Goes on with the program.
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

    /// Lights the block that runs, and says what the program does.
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

    /// Ends the program because something else moves the arm. Returns the registers before it.
    pub(super) fn end_program(&mut self) -> Option<Snapshot> {
        let (run, now) = (self.programs.run.take()?, self.now());
        let before = run.before().clone();
        run.end(now, &mut self.client);
        self.programs.ended = Some("program-ended");
        Some(before)
    }

    /// Stops the arm if a program runs. Returns whether one did.
    pub(super) fn stop_program(&mut self, now: Instant) -> bool {
        let Some(run) = self.programs.run.take() else { return false };
        run.stop(now, &mut self.client);
        self.programs.ended = Some("program-ended");
        true
    }

    /// A file with a program was opened.
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

/// To two decimals, as a block shows it.
fn hundredths(degrees: f32) -> f64 {
    (f64::from(degrees) * 100.0).round() / 100.0
}
