//! Movements: records, stores, opens, plays and saves them.

use std::time::Duration;

use sevenbot::recording::RecordingError;
use web_sys::HtmlInputElement;

use super::dom::number;
use super::files;
use super::kept_recording::KeptRecording;
use super::page::App;
use crate::movement::{PagePlayer, PlayRefusal};
use crate::recorder::PageRecorder;

/// The longest time that a user can choose for the approach to the first pose of a movement, in seconds.
const LONGEST_APPROACH: f32 = 60.0;

impl App {
    pub(super) fn record(&mut self) {
        if self.recorder.is_some() {
            self.end_recording();
        } else {
            self.recorder = Some(PageRecorder::new(self.now()));
        }
    }

    pub(super) fn end_recording(&mut self) {
        let recorded = self.recorder.take().and_then(PageRecorder::finish);
        if let Some(recorded) = recorded.and_then(|text| KeptRecording::parse(text).ok()) {
            self.keep(recorded);
        }
    }

    fn keep(&mut self, recording: KeptRecording) {
        recording.store();
        self.end_look();
        self.recording = Some(recording);
        self.dom.end_notice();
    }

    pub(super) fn begin_play(&mut self) {
        if self.is_stopping() {
            return;
        }
        let Some(recording) = &self.recording else { return self.say_that_nothing_is_recorded() };
        let seconds = self.dom.get::<HtmlInputElement>("approach").ok().and_then(|field| number(&field));
        let approach = seconds.filter(|seconds| *seconds > 0.0);
        let approach = approach.map(|seconds| Duration::from_secs_f32(seconds.min(LONGEST_APPROACH)));
        let now = self.now();
        match PagePlayer::new(&recording.text, self.client.registers(), approach, now) {
            Ok(player) => {
                self.show_time_line(None);
                let before = self.registers_before_movement();
                self.player = Some(player.restoring(before));
                self.dom.end_notice();
            }
            Err(PlayRefusal::NoRecording(why)) => self.refuse_file(&why),
            Err(PlayRefusal::TooFar(far)) => {
                let joints = far
                    .joints
                    .iter()
                    .map(|(joint, here, first)| format!("{}: {here:.1}° → {first:.1}°", joint.number()));
                let joints = joints.collect::<Vec<_>>().join(", ");
                self.dom.notice(&format!("{} {joints}", self.language.text("too-far")));
            }
        }
    }

    pub(super) fn say_that_nothing_is_recorded(&self) {
        self.dom.notice(self.language.text("record-first"));
    }

    fn refuse_file(&self, why: &RecordingError) {
        self.dom.notice(&format!("{} {why}", self.language.text("bad-file")));
    }

    /// Opens the text of a file with a movement.
    pub(super) fn open_recording(&mut self, text: String) {
        match KeptRecording::parse(text) {
            Ok(recording) => self.keep(recording),
            Err(why) => self.refuse_file(&why),
        }
    }

    pub(super) fn download(&self) {
        let Some(recording) = &self.recording else { return self.say_that_nothing_is_recorded() };
        files::save(&self.dom, "movement.7bot", &recording.text);
    }
}
