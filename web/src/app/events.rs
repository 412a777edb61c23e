//! Handles the events of the user: clicks, keys, sliders, fields and files.

use arm_sim::scene::Scene;
use sevenbot::map::{FINE_TARGET, MOTOR_STATE, TARGET_POSITION, motor_state};
use sevenbot::{Span, register_values};
use wasm_bindgen::{JsCast, JsValue};
use web_sys::{Element, Event, HtmlDialogElement, HtmlInputElement, KeyboardEvent};

use super::dom::{Dom, number};
use super::editor::Editor;
use super::files;
use super::hand;
use super::link;
use super::page::{App, ArmLine, on, on_first};
use super::panels::TIP_FIELDS;
use super::storage;
use crate::arm_state::target_frame;
use crate::plots::PlottedQuantity;
use crate::texts::Language;

/// The names of the texts of the tour, in order. The last one is for a real arm.
pub(super) const TOUR: [&str; 5] = ["tour-1", "tour-2", "tour-3", "tour-4", "tour-5"];

/// Installs the handlers of all events.
pub(super) fn listen(dom: &Dom) -> Result<(), JsValue> {
    let root = dom.0.document_element().ok_or("no document")?;
    on(&root, "click", |app, _: &Event, event| app.clicked(event))?;
    on(&root, "input", |app, _: &Event, event| app.slid(event))?;
    on(&root, "change", |app, _: &Event, event| app.changed(event))?;
    on_first(&root, "keydown", |app, key: &KeyboardEvent, event| app.key(key, event))?;
    // Some browsers click the focused button when the space bar is released.
    on(&root, "keyup", |_, key: &KeyboardEvent, event| {
        if key.key() == " " {
            event.prevent_default();
        }
    })?;
    link::listen()?;
    hand::listen(dom)
}

impl App {
    /// Shows the page in this language.
    pub(super) fn set_language(&mut self, language: Language) {
        self.language = language;
        self.dom.translate(language);
        self.show_tour();
        if Editor.is_loaded() {
            self.translate_editor();
        }
        if self.exercises.is_open {
            self.show_exercise();
        }
    }

    fn clicked(&mut self, event: &Event) {
        let target = event.target().and_then(|target| target.dyn_into::<Element>().ok());
        let Some(button) = target.and_then(|target| target.closest("[data-action]").ok()?) else { return };
        let attribute = |name| button.get_attribute(name).unwrap_or_default();
        self.act(&attribute("data-action"), &attribute("data-value"));
    }

    fn act(&mut self, action: &str, value: &str) {
        match action {
            "stop" => self.stop(),
            "language" => {
                self.set_language(self.language.other());
                storage::save("language", self.language.tag());
            }
            "motors" => self.write(MOTOR_STATE.address, &[value.parse().unwrap_or(motor_state::SERVO)]),
            "park" => self.begin_park(),
            "plot" => self.choose_plot(value),
            "speed" => {
                self.speed = value.parse().unwrap_or(1.0);
                self.dom.press("speed", value);
            }
            "break" => {
                let (joint, kind) = (self.dom.choice("fault-joint"), self.dom.choice("fault-kind"));
                self.act_on_simulation(&break_action(&joint, &kind, self.wall_angle()));
            }
            "thing" => {
                self.act_on_simulation(&format!("weight {}", self.dom.choice("payload")));
                self.act("fault", "7=thing=30");
            }
            "drop" => self.act_on_simulation("drop"),
            "scene" => self.act_on_simulation(&format!("scene {}", self.dom.choice("room"))),
            "fault" => self.act_on_simulation(&format!("fault {value}")),
            "repair" => self.repair(),
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
            "close-notice" => self.dom.end_notice(),
            _ if self.act_on_class(action)
                || self.act_on_program(action)
                || self.act_on_exercise(action)
                || self.act_on_time_line(action) => {}
            _ => self.control(action, value),
        }
    }

    pub(super) fn write(&mut self, address: u8, values: &[u8]) {
        if self.refuses_to_drive() {
            return;
        }
        let now = self.now();
        // End a movement first: in its stream, a new target would count as one point, and the next point would lead back.
        let moves = [MOTOR_STATE, TARGET_POSITION, FINE_TARGET].iter().any(|row| row.holds(address));
        if moves {
            self.hide_time_line();
            self.end_movement();
        }
        self.client.write(now, address, values);
    }

    /// The angle of the simulated wall, in degrees. 60 if the field holds no valid angle.
    fn wall_angle(&self) -> f32 {
        let field = self.dom.get::<HtmlInputElement>("wall-at").ok();
        field.as_ref().and_then(number).filter(|degrees| (0.0..=180.0).contains(degrees)).unwrap_or(60.0)
    }

