//! Interprets mouse and touch: turns the camera, drags a joint or the tip, or reports the part under the pointer.
//!
//! ```text
//!   one pointer on a part      drags its joint        two pointers (touch)   zoom and pan
//!               on the tip     drags the tip          secondary button       pans
//!               elsewhere      turns the camera       wheel                  zooms
//! ```

use glam::Vec2;

use super::arm::{Angles, ArmMeshes, ArmPart, tip_of};
use super::camera::Camera;
use super::drag::{JointDrag, TipDrag, TipWish};

/// A pointer within this distance of the projected tip grabs it, in CSS pixels.
const TIP_RADIUS: f32 = 16.0;
/// The logarithm of the zoom factor for one CSS pixel of the wheel.
const ZOOM_PER_PIXEL: f32 = 0.0012;

/// The result of a pointer event.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum SceneEvent {
    /// The pointer is over another part now; `None` if it is over no part.
    Hovered(Option<ArmPart>),
    /// The pointer has dragged a joint to a new angle.
    JointDragged {
        /// Its number, 1 to 7.
        joint: u8,
        /// The new angle in degrees, within the limits.
        degrees: f32,
    },
    /// The pointer has dragged the tip to a new wanted position.
    TipDragged(TipWish),
    /// A drag of a joint or the tip has ended.
    Released,
}

/// Which button of a pointer is down.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Button {
    /// The left one, a finger or a pen.
    Primary,
    /// Any other button.
    Secondary,
}

/// The effect of a pointer that is down.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Grab {
    Orbit,
    Pan,
    Joint(JointDrag),
    Tip(TipDrag),
}

/// The state of all pointers. Positions are CSS pixels from the top left of the picture.
#[derive(Clone, Debug, Default)]
pub struct Pointer {
    down: Vec<(i32, Vec2)>,
    grab: Option<Grab>,
    hovered: Option<ArmPart>,
}

impl Pointer {
    /// The part of an arm with these angles under a pixel. The tip takes precedence within 16 CSS pixels.
    #[must_use]
    pub fn part_at(arm: &ArmMeshes, camera: &Camera, angles: Angles, at: Vec2) -> Option<ArmPart> {
        let is_tip = camera.project(tip_of(angles)).is_some_and(|tip| tip.distance(at) <= TIP_RADIUS);
        if is_tip {
            return Some(ArmPart::Tip);
        }
        arm.pick(angles, camera.ray(at)).map(|hit| ArmPart::of(hit.body))
    }

    /// Is a joint or the tip being dragged?
    #[must_use]
    pub const fn is_dragging(&self) -> bool {
        matches!(self.grab, Some(Grab::Joint(_) | Grab::Tip(_)))
    }

    /// Handles a pointer that went down: its identifier, position and button.
    pub fn down(
        &mut self,
        (id, at, button): (i32, Vec2, Button),
        arm: &ArmMeshes,
        camera: &Camera,
        angles: Angles,
    ) -> Option<SceneEvent> {
        self.down.retain(|(other, _)| *other != id);
        self.down.push((id, at));
        let was_dragging = self.is_dragging();
        self.grab = if self.down.len() > 1 {
            None
        } else if button == Button::Secondary {
            Some(Grab::Pan)
        } else {
            Some(grab(arm, camera, angles, at))
        };
        (was_dragging && !self.is_dragging()).then_some(SceneEvent::Released)
    }

    /// Handles a pointer that moved: its identifier and position.
    pub fn moved(
        &mut self,
        (id, at): (i32, Vec2),
        arm: &ArmMeshes,
        camera: &mut Camera,
        angles: Angles,
    ) -> Option<SceneEvent> {
        let Some(known) = self.down.iter_mut().find(|(other, _)| *other == id) else {
            return self.hover(Self::part_at(arm, camera, angles, at));
        };
        let before = std::mem::replace(&mut known.1, at);
        let moved = at - before;
        if let [(one, first), (_, second)] = self.down.as_slice() {
            let other = if *one == id { *second } else { *first };
            pinch(camera, other, before, at);
            return None;
        }
        match self.grab.as_mut()? {
            Grab::Orbit => camera.orbit(moved.x, moved.y),
            Grab::Pan => camera.pan(moved.x, moved.y),
            Grab::Joint(drag) => {
                let degrees = drag.to(at, angles, camera);
                return Some(SceneEvent::JointDragged { joint: drag.joint(), degrees });
            }
            Grab::Tip(drag) => return Some(SceneEvent::TipDragged(drag.to(at, camera))),
        }
        None
    }

