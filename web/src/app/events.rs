//! What a person does: clicks, keys, sliders, the pointer on the picture, files.

use arm_sim::Action;
use motion_core::calibration::{MicroDegrees, counts_from_angle};
use sevenbot::map::{FINE_TARGET, MOTOR_STATE, motor_state};
use sevenbot::{FineAngle, Joint, Span, register_values};
use wasm_bindgen::prelude::Closure;
use wasm_bindgen::{JsCast, JsValue};
use wasm_bindgen_futures::{JsFuture, spawn_local};
use web_sys::{
    Blob, Element, Event, HtmlAnchorElement, HtmlDialogElement, HtmlInputElement, KeyboardEvent,
    PointerEvent, Url, WheelEvent,
};

use super::dom::{Dom, number};
use super::{App, Line, panels, with_app};
use crate::arm_state::target_frame;
use crate::movement::{self, Player, Recorder};
use crate::plots::Quantity;
use crate::scene::{Button, SceneEvent};
use crate::source::serial::SerialSource;
use crate::source::socket::SocketSource;

/// The texts of the tour, in their order. The last one is for a real arm.
const TOUR: [&str; 5] = ["tour-1", "tour-2", "tour-3", "tour-4", "tour-5"];

/// Calls `act` for each event of this kind on an element, as long as the page lives.
fn on<E: JsCast>(
    target: &Element,
    kind: &str,
    mut act: impl FnMut(&mut App, &E, &Event) + 'static,
) -> Result<(), JsValue> {
    let handler = Closure::<dyn FnMut(Event)>::new(move |event: Event| {
        if let Some(specific) = event.dyn_ref::<E>() {
            with_app(|app| act(app, specific, &event));
        }
    });
    target.add_event_listener_with_callback(kind, handler.as_ref().unchecked_ref())?;
    handler.forget();
    Ok(())
}

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
    let canvas: Element = dom.get("scene")?;
    on(&canvas, "pointerdown", |app, pointer: &PointerEvent, _| app.pointer_down(pointer))?;
    on(&canvas, "pointermove", |app, pointer: &PointerEvent, _| {
        let angles = app.client.state().angles();
        let event = app
            .scene
            .as_mut()
            .and_then(|scene| scene.pointer_moved(pointer.pointer_id(), place(pointer), angles));
        app.scene_event(event);
    })?;
    for kind in ["pointerup", "pointercancel"] {
        on(&canvas, kind, |app, pointer: &PointerEvent, _| {
            let event = app.scene.as_mut().and_then(|scene| scene.pointer_up(pointer.pointer_id()));
            app.scene_event(event);
        })?;
    }
    on(&canvas, "pointerleave", |app, _: &PointerEvent, _| {
        let event = app.scene.as_mut().and_then(crate::scene::Scene::pointer_left);
        app.scene_event(event);
    })?;
    on(&canvas, "wheel", |app, wheel: &WheelEvent, event| {
        event.prevent_default();
        if let Some(scene) = &mut app.scene {
            scene.wheel(narrow(wheel.delta_y()));
        }
    })
}

#[expect(clippy::cast_possible_truncation, reason = "pixels")]
const fn narrow(number: f64) -> f32 {
    number as f32
}

