//! What the scene shows.

use glam::Vec3;

use super::arm::{Angles, Part};
use super::theme::{Rgb, Theme};

/// A thing, as it is drawn.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Thing {
    /// Its middle, in mm.
    pub middle: Vec3,
    /// Its axes, each as long as half of its size.
    pub axes: [Vec3; 3],
    /// It is a cylinder along its third axis.
    pub is_round: bool,
    /// The colour that its name says.
    pub named: Option<Rgb>,
    /// It never moves.
    pub is_wall: bool,
}

/// What the scene shows. Two equal views have the same picture.
#[derive(Clone, Debug, PartialEq)]
pub struct View {
    /// Measured angles of joints 1 to 7, in degrees.
    pub measured: Angles,
    /// Angles of the ghost: targets, a moment of a time line, or the nearest pose to a position out of reach. It is drawn where any joint differs
    /// from the measured angle by more than a degree.
    pub targets: Option<Angles>,
    /// The colours of joints 1 to 7: see [`Palette::joint_ok`](super::theme::Palette::joint_ok) and its neighbours.
    pub colours: [Rgb; 7],
    /// A wanted position of the tip, in mm, that the arm cannot reach.
    pub unreachable: Option<Vec3>,
    /// What stands on the table, and what the arm carries.
    pub things: Vec<Thing>,
    /// The part under the pointer or with the keyboard's focus.
    pub hovered: Option<Part>,
    /// Light or dark.
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
    /// The angles of the ghost, where it can be told from the arm.
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
