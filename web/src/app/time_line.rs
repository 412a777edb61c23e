//! The time line below the picture: a slider to browse a recording, or the preview of a program. The ghost in the picture shows
//! the arm at the chosen moment. The arm itself does not move.

use std::time::Duration;

use block_programs::Program;
use sevenbot::map::motor_state;
use sevenbot::recording::Recording;
use web_sys::HtmlInputElement;

use super::dom::{number, set_attribute};
use super::page::{App, ArmLine, browser_now};
use super::time_line_state::TimeLines;
use crate::preview::{Preview, PreviewEnd};
use crate::time_line::TimeLine;
use crate::words;

/// The step of the slider, in seconds: the same as in index.html.
const STEP: f64 = 0.05;
/// The name of the text of the notice while a preview runs.
const PREVIEW_RUNS: &str = "preview-runs";

impl App {
    /// Carries out the action of a button. Returns false if the action does not belong to time lines.
    pub(super) fn act_on_time_line(&mut self, action: &str) -> bool {
        match action {
            "preview" => self.begin_preview(),
            "look" => self.look_through_recording(),
            "close-time-line" => self.show_time_line(None),
            _ => return false,
        }
        true
    }

    fn begin_preview(&mut self) {
        if let Some(why) = self.no_preview() {
            return self.dom.notice(self.language.text(why));
        }
        let program = match Program::parse(&self.programs.text) {
            Err(error) => return self.show_program_error(&error),
            Ok(program) => program,
        };
        self.show_time_line(None);
        let preview = match &self.line {
            ArmLine::Simulated(arm) => Some(Preview::on_copy_of(arm, &program)),
            ArmLine::Remote(_) => Preview::on_new_arm(self.client.registers(), &program),
        };
        let text = if preview.is_some() { PREVIEW_RUNS } else { "preview-elsewhere" };
        self.dom.notice(self.language.text(text));
        self.time_lines.preview = preview;
    }

    /// The name of the text that says why no preview can begin now: there is no answer yet, the arm moves, its motors are off or
    /// damped, or a servo is silent. `None` if a preview can begin.
    fn no_preview(&self) -> Option<&'static str> {
        let is_busy = self.player.is_some() || self.park.is_some() || self.programs.run.is_some();
        let state = self.client.state();
        match self.client.rounds() {
            0 => Some("connecting"),
            _ if is_busy || state.moving != 0 => Some("preview-busy"),
            _ if state.motor_state != motor_state::SERVO => Some("motors-are-off"),
            _ if state.missing != 0 => Some("preview-missing"),
            _ => None,
        }
    }

    /// Hides the preview, because the program has changed.
    pub(super) fn end_preview(&mut self) {
        if self.time_lines.preview.is_some() || self.time_lines.is_preview {
            self.show_time_line(None);
        }
    }

    /// Hides the time line of a recording, because there is another recording now.
    pub(super) fn end_look(&mut self) {
        if self.time_lines.shown.is_some() && !self.time_lines.is_preview {
            self.show_time_line(None);
        }
    }

    /// Continues the preview until the browser's clock reaches `until`, in milliseconds. At the end shows its time line.
    pub(super) fn preview_on(&mut self, until: f64) {
        let Some(mut preview) = self.time_lines.preview.take() else { return };
        let Some(end) = preview.poll(|| browser_now() < until) else {
            self.time_lines.preview = Some(preview);
            return;
        };
        self.dom.end_notice_of(self.language.text(PREVIEW_RUNS));
        match end {
            PreviewEnd::Over => {}
            PreviewEnd::TooLong => self.dom.notice(self.language.text("preview-too-long")),
            PreviewEnd::Failed(failure) => self.dom.notice(&words::preview_failure(self.language, &failure)),
        }
        self.show_time_line(Some(preview.into_time_line()));
        self.time_lines.is_preview = true;
    }

    fn look_through_recording(&mut self) {
        let Some(recording) = &self.recording else { return self.say_that_nothing_is_recorded() };
        if let Ok(recording) = Recording::parse(&recording.text) {
            self.show_time_line(Some(TimeLine::of(&recording)));
        }
    }

    /// Shows a time line at its start, or hides the last one. Ends a preview that runs.
    pub(super) fn show_time_line(&mut self, shown: Option<TimeLine>) {
        if self.time_lines.preview.is_some() {
            self.dom.end_notice_of(self.language.text(PREVIEW_RUNS));
        }
        self.dom.set_hidden("time-line", shown.is_none());
        if let (Some(shown), Ok(slider)) = (&shown, self.dom.get::<HtmlInputElement>("moment")) {
            // The slider has whole steps, so round its maximum up. `choose_moment` limits the time to the length.
            let steps = (shown.length().as_secs_f64() / STEP).ceil();
            set_attribute(&slider, "max", &format!("{:.2}", steps * STEP));
            slider.set_value("0");
        }
        self.time_lines = TimeLines { shown, ..TimeLines::default() };
        self.say_moment();
    }

    /// Handles a move of the slider.
    pub(super) fn choose_moment(&mut self) {
        let seconds = self.dom.get::<HtmlInputElement>("moment").ok().as_ref().and_then(number);
        let at = Duration::from_secs_f32(seconds.unwrap_or_default().max(0.0));
        let length = self.time_lines.shown.as_ref().map_or(Duration::ZERO, TimeLine::length);
        self.time_lines.at = at.min(length);
        self.say_moment();
    }

    fn say_moment(&self) {
        let Some((shown, stand)) = self.time_lines.shown.as_ref().zip(self.time_lines.stand()) else {
            return;
        };
        let angles = stand.angles.map(|angle| format!("{angle:.0}°")).join(" ");
        let (at, all) = (self.time_lines.at.as_secs_f64(), shown.length().as_secs_f64());
        self.dom.set_text("moment-text", &format!("{at:.1} / {all:.1} s · {angles}"));
    }
}