fn place(pointer: &PointerEvent) -> [f32; 2] {
    [narrow(f64::from(pointer.offset_x())), narrow(f64::from(pointer.offset_y()))]
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
            "plot" => self.choose_plot(value),
            "speed" => {
                self.speed = value.parse().unwrap_or(1.0);
                self.dom.press("speed", value);
            }
            "break" => {
                let fault = format!("{}={}", self.dom.choice("fault-joint"), self.dom.choice("fault-kind"));
                self.act("fault", &fault);
            }
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

    fn write(&mut self, address: u8, values: &[u8]) {
        let now = self.now();
        self.client.write(now, address, values);
    }

    fn stop(&mut self) {
        if self.player.take().is_some() {
            let now = self.now();
            movement::end(&mut self.client, now);
        }
        self.client.stop();
    }

    fn choose_plot(&mut self, value: &str) {
        self.quantity = match value {
            "velocity" => Quantity::Velocity,
            "load" => Quantity::Load,
            _ => Quantity::Angle,
        };
        self.dom.press("plot", value);
    }

    fn act_on_simulation(&mut self, action: &str) {
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
            self.send_joint(joint, degrees);
        }
    }

    fn send_joint(&mut self, joint: u8, degrees: f32) {
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
                panels::notice(&self.dom, self.language.text("no-serial"));
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
            Err(why) => panels::notice(&self.dom, &format!("{} {why}", self.language.text("bad-value"))),
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

    fn pointer_down(&mut self, pointer: &PointerEvent) {
        let angles = self.client.state().angles();
        let button = if pointer.button() == 0 { Button::Primary } else { Button::Secondary };
        if let Ok(canvas) = self.dom.canvas("scene") {
            // The drag goes on where the pointer leaves the picture. A pointer that is gone already needs none.
            let _ = canvas.set_pointer_capture(pointer.pointer_id());
        }
        let event = self
            .scene
            .as_mut()
            .and_then(|scene| scene.pointer_down(pointer.pointer_id(), place(pointer), button, angles));
        self.scene_event(event);
    }

    fn scene_event(&mut self, event: Option<SceneEvent>) {
        match event {
            None => {}
            Some(SceneEvent::Hovered(part)) => self.hovered = part,
            Some(SceneEvent::JointDragged { joint, degrees }) => self.drag_joint(joint, degrees),
            Some(SceneEvent::TipDragged(wish)) => {
                self.unreachable = wish.reach.is_err().then_some(wish.tip);
                if let Ok(angles) = wish.reach {
                    self.send_pose(angles);
                }
            }
            Some(SceneEvent::Released) => {
                self.unreachable = None;
                if let Some(joint) = self.hand.take() {
                    self.act_on_simulation(&format!("let-go {joint}"));
                }
            }
        }
    }

    /// Moves a joint by its motor. A limp joint of a simulated arm is moved by a hand.
    fn drag_joint(&mut self, joint: u8, degrees: f32) {
        let is_driven = self.client.state().motor_state == motor_state::SERVO;
        let (Line::Simulated(source), Some(named), false) = (&mut self.line, Joint::new(joint), is_driven)
        else {
            return self.send_joint(joint, degrees);
        };
        source.act(Action::Hand(named, counts_from_angle(named, MicroDegrees::nearest(degrees), 0)));
        self.hand = Some(joint);
    }

    fn send_pose(&mut self, angles: [f32; 7]) {
        let values: Vec<u8> = angles
            .iter()
            .filter_map(|&degrees| FineAngle::from_degrees(f64::from(degrees)))
            .flat_map(|angle| angle.hundredths().to_le_bytes())
            .collect();
        if crate::arm_state::has_extended_block(self.client.registers()) && values.len() == 14 {
            self.write(FINE_TARGET.address, &values);
        } else {
            for (joint, degrees) in (1..).zip(angles) {
                self.send_joint(joint, degrees);
            }
        }
    }

    fn record(&mut self) {
        if let Some(recorder) = self.recorder.take() {
            self.recording = recorder.finish().or(self.recording.take());
        } else {
            self.recorder = Some(Recorder::new(self.now()));
        }
    }

    fn begin_play(&mut self) {
        let Some(recording) = &self.recording else { return };
        match Player::new(recording, self.now()) {
            Ok(player) => self.player = Some(player),
            Err(why) => panels::notice(&self.dom, &format!("{} {why}", self.language.text("bad-file"))),
        }
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
    let file = element.dyn_ref::<HtmlInputElement>().and_then(|input| input.files()?.get(0));
    let Some(file) = file else { return };
    spawn_local(async move {
        let text =
            JsFuture::from(file.text()).await.ok().and_then(|text| text.as_string()).unwrap_or_default();
        with_app(|app| match Player::new(&text, app.now()) {
            Ok(_) => {
                app.recording = Some(text.clone());
                panels::end_notice(&app.dom);
            }
            Err(why) => panels::notice(&app.dom, &format!("{} {why}", app.language.text("bad-file"))),
        });
    });
}
