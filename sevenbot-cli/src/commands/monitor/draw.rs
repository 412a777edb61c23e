//! Draws the view on a screen of any size: table of joints, plot of 20 s, health, link, keys.
//!
//! ```text
//!   7Bot V2  /dev/ttyUSB0  firmware 3.0                       servo      title
//!   joint   target  position     speed                                   table
//!   ▸ 1       120°       97°   57.0 °/s   moving     ─────●──◇────
//!   180°│        ...                                                     plot
//!   faults none   supply 7.4 V   hottest servo 31 °C                     foot
//! ```
//!
//! Knows only the view.

use std::time::Duration;

use ratatui::Frame;
use ratatui::layout::{Alignment, Constraint, Layout, Rect};
use ratatui::style::{Color, Modifier, Style};
use ratatui::symbols::Marker;
use ratatui::text::{Line, Span};
use ratatui::widgets::{Axis, Chart, Dataset, GraphType, Paragraph};
use sevenbot::cartesian::PointText;
use sevenbot::map::motor_state;
use sevenbot::register_text::{faults, joints, motor_state_name};
use sevenbot::{Angle, Joint};

use super::draw_dialog::draw_dialog;
use super::keys::jog_keys;
use super::plot_kind::{PastSample, PlotKind};
use super::sample::ArmSample;
use super::view::{LinkState, MonitorView, PLOT_SPAN};

/// One colour per joint, from the palette of the terminal, which users can change.
const COLOURS: [Color; 7] =
    [Color::Red, Color::Yellow, Color::Green, Color::Cyan, Color::Blue, Color::Magenta, Color::Gray];
const FAINT: Style = Style::new().fg(Color::DarkGray);
const BAD: Style = Style::new().fg(Color::Red).add_modifier(Modifier::BOLD);
const GOOD: Style = Style::new().fg(Color::Green);
const BOLD: Style = Style::new().add_modifier(Modifier::BOLD);
/// A longer gap between two samples interrupts the curve.
const LONGEST_GAP: Duration = Duration::from_millis(1500);
/// Width of the table without its bars, in columns.
const TABLE_WIDTH: usize = 49;

/// Number of problems that the foot of the screen shows in full.
const PROBLEMS_SHOWN: usize = 2;
/// Height of the table: a header and seven joints.
const JOINT_ROWS: u16 = 8;
/// From this height on there are empty lines around the plot.
const ROOMY: u16 = 18;

pub(crate) fn draw(frame: &mut Frame<'_>, view: &MonitorView) {
    let problems = problem_lines(view);
    let heights = heights(frame.area().height, u16::try_from(problems.len()).unwrap_or(0));
    let [title, table, _, plot, _, foot, keys] = Layout::vertical(heights).areas(frame.area());
    frame.render_widget(Paragraph::new(title_left(view)), title);
    frame.render_widget(Paragraph::new(title_right(view)).alignment(Alignment::Right), title);
    frame.render_widget(Paragraph::new(table_lines(view, table.width)), table);
    draw_plot(frame, view, plot);
    // The values of a lost arm are old, so draw them faint.
    let age = if view.arm().is_some() { Style::new() } else { FAINT };
    let lines: Vec<Line<'_>> = problems.into_iter().chain([health(view), link(view)]).collect();
    frame.render_widget(Paragraph::new(lines).style(age), foot);
    frame.render_widget(Paragraph::new(last_line(view)), keys);
    if let Some(dialog) = view.dialog {
        draw_dialog(frame, dialog);
    }
}

/// Heights of title, table, gap, plot, gap, foot and keys. A low screen loses the plot first and the table last.
fn heights(screen: u16, problem_lines: u16) -> [Constraint; 7] {
    let (gap, joints) = match screen {
        ROOMY.. => (1, Constraint::Length(JOINT_ROWS)),
        _ => (0, Constraint::Min(JOINT_ROWS)),
    };
    [
        Constraint::Length(1),
        joints,
        Constraint::Length(gap),
        Constraint::Fill(1),
        Constraint::Length(gap),
        Constraint::Length(2 + problem_lines),
        Constraint::Length(1),
    ]
}

