//! The content of a picture of the scene.

use glam::Vec3;

use super::arm::{Angles, ArmPart};
use super::theme::{Rgb, Theme};

/// A box or cylinder in the scene.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DrawnThing {
    /// Its middle, in mm.
    pub middle: Vec3,
    /// Its axes. The length of each one is half of the size along it, in mm.
    pub axes: [Vec3; 3],
    /// True for a cylinder along the third axis, false for a box.
    pub is_round: bool,
    /// The colour whose name is the beginning of the thing's name, such as `red`; `None` if there is none.
    pub named: Option<Rgb>,
    /// True for a wall, which never moves.
    pub is_wall: bool,
}

/// The content of a picture. Two equal views give the same picture from the same camera.
#[derive(Clone, Debug, PartialEq)]
pub struct View {
    /// Measured angles of joints 1 to 7, in degrees.
    pub measured: Angles,
    /// Angles of the ghost in degrees: the targets, or a moment of a time line. See [`Self::ghost`].
    pub targets: Option<Angles>,
    /// The colours of joints 1 to 7: see [`Palette::joint_ok`](super::theme::Palette::joint_ok) and its neighbours.
    pub colours: [Rgb; 7],
    /// A wanted position of the tip, in mm, to which the arm does not go: out of reach, or refused by the guard of the workspace.
    pub unreachable: Option<Vec3>,
    /// The walls, the things on the table, and the thing that the arm carries.
    pub things: Vec<DrawnThing>,
    /// The part under the pointer; `None` if the pointer is over no part.
    pub hovered: Option<ArmPart>,
    /// The theme of the page: light or dark.
    pub theme: Theme,
}

impl Default for View {
    fn default() -> Self {
        Self {
            measured: [90.0, 115.0, 65.0, 90.0, 90.0, 90.0, 40.0],
            targets: None,
            colours: [Theme::Light.palette().joint_ok; 7],
            unreachable: None,
            things: Vec::new(),
            hovered: None,
            theme: Theme::Light,
        }
    }
}

impl View {
    /// The angles of the ghost. `None` if no ghost is drawn: there are no `targets`, or no joint differs from its measured angle
    /// by more than 1 degree.
    #[must_use]
    pub fn ghost(&self) -> Option<Angles> {
        let differs = |ghost: &Angles| {
            ghost.iter().zip(self.measured).any(|(target, measured)| (target - measured).abs() > 1.0)
        };
        self.targets.filter(differs)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_ghost_in_the_place_of_the_arm_is_not_drawn() {
        let mut view = View { targets: Some(View::default().measured), ..View::default() };
        assert_eq!(view.ghost(), None);
        view.measured[4] += 1.5;
        assert_eq!(view.ghost(), view.targets);
    }
}