    /// Removes the faults of a simulated arm. If its motors are on, the joints that are blocked or let go try again (D27, D28).
    fn repair(&mut self) {
        self.act_on_simulation("clear");
        let state = self.client.state();
        if state.motor_state != motor_state::SERVO {
            return;
        }
        self.write(MOTOR_STATE.address, &[motor_state::SERVO]);
        for (joint, target) in
            (1..).zip(state.targets).filter(|(joint, _)| state.stalled >> (joint - 1) & 1 == 1)
        {
            self.send_joint(joint, target);
        }
    }

    fn choose_plot(&mut self, value: &str) {
        self.quantity = match value {
            "velocity" => PlottedQuantity::Velocity,
            "load" => PlottedQuantity::Load,
            _ => PlottedQuantity::Angle,
        };
        self.dom.press("plot", value);
    }

    pub(super) fn act_on_simulation(&mut self, action: &str) {
        if let (ArmLine::Simulated(source), Ok(action)) = (&mut self.line, action.parse()) {
            source.act(action);
        }
    }

    /// Opens the text of a file with a scene, and sets up the scene in the simulation.
    fn open_scene(&mut self, text: String) {
        match text.parse::<Scene>() {
            Ok(scene) => self.act_on_simulation(&format!("scene {scene}")),
            Err(error) => self.dom.notice(&format!("{} {error}", self.language.text("no-scene"))),
        }
    }

    fn slid(&mut self, event: &Event) {
        let Some(slider) = event.target().and_then(|target| target.dyn_into::<HtmlInputElement>().ok())
        else {
            return;
        };
        // The `change` event sends a typed number when it is complete.
        if slider.type_() == "number" {
            return;
        }
        if slider.id() == "moment" {
            return self.choose_moment();
        }
        let joint = slider.get_attribute("data-joint").and_then(|joint| joint.parse().ok());
        if let Some((joint, degrees)) = joint.zip(number(&slider)) {
            // The current round of reads may be older than this target. So ignore its targets.
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
            "upload" => files::read(&element, Self::open_recording),
            "open-program" => files::read(&element, Self::open_program),
            "open-scene" => files::read(&element, Self::open_scene),
            "open-exercise" => files::read(&element, Self::open_exercise),
            "exercise-choice" => self.choose_exercise(),
            "joint-speed" => self.choose_speed(),
            id if TIP_FIELDS.contains(&id) => self.type_tip(),
            id if id.starts_with("target-") => self.type_joint(&element),
            _ => self.change_register(&element),
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
        // Without the focus, the field shows the value of the arm again.
        let _ = input.blur();
    }

    fn key(&mut self, key: &KeyboardEvent, event: &Event) {
        let target = event.target().and_then(|target| target.dyn_into::<Element>().ok());
        let kind = target.as_ref().map(Element::tag_name).unwrap_or_default();
        if key.key() == " " {
            // The space bar stops everywhere. On a button it must not press the button, too. In the field for a name it also
            // types a space.
            if target.as_ref().is_none_or(|target| target.id() != "class-name") {
                event.prevent_default();
            }
            event.stop_propagation();
            return self.stop();
        }
        if kind == "CANVAS" && self.scene.as_mut().is_some_and(|scene| scene.key(&key.key(), key.shift_key()))
        {
            event.prevent_default();
        }
        if key.key() == "Escape" {
            self.end_tour();
        }
        // An Enter that confirms Chinese input in an input method must not join the class.
        let is_typed = key.key() == "Enter" && !key.is_composing();
        if is_typed && target.as_ref().is_some_and(|target| target.id().starts_with("class-")) {
            self.act_on_class("join-class");
        }
        // Enter sends an unchanged number again, so that a blocked joint tries again. There is no `change` event for it.
        if key.key() == "Enter"
            && let Some(field) = target.filter(|target| target.id().starts_with("target-"))
        {
            self.type_joint(&field);
        }
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
        storage::save("tour", "seen");
        if let Ok(dialog) = self.dom.get::<HtmlDialogElement>("tour") {
            dialog.close();
        }
    }
}

/// The action of the simulation that injects a fault into a servo, or puts an obstacle at `wall` degrees in the way of its joint.
fn break_action(joint: &str, kind: &str, wall: f32) -> String {
    match kind {
        "wall" => format!("fault {joint}=wall={wall}"),
        // The stiffness: 500 mN·m per degree.
        "soft" => format!("fault {joint}=wall={wall}/500"),
        _ => match kind.strip_prefix("trip") {
            Some(alarm) => format!("trip {joint}{alarm}"),
            None => format!("fault {joint}={kind}"),
        },
    }
}