/// The most important problems, each with its remedy below it.
fn problem_lines(view: &MonitorView) -> Vec<Line<'static>> {
    let problems = view.sample.as_ref().map(|sample| sample.health.problems()).unwrap_or_default();
    let shown = problems.iter().take(PROBLEMS_SHOWN);
    let lines = shown.flat_map(|problem| {
        [Line::styled(format!(" {problem}"), BAD), Line::raw(format!("   - {}", problem.kind.remedy()))]
    });
    let more = problems.len().saturating_sub(PROBLEMS_SHOWN);
    let rest = (more > 0).then(|| Line::styled(format!(" and {more} more: `sevenbot status`"), BAD));
    lines.chain(rest).collect()
}

fn title_left(view: &MonitorView) -> Line<'_> {
    let mut line = Line::from(vec![Span::styled(" 7Bot V2 ", BOLD), Span::raw(format!(" {}", view.port))]);
    if let LinkState::Open { firmware } = &view.connection {
        line.push_span(Span::styled(format!("  firmware {firmware}"), FAINT));
    }
    line
}

fn title_right(view: &MonitorView) -> Line<'static> {
    let state = match (&view.connection, view.arm()) {
        (LinkState::Looking(_), _) => Span::styled("no arm, looking again ", BAD),
        (LinkState::Open { .. }, None) => Span::styled("connected ", FAINT),
        (LinkState::Open { .. }, Some(sample)) => {
            let state = sample.joints.motor_state();
            let style = if state == motor_state::SERVO { GOOD } else { BAD };
            Span::styled(format!("{} ", motor_state_name(state)), style)
        }
    };
    let frozen = view.is_frozen.then(|| Span::styled("frozen  ", BOLD));
    Line::from_iter(frozen.into_iter().chain([state]))
}

fn table_lines(view: &MonitorView, width: u16) -> Vec<Line<'static>> {
    let mut head = "   joint  target  position       speed".to_owned();
    if view.plot != PlotKind::Position {
        head = format!("{head:<TABLE_WIDTH$}{}", view.plot.name());
    }
    let mut lines = vec![Line::from(Span::styled(head, BOLD))];
    let bar = usize::from(width).saturating_sub(TABLE_WIDTH + 2);
    lines.extend(Joint::ALL.map(|joint| match &view.sample {
        Some(sample) => row(view, sample, joint, bar),
        None => Line::from(vec![marker(view, joint), number(joint), Span::styled("       –", FAINT)]),
    }));
    lines
}

fn marker(view: &MonitorView, joint: Joint) -> Span<'static> {
    Span::styled(if joint == view.selected { " ▸ " } else { "   " }, BOLD)
}

fn number(joint: Joint) -> Span<'static> {
    Span::styled(format!("{:^5}", joint.number()), colour(joint))
}

fn colour(joint: Joint) -> Style {
    let index = usize::from(joint.number()).wrapping_sub(1);
    Style::new().fg(COLOURS.get(index).copied().unwrap_or(Color::Reset))
}

fn row(view: &MonitorView, sample: &ArmSample, joint: Joint, bar: usize) -> Line<'static> {
    let (target, present) = (sample.joints.target(joint), sample.joints.present(joint));
    let stale = if view.arm().is_some() { Style::new() } else { FAINT };
    let (word, style) = joint_word(sample, joint);
    let speed = sample.joints.speed(joint).degrees_per_second();
    let numbers = format!("  {target:>5}°  {present:>7}°  {speed:>5.1} °/s  ");
    let mut spans = vec![marker(view, joint), number(joint)];
    spans.extend([Span::styled(numbers, stale), Span::styled(format!("{word:<10}"), style)]);
    match (view.plot, PastSample::from(sample).value(view.plot, joint)) {
        (PlotKind::Position, _) => spans.extend(bar_spans(bar, target, present, colour(joint))),
        (_, Some(value)) => spans.push(Span::styled(format!("{value:>7.1}"), stale)),
        (_, None) => spans.push(Span::styled("      –", FAINT)),
    }
    Line::from(spans)
}

