//! What a person does: clicks, keys, sliders, the pointer on the picture, files.

use std::time::Duration;

use protocol_core::time::Instant;
use sevenbot::map::{MOTOR_STATE, motor_state};
use sevenbot::recording::{Recording, RecordingError};
use sevenbot::{Span, register_values};
use wasm_bindgen::{JsCast, JsValue};
use wasm_bindgen_futures::{JsFuture, spawn_local};
use web_sys::{
    Blob, Element, Event, HtmlAnchorElement, HtmlDialogElement, HtmlInputElement, KeyboardEvent, Url,
};

use super::dom::{Dom, number};
use super::hand;
use super::page::{App, Line, on, with_app};
use crate::arm_state::target_frame;
use crate::movement::{PlayProgress, PlayRefusal, Player, Recorder};
use crate::park::{Park, ParkProgress};
use crate::plots::Quantity;
use crate::source::serial::SerialSource;
use crate::source::socket::SocketSource;
use crate::words;

/// The longest way to the first pose of a movement, in seconds.
const LONGEST_APPROACH: f32 = 60.0;
/// The texts of the tour, in their order. The last one is for a real arm.
const TOUR: [&str; 5] = ["tour-1", "tour-2", "tour-3", "tour-4", "tour-5"];

/// Listens to everything that a person can do.
pub(super) fn listen(dom: &Dom) -> Result<(), JsValue> {
    let root = dom.0.document_element().ok_or("no document")?;
    on(&root, "click", |app, _: &Event, event| app.clicked(event))?;
    on(&root, "input", |app, _: &Event, event| app.slid(event))?;
    on(&root, "change", |app, _: &Event, event| app.changed(event))?;
    on(&root, "keydown", |app, key: &KeyboardEvent, event| app.key(key, event))?;
    // Some browsers click a button when the space bar is released.
    on(&root, "keyup", |_, key: &KeyboardEvent, event| {
        if key.key() == " " {
            event.prevent_default();
        }
    })?;
    hand::listen(dom)
}

impl App {
    fn clicked(&mut self, event: &Event) {
        let target = event.target().and_then(|target| target.dyn_into::<Element>().ok());
        let Some(button) = target.and_then(|target| target.closest("[data-action]").ok()?) else { return };
        let attribute = |name| button.get_attribute(name).unwrap_or_default();
        self.act(&attribute("data-action"), &attribute("data-value"));
    }

    fn act(&mut self, action: &str, value: &str) {
        match action {
            "stop" => self.stop(),
            "language" => self.set_language(self.language.other()),
            "motors" => self.write(MOTOR_STATE.address, &[value.parse().unwrap_or(motor_state::SERVO)]),
            "park" => self.begin_park(),
            "plot" => self.choose_plot(value),
            "speed" => {
                self.speed = value.parse().unwrap_or(1.0);
                self.dom.press("speed", value);
            }
            "break" => {
                let (joint, kind) = (self.dom.choice("fault-joint"), self.dom.choice("fault-kind"));
                match kind.strip_prefix("trip") {
                    Some(alarm) => self.act_on_simulation(&format!("trip {joint}{alarm}")),
                    None => self.act("fault", &format!("{joint}={kind}")),
                }
            }
            "thing" => {
                self.act_on_simulation(&format!("weight {}", self.dom.choice("payload")));
                self.act("fault", "7=thing=30");
            }
            "drop" => self.act_on_simulation("drop"),
            "fault" => self.act_on_simulation(&format!("fault {value}")),
            "repair" => self.act_on_simulation("clear"),
            "power" => self.act_on_simulation("power-cycle"),
            "record" => self.record(),
            "play" => self.begin_play(),
            "download" => self.download(),
            "tour" => {
                self.tour_step = 0;
                self.begin_tour();
            }
            "tour-next" => {
                self.tour_step += 1;
                self.show_tour();
            }
            "tour-end" => self.end_tour(),
            _ => {}
        }
    }

