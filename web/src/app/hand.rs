//! Handles the pointer on the picture: drags a joint, the tip or the camera.

use arm_sim::Action;
use motion_core::calibration::{MicroDegrees, counts_from_angle};
use sevenbot::map::{FINE_TARGET, motor_state};
use sevenbot::{FineAngle, Joint};
use wasm_bindgen::JsValue;
use web_sys::{Element, PointerEvent, TouchEvent, WheelEvent};

use super::dom::Dom;
use super::page::{App, ArmLine, on};
use crate::arm_state::{breach_on_way, breach_text};
use crate::scene::{ArmScene, Button, RefusedWish, SceneEvent, WishRefusal};

/// Installs the handlers of pointers, touches and the wheel.
pub(super) fn listen(dom: &Dom) -> Result<(), JsValue> {
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
        let event = app.scene.as_mut().and_then(ArmScene::pointer_left);
        app.scene_event(event);
    })?;
    // A finger on a joint or the tip moves the arm, on the base it turns the camera, elsewhere it scrolls the page. Two fingers
    // zoom the picture.
    on(&canvas, "touchstart", |app, touch: &TouchEvent, event| {
        if app.takes_touch(touch) {
            event.prevent_default();
        }
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
    /// Does the picture handle this touch, instead of scrolling the page?
    fn takes_touch(&self, event: &TouchEvent) -> bool {
        let touches = event.touches();
        let (Some(touch), Ok(canvas), Some(scene)) = (touches.get(0), self.dom.canvas("scene"), &self.scene)
        else {
            return false;
        };
        let corner = canvas.get_bounding_client_rect();
        let [x, y] =
            [f64::from(touch.client_x()) - corner.left(), f64::from(touch.client_y()) - corner.top()];
        touches.length() > 1 || scene.pick(narrow(x), narrow(y), self.client.state().angles()).is_some()
    }

    fn pointer_down(&mut self, pointer: &PointerEvent) {
        let angles = self.client.state().angles();
        let button = if pointer.button() == 0 { Button::Primary } else { Button::Secondary };
        if let Ok(canvas) = self.dom.canvas("scene") {
            // With the capture, a drag continues outside the picture. Ignore the error of a pointer that is gone already.
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
                let refused = match wish.reach {
                    Err(RefusedWish { why: WishRefusal::OutOfReach(_), .. }) => Some("unreachable"),
                    Err(RefusedWish { why: WishRefusal::Guarded(breach), .. }) => Some(breach_text(&breach)),
                    Ok(angles) => self.drag_tip(angles),
                };
                self.unreachable = refused.map(|why| (wish.tip, why));
            }
            Some(SceneEvent::Released) => {
                self.unreachable = None;
                if let Some(joint) = self.hand.take() {
                    self.act_on_simulation(&format!("let-go {joint}"));
                }
            }
        }
    }

    /// Sends the arm to a pose in degrees, if the guard of the workspace allows the path. If not, returns the name of the text
    /// that gives the reason.
    pub(super) fn drag_tip(&mut self, angles: [f32; 7]) -> Option<&'static str> {
        let breach = breach_on_way(self.client.registers(), angles);
        if breach.is_none() {
            self.send_pose(angles);
        }
        breach.map(|breach| breach_text(&breach))
    }

    /// Moves a dragged joint: with its motor, or by a simulated hand if the motors of a simulated arm are off or damped.
    fn drag_joint(&mut self, joint: u8, degrees: f32) {
        let is_driven = self.client.state().motor_state == motor_state::SERVO;
        let (ArmLine::Simulated(source), Some(named), false) = (&mut self.line, Joint::new(joint), is_driven)
        else {
            return self.send_joint(joint, degrees);
        };
        source.act(Action::Hand(named, counts_from_angle(named, MicroDegrees::nearest(degrees), 0)));
        self.hand = Some(joint);
    }

    /// Sends the targets of all joints, in degrees: in one frame if the arm has the extended block, or else one by one.
    pub(super) fn send_pose(&mut self, angles: [f32; 7]) {
        let values: Vec<u8> = angles
            .iter()
            .filter_map(|&degrees| FineAngle::from_degrees(f64::from(degrees)))
            .flat_map(|angle| angle.hundredths().to_le_bytes())
            .collect();
        if self.client.registers().has_extended_block() && values.len() == 14 {
            self.write(FINE_TARGET.address, &values);
        } else {
            for (joint, degrees) in (1..).zip(angles) {
                self.send_joint(joint, degrees);
            }
        }
    }
}
