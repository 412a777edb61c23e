//! The keys of the monitor: they change the view, send commands, or end the monitor.

use ratatui::crossterm::event::{KeyCode, KeyEvent, KeyModifiers};
use sevenbot::Joint;
use sevenbot::cartesian::JogAxes;
use sevenbot::map::motor_state;

use super::plot_kind::PlotKind;
use super::view::{Dialog, MonitorView, SpeedChange, UiCommand};

/// Degrees of a nudge, without and with Shift.
const NUDGE: i16 = 1;
const BIG_NUDGE: i16 = 10;
/// Millimetres of a step of the tip, without and with Shift. A degree of joint 1 moves the tip by up to 6.5 mm.
const JOG: i16 = 5;
const BIG_JOG: i16 = 20;
/// The help: keys and their effect.
pub(crate) const HELP: [(&str, &str); 13] = [
    // A low screen shows only the first rows.
    ("space", "stop the arm where it is"),
    ("Ctrl-C", "stop the arm where it is, and quit"),
    ("q", "quit; the arm finishes its move"),
    ("1..7, ↑ ↓", "select a joint"),
    ("← →", "nudge it by 1°"),
    ("Shift ← →, [ ]", "nudge it by 10°"),
    ("j", "arrows move the tip: base axes, tool axes, off"),
    ("← → ↑ ↓ PgUp/Dn", "then x, y and z by 5 mm, with Shift by 20"),
    ("+ -", "speed of all joints"),
    ("s", "motor state: hold, damping, forceless"),
    ("p", "plot positions, velocities or loads"),
    ("f", "freeze the screen; the arm continues"),
    ("?", "this help; any key closes it"),
];

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum KeyAction {
    Redraw,
    Send(UiCommand),
    /// End the monitor. The arm finishes its move.
    Quit,
    /// Make the arm hold its position, and end the monitor.
    Stop,
}

/// Applies a key to the view. Ctrl-C works in every dialog.
pub(crate) fn press(view: &mut MonitorView, key: KeyEvent) -> KeyAction {
    let is_ctrl_c = key.code == KeyCode::Char('c') && key.modifiers.contains(KeyModifiers::CONTROL);
    if is_ctrl_c {
        return KeyAction::Stop;
    }
    match view.dialog {
        None => press_in_view(view, key),
        Some(dialog) => press_in_dialog(view, dialog, key.code),
    }
}

fn press_in_view(view: &mut MonitorView, key: KeyEvent) -> KeyAction {
    let is_shifted = key.modifiers.contains(KeyModifiers::SHIFT);
    let degrees = if is_shifted { BIG_NUDGE } else { NUDGE };
    let millimetres = if is_shifted { BIG_JOG } else { JOG };
    if let Some((axes, millimetres)) = view.jog.zip(jog_step(key.code, millimetres)) {
        return drive(view, UiCommand::Jog { axes, millimetres });
    }
    match key.code {
        KeyCode::Char('q') | KeyCode::Esc => return KeyAction::Quit,
        KeyCode::Char('?' | 'h') | KeyCode::F(1) => view.dialog = Some(Dialog::Help),
        KeyCode::Char(' ') => return stop(view),
        KeyCode::Char('f') => view.is_frozen = !view.is_frozen,
        KeyCode::Char('p') => change_plot(view),
        KeyCode::Char('j') => view.jog = next_axes(view.jog),
        KeyCode::Char('s') => view.dialog = Some(Dialog::ChooseState),
        KeyCode::Char(digit @ '1'..='7') => {
            select(view, i16::from(u8::try_from(digit).unwrap_or(b'1') - b'0'))
        }
        KeyCode::Up => select(view, i16::from(view.selected.number()) - 1),
        KeyCode::Down => select(view, i16::from(view.selected.number()) + 1),
        KeyCode::Left => return nudge(view, -degrees),
        KeyCode::Right => return nudge(view, degrees),
        // Some terminals do not report Shift with an arrow key.
        KeyCode::Char('[') => return nudge(view, -BIG_NUDGE),
        KeyCode::Char(']') => return nudge(view, BIG_NUDGE),
        KeyCode::Char('+' | '=') => return change(view, SpeedChange::Faster),
        KeyCode::Char('-' | '_') => return change(view, SpeedChange::Slower),
        _ => {}
    }
    KeyAction::Redraw
}