    pub(super) fn write(&mut self, address: u8, values: &[u8]) {
        self.park = None;
        let now = self.now();
        self.client.write(now, address, values);
    }

    fn begin_park(&mut self) {
        self.player = None;
        self.park = Park::new(&self.client.state(), &self.client);
        let text = if self.park.is_some() { "parking" } else { "park-failed" };
        self.dom.notice(self.language.text(text));
    }

    /// Goes on with parking.
    pub(super) fn park_on(&mut self, now: Instant) {
        let Some(mut park) = self.park.take() else { return };
        let text = match park.poll(now, &mut self.client) {
            ParkProgress::Moving => {
                self.park = Some(park);
                return;
            }
            ParkProgress::Parked => "parked",
            ParkProgress::Failed => "park-failed",
        };
        self.dom.notice(self.language.text(text));
    }

    /// Goes on with a movement.
    pub(super) fn play_on(&mut self, now: Instant) {
        let Some(mut player) = self.player.take() else { return };
        match player.poll(now, &mut self.client) {
            PlayProgress::Playing => self.player = Some(player),
            PlayProgress::Played => {}
            PlayProgress::Failed(failure) => {
                self.dom.notice(&words::play_failure(self.language, &failure));
            }
        }
    }

    fn stop(&mut self) {
        let now = self.now();
        let (park, player) = (self.park.take(), self.player.take());
        let speeds = park.map(|park| park.speeds()).or(player.as_ref().map(Player::speeds));
        self.client.stop(now, speeds);
        if let Some(player) = player {
            player.end_stream(now, &mut self.client);
        }
    }

    fn choose_plot(&mut self, value: &str) {
        self.quantity = match value {
            "velocity" => Quantity::Velocity,
            "load" => Quantity::Load,
            _ => Quantity::Angle,
        };
        self.dom.press("plot", value);
    }

    pub(super) fn act_on_simulation(&mut self, action: &str) {
        if let (Line::Simulated(source), Ok(action)) = (&mut self.line, action.parse()) {
            source.act(action);
        }
    }

    fn slid(&mut self, event: &Event) {
        let Some(slider) = event.target().and_then(|target| target.dyn_into::<HtmlInputElement>().ok())
        else {
            return;
        };
        let joint = slider.get_attribute("data-joint").and_then(|joint| joint.parse().ok());
        if let Some((joint, degrees)) = joint.zip(number(&slider)) {
            // The round that is on its way may be older than this target.
            self.slid_round = self.client.rounds() + 2;
            self.send_joint(joint, degrees);
        }
    }

    pub(super) fn send_joint(&mut self, joint: u8, degrees: f32) {
        if let Some((address, values)) = target_frame(self.client.registers(), joint, degrees) {
            self.write(address, &values);
        }
    }

    fn changed(&mut self, event: &Event) {
        let Some(element) = event.target().and_then(|target| target.dyn_into::<Element>().ok()) else {
            return;
        };
        match element.id().as_str() {
            "source" => self.choose_source(),
            "upload" => upload(&element),
            _ => self.change_register(&element),
        }
    }

    /// Shows the arm behind the server if the opened address has its token, or else the simulated one.
    pub(super) fn show_first_arm(&mut self) {
        let query = web_sys::window().and_then(|window| window.location().search().ok());
        if query.is_some_and(|query| query.contains("token=")) {
            self.dom.choose("source", "server");
            self.choose_source();
            self.tour_step = TOUR.len() - 1;
        }
        self.begin_tour();
    }

    fn choose_source(&mut self) {
        let line = match self.dom.choice("source").as_str() {
            "server" => SocketSource::connect().map(|source| Line::Remote(Box::new(source))).ok(),
            "usb" => SerialSource::ask().map(|source| Line::Remote(Box::new(source))),
            _ => Some(Line::Simulated(Box::default())),
        };
        match line {
            Some(line) => self.set_line(line),
            None => {
                self.dom.choose("source", "simulator");
                self.set_line(Line::Simulated(Box::default()));
                self.dom.notice(self.language.text("no-serial"));
            }
        }
    }