/// The most important problem of a joint, or its activity.
fn joint_word(sample: &ArmSample, joint: Joint) -> (&'static str, Style) {
    let health = sample.health.joints.iter().find(|health| health.joint == joint);
    let problem = health.and_then(|health| health.problems().next());
    let is_gripping = health.is_some_and(|health| health.is_gripping == Some(true));
    match (problem, sample.joints.is_moving(joint)) {
        (Some(problem), _) => (problem.name(), BAD),
        _ if is_gripping => ("holding", Style::new()),
        (None, true) => ("moving", Style::new().fg(Color::Cyan)),
        (None, false) => ("", Style::new()),
    }
}

/// A bar from 0 to 180 degrees with the present position and the target.
fn bar_spans(width: usize, target: u8, present: u8, colour: Style) -> Vec<Span<'static>> {
    let last = width.saturating_sub(1);
    let column = |degrees: u8| usize::from(degrees.min(Angle::MAX_DEGREES)) * last / 180;
    let cells = (0..width).map(|cell| match cell {
        cell if cell == column(present) => Span::styled("●", colour),
        cell if cell == column(target) => Span::styled("◇", colour),
        _ => Span::styled("─", FAINT),
    });
    cells.collect()
}

fn draw_plot(frame: &mut Frame<'_>, view: &MonitorView, area: Rect) {
    // Draw the selected joint last, above the others.
    let mut order = Joint::ALL.to_vec();
    order.sort_by_key(|&joint| joint == view.selected);
    let curves: Vec<(Joint, Vec<(f64, f64)>)> =
        order.into_iter().flat_map(|joint| curve_segments(view, joint)).collect();
    let datasets = curves.iter().map(|(joint, points)| {
        let line = Dataset::default().marker(Marker::Braille).graph_type(GraphType::Line);
        line.style(colour(*joint)).data(points)
    });
    let (bounds, labels) = view.plot.axis();
    let values = Axis::default().bounds(bounds).labels(labels).style(FAINT);
    let past = PLOT_SPAN.as_secs_f64();
    let seconds = Axis::default().bounds([-past, 0.0]).labels(["-20 s", "-10 s", "now"]).style(FAINT);
    frame.render_widget(Chart::new(datasets.collect()).x_axis(seconds).y_axis(values), area);
}

/// The curves of one joint, in seconds before now and the unit of the plot. A gap starts a new curve.
fn curve_segments(view: &MonitorView, joint: Joint) -> Vec<(Joint, Vec<(f64, f64)>)> {
    let point = |sample: &PastSample| {
        let before = view.now.saturating_sub(sample.time).as_secs_f64();
        Some((-before, sample.value(view.plot, joint)?))
    };
    let past: Vec<PastSample> = view.past.iter().copied().collect();
    let lines = past.chunk_by(|one, next| next.time.saturating_sub(one.time) <= LONGEST_GAP);
    lines.map(|line| (joint, line.iter().filter_map(point).collect())).collect()
}

fn health(view: &MonitorView) -> Line<'static> {
    let Some(sample) = &view.sample else { return Line::default() };
    let Some(status) = sample.joints.status() else {
        return Line::styled(" the maker's firmware reports no health", FAINT);
    };
    let style = if status.is_healthy() { GOOD } else { BAD };
    let mut spans = vec![Span::raw(" faults "), Span::styled(faults(status.faults()), style)];
    if status.missing() != 0 {
        spans.push(Span::styled(format!(", no answer from {}", joints(status.missing())), style));
    }
    let volts = status.supply_volts().map_or("unknown".to_owned(), |volts| format!("{volts:.1} V"));
    let celsius = status.hottest_celsius().map_or("unknown".to_owned(), |degrees| format!("{degrees} °C"));
    let tip = sample.tip().map_or("unknown".to_owned(), |tip| format!("{} mm", PointText(tip)));
    spans.push(Span::raw(format!("   supply {volts}   hottest servo {celsius}   tip {tip}")));
    Line::from(spans)
}