fn press_in_dialog(view: &mut MonitorView, dialog: Dialog, key: KeyCode) -> KeyAction {
    view.dialog = None;
    match (dialog, key) {
        (Dialog::ChooseState, KeyCode::Char('h' | '1')) => {
            KeyAction::Send(UiCommand::State(motor_state::SERVO))
        }
        (Dialog::ChooseState, KeyCode::Char('d' | '0')) => release(view, motor_state::DAMPING),
        (Dialog::ChooseState, KeyCode::Char('f' | '2')) => release(view, motor_state::FORCELESS),
        (Dialog::ConfirmState(state), KeyCode::Char('y' | 'Y')) => KeyAction::Send(UiCommand::State(state)),
        _ => KeyAction::Redraw,
    }
}

/// Asks for confirmation, because the arm may sink or fall.
fn release(view: &mut MonitorView, state: u8) -> KeyAction {
    view.dialog = Some(Dialog::ConfirmState(state));
    KeyAction::Redraw
}

fn select(view: &mut MonitorView, number: i16) {
    if let Some(joint) = u8::try_from(number).ok().and_then(Joint::new) {
        view.selected = joint;
    }
}

/// Shows the next quantity in the plot, unless the arm is known to measure positions only.
fn change_plot(view: &mut MonitorView) {
    if view.sample.as_ref().is_some_and(|sample| sample.fine.is_none()) {
        view.plot = PlotKind::Position;
        view.show_note("this arm's firmware measures no velocities and loads");
    } else {
        view.plot = view.plot.next();
    }
}

/// The step of the tip for a key: x, y and z in millimetres.
const fn jog_step(key: KeyCode, millimetres: i16) -> Option<[i16; 3]> {
    match key {
        KeyCode::Left => Some([-millimetres, 0, 0]),
        KeyCode::Right => Some([millimetres, 0, 0]),
        KeyCode::Up => Some([0, millimetres, 0]),
        KeyCode::Down => Some([0, -millimetres, 0]),
        KeyCode::PageUp => Some([0, 0, millimetres]),
        KeyCode::PageDown => Some([0, 0, -millimetres]),
        _ => None,
    }
}

const fn next_axes(axes: Option<JogAxes>) -> Option<JogAxes> {
    match axes {
        None => Some(JogAxes::Base),
        Some(JogAxes::Base) => Some(JogAxes::Tool),
        Some(JogAxes::Tool) => None,
    }
}

fn nudge(view: &mut MonitorView, degrees: i16) -> KeyAction {
    drive(view, UiCommand::Nudge { joint: view.selected, degrees })
}

/// Sends a command that moves the arm, if the motors drive it.
fn drive(view: &mut MonitorView, command: UiCommand) -> KeyAction {
    match view.motor_state() {
        Some(motor_state::SERVO) => KeyAction::Send(command),
        Some(_) => {
            view.show_note("the motors are off: s, then h, makes the arm hold where it is");
            KeyAction::Redraw
        }
        None => {
            view.show_note("there is no arm: nothing was written");
            KeyAction::Redraw
        }
    }
}

fn stop(view: &mut MonitorView) -> KeyAction {
    if view.arm().is_some() {
        view.show_note("stopped: the arm holds where it is");
        return KeyAction::Send(UiCommand::Stop);
    }
    view.show_note("there is no arm: it received no stop");
    KeyAction::Redraw
}

fn change(view: &MonitorView, change: SpeedChange) -> KeyAction {
    view.arm().map_or(KeyAction::Redraw, |_| {
        KeyAction::Send(UiCommand::SpeedChange { joint: view.selected, change })
    })
}