    fn change_register(&mut self, element: &Element) {
        let address = element.get_attribute("data-register").and_then(|address| address.parse().ok());
        let Some((address, input)) = address.zip(element.dyn_ref::<HtmlInputElement>()) else { return };
        let row = sevenbot::map::find(address);
        let count = row.map_or(1, |row| row.range.width());
        let value = input.value();
        let bytes =
            Span::new(address, count).zip(value.trim().parse().ok()).ok_or_else(|| value.clone()).and_then(
                |(span, number)| register_values::bytes(span, &[number]).map_err(|why| why.to_string()),
            );
        match bytes {
            Ok(bytes) => self.write(address, &bytes),
            Err(why) => self.dom.notice(&format!("{} {why}", self.language.text("bad-value"))),
        }
        // Shows the value of the arm again.
        let _ = input.blur();
    }

    fn key(&mut self, key: &KeyboardEvent, event: &Event) {
        let target = event.target().and_then(|target| target.dyn_into::<Element>().ok());
        let kind = target.as_ref().map(Element::tag_name).unwrap_or_default();
        if key.key() == " " {
            // Also on buttons, where the space bar would press them: a stop works from everywhere.
            event.prevent_default();
            return self.stop();
        }
        if kind == "CANVAS" && self.scene.as_mut().is_some_and(|scene| scene.key(&key.key(), key.shift_key()))
        {
            event.prevent_default();
        }
        if key.key() == "Escape" {
            self.end_tour();
        }
    }

    fn record(&mut self) {
        if self.recorder.is_some() {
            self.end_recording();
        } else {
            self.recorder = Some(Recorder::new(self.now()));
        }
    }

    pub(super) fn end_recording(&mut self) {
        let recorded = self.recorder.take().and_then(Recorder::finish);
        self.recording = recorded.or(self.recording.take());
    }

    fn begin_play(&mut self) {
        self.park = None;
        let Some(recording) = &self.recording else { return };
        let seconds = self.dom.get::<HtmlInputElement>("approach").ok().and_then(|field| number(&field));
        let approach = seconds.filter(|seconds| *seconds > 0.0);
        let approach = approach.map(|seconds| Duration::from_secs_f32(seconds.min(LONGEST_APPROACH)));
        match Player::new(recording, self.client.registers(), approach, self.now()) {
            Ok(player) => {
                self.player = Some(player);
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

    fn refuse_file(&self, why: &RecordingError) {
        self.dom.notice(&format!("{} {why}", self.language.text("bad-file")));
    }

    fn download(&self) {
        let Some(recording) = &self.recording else { return };
        let parts = js_sys::Array::of1(&recording.as_str().into());
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

    pub(super) fn begin_tour(&mut self) {
        if let Ok(dialog) = self.dom.get::<HtmlDialogElement>("tour") {
            dialog.show();
        }
        self.show_tour();
    }

    pub(super) fn show_tour(&mut self) {
        match TOUR.get(self.tour_step) {
            Some(text) => self.dom.set_text("tour-text", self.language.text(text)),
            None => self.end_tour(),
        }
    }

    fn end_tour(&mut self) {
        if let Ok(dialog) = self.dom.get::<HtmlDialogElement>("tour") {
            dialog.close();
        }
    }
}

/// Reads the file that a person chose.
fn upload(element: &Element) {
    let Some(input) = element.dyn_ref::<HtmlInputElement>() else { return };
    let Some(file) = input.files().and_then(|files| files.get(0)) else { return };
    // So that the same file can be chosen again after a change.
    input.set_value("");
    spawn_local(async move {
        let text =
            JsFuture::from(file.text()).await.ok().and_then(|text| text.as_string()).unwrap_or_default();
        with_app(|app| match Recording::parse(&text) {
            Ok(_) => {
                app.recording = Some(text.clone());
                app.dom.end_notice();
            }
            Err(why) => app.refuse_file(&why),
        });
    });
}
