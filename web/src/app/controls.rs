//! The controls other than sliders: numbers for the joints and the tip, home, claw, pump, speed, and the view of the camera.

use glam::Vec3;
use sevenbot::map::{SPEED, TARGET_POSITION, VACUUM_PUMP};
use wasm_bindgen::JsCast;
use web_sys::{Element, HtmlInputElement};

use super::dom::number;
use super::page::App;
use super::panels::TIP_FIELDS;
use crate::arm_state::breach_text;
use crate::scene::{Preset, WishRefusal, wish};

/// The number of the claw's joint.
const CLAW: u8 = 7;

impl App {
    /// Carries out the action of a button. An unknown action has no effect.
    pub(super) fn control(&mut self, action: &str, value: &str) {
        match action {
            // The same pose as `sevenbot home`.
            "home" => self.go(TARGET_POSITION.default_bytes().map(f32::from)),
            "grip" => self.send_joint(CLAW, value.parse().unwrap_or_default()),
            "pump" => {
                let is_on = self.client.registers().byte(&VACUUM_PUMP) != 0;
                self.write(VACUUM_PUMP.address, &[u8::from(!is_on)]);
            }
            "camera" => self.look_from(value),
            _ => {}
        }
    }

    fn look_from(&mut self, side: &str) {
        let preset = match side {
            "front" => Preset::Front,
            "side" => Preset::Side,
            "top" => Preset::Top,
            _ => Preset::Corner,
        };
        if let Some(scene) = &mut self.scene {
            scene.camera_mut().look_from(preset);
        }
    }

    /// Writes the chosen speed of all joints.
    pub(super) fn choose_speed(&mut self) {
        if let Ok(steps) = self.dom.choice("joint-speed").parse() {
            self.write(SPEED.address, &[steps; 7]);
        }
    }

    /// Sends a joint to the angle that the user typed.
    pub(super) fn type_joint(&mut self, element: &Element) {
        let Some(field) = element.dyn_ref::<HtmlInputElement>() else { return };
        let attribute = |name| field.get_attribute(name).and_then(|text| text.parse::<u8>().ok());
        let Some((joint, highest)) = attribute("data-joint").zip(attribute("max")) else { return };
        match number(field).filter(|degrees| (0.0..=f32::from(highest)).contains(degrees)) {
            Some(degrees) => {
                self.slid_round = self.client.rounds() + 2;
                self.send_joint(joint, degrees);
            }
            None => {
                let text = self.language.text("out-of-range");
                self.dom.notice(&format!("{text} 0 – {highest}°"));
                // Without the focus, the field shows the target again.
                let _ = field.blur();
            }
        }
    }

    /// Sends the tip to the position that the user typed. The tool keeps its direction.
    pub(super) fn type_tip(&mut self) {
        let typed = TIP_FIELDS.map(|id| self.dom.get(id).ok().as_ref().and_then(number));
        let [Some(x), Some(y), Some(z)] = typed else {
            return self.dom.notice(self.language.text("no-number"));
        };
        match wish(Vec3::new(x, y, z), self.client.state().targets).reach {
            Ok(angles) => self.go(angles),
            Err(unreachable) => self.refuse_way(match unreachable.why {
                WishRefusal::OutOfReach(_) => "unreachable",
                WishRefusal::Guarded(breach) => breach_text(&breach),
            }),
        }
    }

    /// Sends the arm to these angles in degrees, if the guard of the workspace allows the path.
    fn go(&mut self, angles: [f32; 7]) {
        match self.drag_tip(angles) {
            Some(why) => self.refuse_way(why),
            None => self.slid_round = self.client.rounds() + 2,
        }
    }

    fn refuse_way(&self, why: &'static str) {
        let [what, why] = ["way-refused", why].map(|name| self.language.text(name));
        self.dom.notice(&format!("{what} {why}"));
    }
}
