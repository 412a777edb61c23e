//! Movements: recorded, kept over a reload, opened from a file, played and saved.

use std::time::Duration;

use sevenbot::recording::RecordingError;
use wasm_bindgen::JsCast;
use wasm_bindgen_futures::{JsFuture, spawn_local};
use web_sys::{Blob, Element, HtmlAnchorElement, HtmlInputElement, Url};

use super::dom::number;
use super::kept_recording::KeptRecording;
use super::page::{App, with_app};
use crate::movement::{PlayRefusal, Player, Recorder};

/// The longest way to the first pose of a movement, in seconds.
const LONGEST_APPROACH: f32 = 60.0;

impl App {
    pub(super) fn record(&mut self) {
        if self.recorder.is_some() {
            self.end_recording();
        } else {
            self.recorder = Some(Recorder::new(self.now()));
        }
    }

    pub(super) fn end_recording(&mut self) {
        let recorded = self.recorder.take().and_then(Recorder::finish);
        if let Some(recorded) = recorded.and_then(|text| KeptRecording::parse(text).ok()) {
            self.keep(recorded);
        }
    }

    fn keep(&mut self, recording: KeptRecording) {
        recording.store();
        self.recording = Some(recording);
        self.dom.end_notice();
    }

    pub(super) fn begin_play(&mut self) {
        self.park = None;
        let Some(recording) = &self.recording else { return self.say_that_nothing_is_recorded() };
        let seconds = self.dom.get::<HtmlInputElement>("approach").ok().and_then(|field| number(&field));
        let approach = seconds.filter(|seconds| *seconds > 0.0);
        let approach = approach.map(|seconds| Duration::from_secs_f32(seconds.min(LONGEST_APPROACH)));
        let now = self.now();
        match Player::new(&recording.text, self.client.registers(), approach, now) {
            Ok(player) => {
                self.player = Some(match self.player.take() {
                    Some(earlier) => player.instead_of(&earlier, now, &mut self.client),
                    None => player,
                });
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

    fn say_that_nothing_is_recorded(&self) {
        self.dom.notice(self.language.text("record-first"));
    }

    fn refuse_file(&self, why: &RecordingError) {
        self.dom.notice(&format!("{} {why}", self.language.text("bad-file")));
    }

    pub(super) fn download(&self) {
        let Some(recording) = &self.recording else { return self.say_that_nothing_is_recorded() };
        let parts = js_sys::Array::of1(&recording.text.as_str().into());
        let address =
            Blob::new_with_str_sequence(&parts).and_then(|blob| Url::create_object_url_with_blob(&blob));
        let Ok(address) = address else { return };
        if let Ok(link) =
            self.dom.0.create_element("a").and_then(|link| Ok(link.dyn_into::<HtmlAnchorElement>()?))
        {
            link.set_href(&address);
            link.set_download("movement.7bot");
            link.click();
        }
        // The browser has its own reference by now.
        let _ = Url::revoke_object_url(&address);
    }
}

/// Reads the file that a person chose.
pub(super) fn upload(element: &Element) {
    let Some(input) = element.dyn_ref::<HtmlInputElement>() else { return };
    let Some(file) = input.files().and_then(|files| files.get(0)) else { return };
    // So that the same file can be chosen again after a change.
    input.set_value("");
    spawn_local(async move {
        let text =
            JsFuture::from(file.text()).await.ok().and_then(|text| text.as_string()).unwrap_or_default();
        with_app(|app| match KeptRecording::parse(text) {
            Ok(recording) => app.keep(recording),
            Err(why) => app.refuse_file(&why),
        });
    });
}