    /// Handles a pointer that went up or was cancelled.
    pub fn up(&mut self, id: i32) -> Option<SceneEvent> {
        self.down.retain(|(other, _)| *other != id);
        let was_dragging = self.is_dragging();
        // After a pinch, the remaining finger turns the camera.
        self.grab = (!self.down.is_empty()).then_some(Grab::Orbit);
        was_dragging.then_some(SceneEvent::Released)
    }

    /// Handles a pointer that left the picture without being down.
    pub fn left(&mut self) -> Option<SceneEvent> {
        self.hover(None)
    }

    fn hover(&mut self, part: Option<ArmPart>) -> Option<SceneEvent> {
        let before = std::mem::replace(&mut self.hovered, part);
        (before != part).then_some(SceneEvent::Hovered(part))
    }
}

/// Zooms by a turn of the wheel, in CSS pixels; a positive number moves the camera away.
pub fn wheel(camera: &mut Camera, pixels: f32) {
    camera.zoom((pixels.clamp(-400.0, 400.0) * ZOOM_PER_PIXEL).exp());
}

/// Moves the camera by a key, named as in `KeyboardEvent.key`. Returns false if the key has no effect.
pub fn key(camera: &mut Camera, key: &str, shift: bool) -> bool {
    let step = 12.0;
    match (key, shift) {
        ("ArrowLeft", false) => camera.orbit(-step, 0.0),
        ("ArrowRight", false) => camera.orbit(step, 0.0),
        ("ArrowUp", false) => camera.orbit(0.0, -step),
        ("ArrowDown", false) => camera.orbit(0.0, step),
        ("ArrowLeft", true) => camera.pan(-step, 0.0),
        ("ArrowRight", true) => camera.pan(step, 0.0),
        ("ArrowUp", true) => camera.pan(0.0, -step),
        ("ArrowDown", true) => camera.pan(0.0, step),
        ("+" | "=", _) => camera.zoom(0.9),
        ("-", _) => camera.zoom(1.0 / 0.9),
        ("Home", _) => camera.look_from(super::camera::Preset::Corner),
        _ => return false,
    }
    true
}

fn grab(arm: &ArmMeshes, camera: &Camera, angles: Angles, at: Vec2) -> Grab {
    let joint = || {
        let hit = arm.pick(angles, camera.ray(at))?;
        JointDrag::start(hit, angles, camera, at).map(Grab::Joint)
    };
    let grabbed = match Pointer::part_at(arm, camera, angles, at) {
        Some(ArmPart::Tip) => TipDrag::start(angles, camera, at).map(Grab::Tip),
        Some(ArmPart::Joint(_)) => joint(),
        Some(ArmPart::Base) | None => None,
    };
    grabbed.unwrap_or(Grab::Orbit)
}

/// Handles the movement of one of two fingers: zooms and pans so that the scene follows both fingers.
fn pinch(camera: &mut Camera, other: Vec2, before: Vec2, at: Vec2) {
    let (old, new) = (other.distance(before).max(10.0), other.distance(at).max(10.0));
    camera.zoom(old / new);
    let moved = (at - before) / 2.0;
    camera.pan(moved.x, moved.y);
}

#[cfg(test)]
mod tests {
    use super::*;
    use arm_model::Body;
    use glam::Vec3;

    const POSE: Angles = [90.0, 115.0, 65.0, 90.0, 90.0, 90.0, 40.0];

    fn stage() -> (Pointer, ArmMeshes, Camera) {
        (Pointer::default(), ArmMeshes::default(), Camera::default())
    }

    fn on_rear_arm(camera: &Camera) -> Vec2 {
        let point = super::super::arm::point_of(POSE, Body::RearArm, Vec3::new(0.0, 30.0, 60.0));
        camera.project(point).expect("in front")
    }

