//! The keys during a recording: pump, end, and nudges while the motors are on. Also shows the progress. Works only on a
//! terminal.

use std::io::{self, IsTerminal};
use std::time::Duration;

use ratatui::crossterm::event::{self, Event, KeyCode, KeyEvent, KeyEventKind, KeyModifiers};
use ratatui::crossterm::terminal::{disable_raw_mode, enable_raw_mode};
use sevenbot::map::VACUUM_PUMP;
use sevenbot::moves::JointMove;
use sevenbot::{Angle, Arm, Joint};

use crate::command_error::CommandError;
use crate::interrupt::Interrupt;
use crate::progress::Progress;

/// Keys and progress line of a recording.
pub(crate) struct TeachPendant {
    has_keys: bool,
    targets: [Angle; 7],
    vacuum: bool,
    is_driven: bool,
    selected: Joint,
    progress: Progress,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum KeyCommand {
    End,
    /// End, and make the arm hold its position.
    Stop,
    SwitchPump,
    Select(Joint),
    /// Degrees.
    Nudge(i16),
}

impl TeachPendant {
    /// Switches the terminal to raw mode, if there is one.
    pub(crate) fn new(targets: [Angle; 7], vacuum: bool, is_driven: bool) -> Self {
        let has_keys = io::stdin().is_terminal() && io::stderr().is_terminal() && enable_raw_mode().is_ok();
        let progress = Progress::endless("moments");
        Self { has_keys, targets, vacuum, is_driven, selected: Joint::ALL[0], progress }
    }

    /// Is the pump on?
    pub(crate) const fn vacuum(&self) -> bool {
        self.vacuum
    }

    pub(crate) fn show(&self, moments: u64, time: Duration) {
        self.progress.set(moments);
        let seconds = time.as_secs_f64();
        let pump = if self.vacuum { "sucks" } else { "off" };
        let nudge = match self.is_driven {
            true => format!("  1-7 ← → Shift: nudge (joint {})", self.selected.number()),
            false => String::new(),
        };
        let keys =
            if self.has_keys { format!("   v: pump{nudge}  space: stop  q: end") } else { String::new() };
        self.progress.say(&format!("{seconds:.1} s  pump {pump}{keys}"));
    }

    /// Executes the commands of all pressed keys; `true` ends the recording.
    pub(crate) fn poll_keys(&mut self, arm: &mut Arm) -> Result<bool, CommandError> {
        while self.has_keys && event::poll(Duration::ZERO)? {
            let Event::Key(key) = event::read()? else { continue };
            match command(key, self.selected) {
                Some(KeyCommand::End) => return Ok(true),
                Some(KeyCommand::Stop) => {
                    Interrupt::request();
                    return Ok(true);
                }
                Some(KeyCommand::SwitchPump) => self.switch_pump(arm)?,
                Some(KeyCommand::Select(joint)) => self.selected = joint,
                Some(KeyCommand::Nudge(degrees)) if self.is_driven => self.nudge(arm, degrees)?,
                _ => {}
            }
        }
        Ok(false)
    }

    fn switch_pump(&mut self, arm: &mut Arm) -> Result<(), CommandError> {
        self.vacuum = !self.vacuum;
        Ok(arm.write_checked(VACUUM_PUMP.address, &[u8::from(self.vacuum)])?)
    }

    fn nudge(&mut self, arm: &mut Arm, degrees: i16) -> Result<(), CommandError> {
        let targets = self.targets.iter_mut().zip(Joint::ALL);
        for (target, joint) in targets.filter(|(_, joint)| *joint == self.selected) {
            let wanted = i16::from(target.degrees()) + degrees;
            let wanted = u8::try_from(wanted.max(0)).unwrap_or(Angle::MAX_DEGREES);
            *target = Angle::from_register(wanted);
            let wanted = target.degrees();
            JointMove::begin(arm, Joint::ALL.map(|other| (other == joint).then_some(wanted)))?;
        }
        Ok(())
    }
}

impl Drop for TeachPendant {
    fn drop(&mut self) {
        if self.has_keys {
            let _ = disable_raw_mode();
        }
    }
}

fn command(key: KeyEvent, selected: Joint) -> Option<KeyCommand> {
    // Some terminals also report key releases.
    if key.kind == KeyEventKind::Release {
        return None;
    }
    let degrees = if key.modifiers.contains(KeyModifiers::SHIFT) { 10 } else { 1 };
    let is_control = key.modifiers.contains(KeyModifiers::CONTROL);
    let select = |number: u8| Joint::new(number).map(KeyCommand::Select);
    match key.code {
        KeyCode::Char('c') if is_control => Some(KeyCommand::Stop),
        KeyCode::Char('q') | KeyCode::Esc | KeyCode::Enter => Some(KeyCommand::End),
        KeyCode::Char(' ') => Some(KeyCommand::Stop),
        KeyCode::Char('v') => Some(KeyCommand::SwitchPump),
        KeyCode::Char(digit) => select(u8::try_from(digit.to_digit(10)?).ok()?),
        KeyCode::Up => select(selected.number().saturating_sub(1)),
        KeyCode::Down => select(selected.number().saturating_add(1)),
        KeyCode::Left => Some(KeyCommand::Nudge(-degrees)),
        KeyCode::Right => Some(KeyCommand::Nudge(degrees)),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn keys_give_the_commands_in_the_help_line() {
        let first = Joint::ALL[0];
        let plain = |code| command(KeyEvent::from(code), first);
        assert_eq!(plain(KeyCode::Char(' ')), Some(KeyCommand::Stop));
        assert_eq!(plain(KeyCode::Char('v')), Some(KeyCommand::SwitchPump));
        assert_eq!(plain(KeyCode::Char('q')), Some(KeyCommand::End));
        assert_eq!(plain(KeyCode::Char('7')), Some(KeyCommand::Select(Joint::ALL[6])));
        assert_eq!(plain(KeyCode::Char('8')), None);
        assert_eq!(plain(KeyCode::Up), None, "there is nothing above the first");
        assert_eq!(plain(KeyCode::Left), Some(KeyCommand::Nudge(-1)));
        let ctrl_c = KeyEvent::new(KeyCode::Char('c'), KeyModifiers::CONTROL);
        assert_eq!(command(ctrl_c, first), Some(KeyCommand::Stop));
        let shifted = KeyEvent::new(KeyCode::Right, KeyModifiers::SHIFT);
        assert_eq!(command(shifted, first), Some(KeyCommand::Nudge(10)));
    }
}