/// The keys that move the tip.
pub(super) const fn jog_keys(axes: Option<JogAxes>) -> &'static str {
    match axes {
        Some(JogAxes::Tool) => {
            " tip, tool axes: ←→ x  ↑↓ y  PgUp PgDn z, along the tool  Shift 20 mm  j: axes"
        }
        _ => " tip, base axes: ←→ x  ↑↓ y  PgUp PgDn z, up and down  Shift 20 mm  j: axes",
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::commands::monitor::view::ArmEvent;
    use crate::commands::monitor::view::tests::{sample_in, watching};

    fn pressed(view: &mut MonitorView, keys: &[KeyCode]) -> Vec<KeyAction> {
        keys.iter().map(|&key| press(view, KeyEvent::from(key))).collect()
    }

    #[test]
    fn arrows_choose_a_joint_and_nudge_it() {
        let mut view = watching();
        let outcomes = pressed(&mut view, &[KeyCode::Up, KeyCode::Char('3'), KeyCode::Down, KeyCode::Left]);
        let joint = Joint::ALL[3];
        assert_eq!(outcomes[3], KeyAction::Send(UiCommand::Nudge { joint, degrees: -1 }));
        let shifted = KeyEvent::new(KeyCode::Right, KeyModifiers::SHIFT);
        assert_eq!(press(&mut view, shifted), KeyAction::Send(UiCommand::Nudge { joint, degrees: 10 }));
    }

    #[test]
    fn arrows_move_the_tip_in_base_and_tool_axes() {
        let mut view = watching();
        let keys = [KeyCode::Char('j'), KeyCode::Left, KeyCode::PageUp, KeyCode::Char('j'), KeyCode::Up];
        let actions = pressed(&mut view, &keys);
        let jog = |axes, millimetres| KeyAction::Send(UiCommand::Jog { axes, millimetres });
        assert_eq!(actions[1], jog(JogAxes::Base, [-5, 0, 0]));
        assert_eq!(actions[2], jog(JogAxes::Base, [0, 0, 5]));
        assert_eq!(actions[4], jog(JogAxes::Tool, [0, 5, 0]));
        let shifted = KeyEvent::new(KeyCode::PageDown, KeyModifiers::SHIFT);
        assert_eq!(press(&mut view, shifted), jog(JogAxes::Tool, [0, 0, -20]));
        pressed(&mut view, &[KeyCode::Char('j'), KeyCode::Down]);
        assert_eq!((view.jog, view.selected), (None, Joint::ALL[1]), "the arrows select joints again");
    }

    #[test]
    fn only_a_state_without_torque_is_confirmed() {
        let mut view = watching();
        let let_go = [KeyCode::Char('s'), KeyCode::Char('f'), KeyCode::Char('y')];
        let outcomes = pressed(&mut view, &let_go);
        assert_eq!(outcomes, [KeyAction::Redraw, KeyAction::Redraw, KeyAction::Send(UiCommand::State(2))]);
        let changed_my_mind = [KeyCode::Char('s'), KeyCode::Char('d'), KeyCode::Enter];
        assert_eq!(pressed(&mut view, &changed_my_mind), [KeyAction::Redraw; 3]);
        assert_eq!(view.dialog, None);
        let hold = pressed(&mut view, &[KeyCode::Char('s'), KeyCode::Char('h')]);
        assert_eq!(hold[1], KeyAction::Send(UiCommand::State(1)));
    }

    #[test]
    fn ctrl_c_quits_even_from_a_dialog() {
        let mut view = watching();
        pressed(&mut view, &[KeyCode::Char('?')]);
        assert_eq!(view.dialog, Some(Dialog::Help));
        let ctrl_c = KeyEvent::new(KeyCode::Char('c'), KeyModifiers::CONTROL);
        assert_eq!(press(&mut view, ctrl_c), KeyAction::Stop);
    }

    #[test]
    fn a_frozen_screen_does_not_hide_motors_that_are_off() {
        let mut view = watching();
        view.is_frozen = true;
        view.update(ArmEvent::Sample(sample_in(motor_state::FORCELESS, 20_000, 120)));
        assert_eq!(pressed(&mut view, &[KeyCode::Left]), [KeyAction::Redraw]);
        assert_eq!(view.note().map(|note| note.contains("the motors are off")), Some(true));
    }

    #[test]
    fn an_arm_without_velocities_shows_positions() {
        let mut view = watching();
        view.plot = PlotKind::Load;
        pressed(&mut view, &[KeyCode::Char('p')]);
        assert_eq!(view.plot, PlotKind::Position);
    }

    #[test]
    fn the_space_bar_stops_the_arm() {
        let mut view = watching();
        assert_eq!(
            pressed(&mut view, &[KeyCode::Char('f'), KeyCode::Char(' ')])[1],
            KeyAction::Send(UiCommand::Stop)
        );
        assert!(view.is_frozen, "only the screen is frozen");
    }

    #[test]
    fn without_an_arm_keys_send_nothing() {
        let mut view = MonitorView::new("COM3", PlotKind::Position);
        let keys = [KeyCode::Left, KeyCode::Char('+'), KeyCode::Char(']'), KeyCode::Char('j'), KeyCode::Up];
        assert_eq!(pressed(&mut view, &keys), [KeyAction::Redraw; 5]);
    }
}