    #[test]
    fn a_part_is_hovered_once_and_left_once() {
        let (mut pointer, arm, mut camera) = stage();
        let at = on_rear_arm(&camera);
        let hovered = Some(SceneEvent::Hovered(Some(ArmPart::Joint(2))));
        assert_eq!(pointer.moved((1, at), &arm, &mut camera, POSE), hovered);
        assert_eq!(pointer.moved((1, at + Vec2::X), &arm, &mut camera, POSE), None);
        assert_eq!(pointer.left(), Some(SceneEvent::Hovered(None)));
        assert_eq!(pointer.left(), None);
    }

    #[test]
    fn a_joint_is_dragged_and_released() {
        let (mut pointer, arm, mut camera) = stage();
        let at = on_rear_arm(&camera);
        assert_eq!(pointer.down((1, at, Button::Primary), &arm, &camera, POSE), None);
        assert!(pointer.is_dragging());
        let before = camera;
        let event = pointer.moved((1, at + Vec2::new(20.0, 0.0)), &arm, &mut camera, POSE);
        let Some(SceneEvent::JointDragged { joint: 2, degrees }) = event else { panic!("{event:?}") };
        assert!((degrees - 115.0).abs() > 3.0, "{degrees}");
        assert_eq!(camera, before, "the camera stays");
        assert_eq!(pointer.up(1), Some(SceneEvent::Released));
        assert!(!pointer.is_dragging());
    }

    #[test]
    fn the_tip_is_dragged_even_where_another_part_covers_it() {
        let (mut pointer, arm, mut camera) = stage();
        let at = camera.project(tip_of(POSE)).expect("in front");
        assert_eq!(Pointer::part_at(&arm, &camera, POSE, at), Some(ArmPart::Tip));
        pointer.down((1, at, Button::Primary), &arm, &camera, POSE);
        let event = pointer.moved((1, at + Vec2::new(0.0, 15.0)), &arm, &mut camera, POSE);
        let Some(SceneEvent::TipDragged(wish)) = event else { panic!("{event:?}") };
        let wanted = camera.project(wish.tip).expect("in front");
        assert!((wanted - at - Vec2::new(0.0, 15.0)).length() < 0.1);
    }

    #[test]
    fn elsewhere_the_camera_turns_pans_and_zooms() {
        let (mut pointer, arm, mut camera) = stage();
        let corner = Vec2::new(5.0, 5.0);
        let start = camera;
        pointer.down((1, corner, Button::Primary), &arm, &camera, POSE);
        assert_eq!(pointer.moved((1, corner + Vec2::X), &arm, &mut camera, POSE), None);
        let turned = camera;
        assert_ne!(turned, start);
        assert_eq!(pointer.up(1), None);
        pointer.down((1, corner, Button::Secondary), &arm, &camera, POSE);
        pointer.moved((1, corner + Vec2::X), &arm, &mut camera, POSE);
        assert_ne!(camera, turned);
        let middle = Vec2::new(640.0, 360.0);
        let scale = |camera: &Camera| camera.on_facing_plane(middle, Vec3::ZERO).distance(camera.position());
        let before = scale(&camera);
        wheel(&mut camera, -100.0);
        assert!(scale(&camera) < before);
    }

    #[test]
    fn a_second_finger_ends_a_drag_and_zooms() {
        let (mut pointer, arm, mut camera) = stage();
        let at = on_rear_arm(&camera);
        pointer.down((1, at, Button::Primary), &arm, &camera, POSE);
        let second = at + Vec2::new(100.0, 0.0);
        let released = pointer.down((2, second, Button::Primary), &arm, &camera, POSE);
        assert_eq!(released, Some(SceneEvent::Released));
        let before = camera.position();
        assert_eq!(pointer.moved((2, second + Vec2::new(50.0, 0.0)), &arm, &mut camera, POSE), None);
        assert!(camera.position().length() < before.length());
        assert_eq!((pointer.up(2), pointer.up(1)), (None, None));
    }

    #[test]
    fn keys_move_the_camera() {
        for name in ["ArrowLeft", "ArrowRight", "ArrowUp", "ArrowDown", "+", "-"] {
            let mut camera = Camera::default();
            assert!(key(&mut camera, name, false));
            assert_ne!(camera, Camera::default(), "{name}");
            assert!(key(&mut camera, "Home", false));
            assert_eq!(camera, Camera::default());
        }
        assert!(!key(&mut Camera::default(), "a", false));
    }
}
