//! Draws the arm in 3D and the plot, and updates the panels, before each picture of the browser.

use arm_sim::world::World;
use sevenbot::map::{fault, motor_state};

use super::page::{App, ArmLine, whole};
use super::panels;
use crate::arm_state::ArmState;
use crate::plots::{Plot, PlottedQuantity, draw};
use crate::scene::{Rgb, Theme, View, things};

/// The plot is drawn with every third picture.
const PLOT_PERIOD: u32 = 3;

impl App {
    fn theme(&self) -> Theme {
        let query =
            web_sys::window().and_then(|window| window.match_media("(prefers-color-scheme: dark)").ok()?);
        if query.is_some_and(|query| query.matches()) { Theme::Dark } else { Theme::Light }
    }

    pub(super) fn show(&mut self) {
        let (state, theme) = (self.client.state(), self.theme());
        let view = View {
            measured: state.angles(),
            targets: self
                .time_lines
                .angles()
                .or((state.motor_state == motor_state::SERVO).then_some(state.targets)),
            colours: colours(&state, theme),
            unreachable: self.unreachable.map(|(tip, _)| tip),
            things: self.world().map(things).unwrap_or_default(),
            hovered: self.hovered,
            theme,
        };
        if let Some(scene) = &mut self.scene
            && let Err(reason) = scene.draw(&view)
        {
            self.dom.no_picture(self.language, &reason);
        }
        // Drawing the plot takes as much time as drawing the arm, and the plot needs fewer updates.
        if self.frames.is_multiple_of(PLOT_PERIOD) {
            self.show_plot(theme);
        }
        panels::show(self, &state);
    }

    /// The room of the simulated arm; `None` for a real arm, or without a room.
    pub(super) fn world(&self) -> Option<&World> {
        match &self.line {
            ArmLine::Simulated(source) => source.simulation().plant().world(),
            _ => None,
        }
    }

    fn show_plot(&self, theme: Theme) {
        let Some(canvas) = self.plot.canvas() else { return };
        let ratio = web_sys::window().map_or(1.0, |window| window.device_pixel_ratio());
        let size = [canvas.client_width(), canvas.client_height()].map(f64::from);
        let [width, height] = size.map(|length| u32::try_from(whole(length * ratio)).unwrap_or(0));
        if [canvas.width(), canvas.height()] != [width, height] {
            canvas.set_width(width);
            canvas.set_height(height);
        }
        let (name, unit) = match self.quantity {
            PlottedQuantity::Angle => ("angle", "°"),
            PlottedQuantity::Load => ("load", "%"),
            PlottedQuantity::Velocity => ("velocity", "°/s"),
        };
        let title = format!("{} ({unit})", self.language.text(name));
        let (quantity, shown) = (self.quantity, [true; 7]);
        let plot = Plot { quantity, title: &title, seconds: "s", shown, theme, size, ratio };
        // It fails only for an invalid context.
        let _ = draw(&self.plot, &plot, &self.history);
    }
}

/// The colour of each joint. A problem of the joint takes precedence over the state of the motors.
fn colours(state: &ArmState, theme: Theme) -> [Rgb; 7] {
    let palette = theme.palette();
    // If only the fault bit of the servo bus is set, the arm does not tell the joint. Then mark all joints.
    let is_unknown = state.faults & fault::SERVO_BUS != 0 && state.missing | state.stalled == 0;
    let faulty = if is_unknown { u8::MAX } else { state.stalled };
    std::array::from_fn(|index| {
        if state.missing >> index & 1 == 1 {
            palette.joint_missing
        } else if faulty >> index & 1 == 1 {
            palette.joint_fault
        } else if state.motor_state != motor_state::SERVO {
            palette.joint_limp
        } else {
            palette.joint_ok
        }
    })
}