fn link(view: &MonitorView) -> Line<'static> {
    let link = &view.link;
    let losses = link.unanswered + u64::try_from(link.damaged).unwrap_or(u64::MAX);
    let style = if losses + u64::from(link.damaged_at_arm()) == 0 { Style::new() } else { BAD };
    Line::from(vec![
        Span::raw(format!(" link   {} answers, ", link.answers)),
        Span::styled(
            format!(
                "{} missing, {} damaged, {} at the arm",
                link.unanswered,
                link.damaged,
                link.damaged_at_arm()
            ),
            style,
        ),
        Span::raw(format!("   round trip {:.1} ms", link.round_trip_ms)),
    ])
}

/// The last line: the connection error, a note, the keys that move the tip, or the most important keys.
fn last_line(view: &MonitorView) -> Line<'_> {
    match (&view.connection, view.note()) {
        (LinkState::Looking(reason), _) => Line::styled(format!(" {reason}"), BAD),
        (_, Some(note)) => Line::styled(format!(" {note}"), BOLD),
        _ if view.jog.is_some() => Line::styled(jog_keys(view.jog), BOLD),
        _ => Line::styled(
            " ↑↓ joint  ←→ nudge  Shift 10°  +- speed  s state  space stop  ? help  q quit",
            FAINT,
        ),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::commands::monitor::view::tests::{sample, watching};
    use crate::commands::monitor::view::{ArmEvent, Dialog};
    use ratatui::Terminal;
    use ratatui::backend::TestBackend;
    use sevenbot::Snapshot;
    use sevenbot::fine::FineState;

    const NOTHING: Snapshot = Snapshot { address: 0, values: Vec::new() };

    fn screen(view: &MonitorView, width: u16, height: u16) -> TestBackend {
        let mut terminal = Terminal::new(TestBackend::new(width, height)).expect("memory");
        terminal.draw(|frame| draw(frame, view)).expect("memory takes all");
        terminal.backend().clone()
    }

    #[test]
    fn a_moving_arm() {
        insta::assert_snapshot!(screen(&watching(), 80, 24));
    }

    #[test]
    fn loads_in_the_place_of_positions() {
        let mut view = watching();
        view.plot = PlotKind::Load;
        let without = screen(&view, 80, 24).to_string();
        assert!(without.contains("load, %") && without.contains("–"), "an arm that measures none: {without}");
        for half_seconds in 0..20 {
            let fine = FineState { loads: [0, -205, 0, 0, 0, 0, 1_000], ..FineState::new(&NOTHING) };
            let sample = sample(60_000 + half_seconds * 500, 90);
            view.tick(sample.time);
            view.update(ArmEvent::Sample(ArmSample { fine: Some(fine), ..sample }));
        }
        insta::assert_snapshot!(screen(&view, 80, 24));
    }

    #[test]
    fn a_lost_arm() {
        let mut view = watching();
        view.update(ArmEvent::Lost("the connection is gone: broken pipe".to_owned()));
        insta::assert_snapshot!(screen(&view, 80, 24));
    }

    #[test]
    fn the_help() {
        let mut view = watching();
        view.dialog = Some(Dialog::Help);
        insta::assert_snapshot!(screen(&view, 80, 24));
    }

    #[test]
    fn every_screen_size_can_be_drawn() {
        let mut view = watching();
        view.dialog = Some(Dialog::ChooseState);
        for (width, height) in [(1, 1), (10, 3), (49, 12), (300, 100)] {
            screen(&view, width, height);
        }
    }

    #[test]
    fn the_help_shows_the_way_out_on_any_screen() {
        let mut view = watching();
        view.dialog = Some(Dialog::Help);
        let small = screen(&view, 40, 10).to_string();
        for seen in ["stop the arm", "q  ", "Ctrl-C"] {
            assert!(small.contains(seen), "{small}");
        }
    }

    #[test]
    fn a_low_screen_shows_all_joints() {
        let low = screen(&watching(), 80, 12).to_string();
        for seen in [" ▸   1", "     7", "faults none", "round trip", "q quit"] {
            assert!(low.contains(seen), "{low}");
        }
    }
}
