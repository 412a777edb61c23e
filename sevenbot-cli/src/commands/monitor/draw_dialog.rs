//! Draws a dialog above the view: the help, or a question about the motor state.

use ratatui::Frame;
use ratatui::layout::Rect;
use ratatui::text::Line;
use ratatui::widgets::{Block, Clear, Paragraph};
use sevenbot::map::motor_state;

use super::keys::HELP;
use super::view::Dialog;

/// Draws a dialog in the middle of the screen.
pub(super) fn draw_dialog(frame: &mut Frame<'_>, dialog: Dialog) {
    let (title, lines) = match dialog {
        Dialog::Help => (" keys ", HELP.map(|(keys, what)| format!(" {keys:<18}{what}")).to_vec()),
        Dialog::ChooseState => (" motor state ", CHOICES.map(str::to_owned).to_vec()),
        Dialog::ConfirmState(state) => (" motor state ", question(state)),
    };
    let width = lines.iter().map(|line| line.chars().count()).max().unwrap_or(0) + 3;
    let area = centred(frame.area(), width, lines.len() + 2);
    frame.render_widget(Clear, area);
    let text: Vec<Line<'_>> = lines.into_iter().map(Line::from).collect();
    frame.render_widget(Paragraph::new(text).block(Block::bordered().title(title)), area);
}

const CHOICES: [&str; 4] = [
    " h  servo: hold where it is",
    " d  damping: the arm sinks slowly",
    " f  forceless: the arm falls",
    " any other key changes nothing",
];

fn question(state: u8) -> Vec<String> {
    let falls = if state == motor_state::FORCELESS { "fall" } else { "sink" };
    vec![
        format!(" The arm will {falls}. Hold it with your hand."),
        " Let it go?  y: yes   any other key: no".to_owned(),
    ]
}

fn centred(area: Rect, width: usize, height: usize) -> Rect {
    let fit = |wanted: usize, there: u16| u16::try_from(wanted).unwrap_or(u16::MAX).min(there);
    let (width, height) = (fit(width, area.width), fit(height, area.height));
    let (x, y) = (area.x + (area.width - width) / 2, area.y + (area.height - height) / 2);
    Rect { x, y, width, height }
}
