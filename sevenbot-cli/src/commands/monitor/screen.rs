//! The monitor on a terminal: draws the view, reads keys, and restores the terminal.

use std::io::{self, IsTerminal};
use std::sync::mpsc::{self, Receiver, Sender};
use std::thread;
use std::time::{Duration, Instant};

use ratatui::DefaultTerminal;
use ratatui::crossterm::event::{self, Event, KeyEventKind};
use sevenbot::cartesian::Guard;

use super::arm_thread::ArmThread;
use super::draw::draw;
use super::keys::{KeyAction, press};
use super::plot_kind::PlotKind;
use super::view::{ArmEvent, MonitorView, UiCommand};
use crate::command_error::CommandError;
use crate::interrupt::{Interrupt, report_hold};
use crate::printer::warn;
use crate::session::Session;

/// The longest time between two frames on the screen. A key ends the wait early; a sample does not.
const FRAME: Duration = Duration::from_millis(40);

/// Shows the arm until the user quits. After Ctrl-C the arm holds.
pub(crate) fn run(
    session: &Session,
    period: Duration,
    plot: PlotKind,
    guard: Option<Guard>,
) -> Result<(), CommandError> {
    // Without --port this fails unless exactly one arm is found. The thread retries a port that does not answer.
    let port = session.port_name()?;
    let start = Instant::now();
    let mut view = MonitorView::new(&port, plot);
    let (events, hear) = mpsc::channel();
    let (command, commands) = mpsc::channel();
    let asked = session.port.clone();
    let options = session.options;
    let watcher = ArmThread {
        port: asked,
        last_port: port,
        options,
        period,
        start,
        events,
        commands,
        arm: None,
        jog: None,
        guard,
    };
    let watching = thread::spawn(|| watcher.run());
    let shown = on_terminal(|terminal| show(terminal, &mut view, start, &hear, &command));
    // Closing the channel ends the thread. After Ctrl-C the thread drops the pending commands.
    drop(command);
    let held = watching.join().ok().flatten();
    shown?;
    match held {
        Some(held) => report_hold(&held?),
        None if Interrupt::is_requested() => warn("the arm is lost: it could not be made to hold"),
        None => {}
    }
    Ok(())
}

/// Runs `work` on the whole screen, and restores the terminal, also after a failure.
fn on_terminal(work: impl FnOnce(&mut DefaultTerminal) -> io::Result<()>) -> Result<(), CommandError> {
    let mut terminal = ratatui::try_init()?;
    let done = work(&mut terminal);
    let restored = ratatui::try_restore();
    done.and(restored).map_err(CommandError::from)
}

fn show(
    terminal: &mut DefaultTerminal,
    view: &mut MonitorView,
    start: Instant,
    events: &Receiver<ArmEvent>,
    commands: &Sender<UiCommand>,
) -> io::Result<()> {
    // In raw mode Ctrl-C arrives as a key. Other signals, such as SIGTERM, still arrive as signals.
    Interrupt::catch();
    let reads_stdin = io::stdin().is_terminal();
    while !Interrupt::is_requested() {
        view.tick(start.elapsed());
        events.try_iter().for_each(|event| view.update(event));
        terminal.draw(|frame| draw(frame, view))?;
        if !wait_for_input(FRAME, reads_stdin)? {
            break;
        }
        if event::poll(Duration::ZERO)? && !react(view, &event::read()?, commands) {
            break;
        }
    }
    Ok(())
}

/// Waits for input. Returns false if standard input is a terminal that is gone: crossterm would then read end-of-file in a loop.
#[cfg(unix)]
fn wait_for_input(timeout: Duration, reads_stdin: bool) -> io::Result<bool> {
    use rustix::event::{PollFd, PollFlags, Timespec, poll};

    if !reads_stdin {
        return event::poll(timeout).map(|_| true);
    }
    let stdin = io::stdin();
    let mut input = [PollFd::new(&stdin, PollFlags::IN)];
    match poll(&mut input, Timespec::try_from(timeout).ok().as_ref()) {
        Ok(_) | Err(rustix::io::Errno::INTR) => {
            Ok(!input.iter().any(|fd| fd.revents().contains(PollFlags::HUP)))
        }
        Err(error) => Err(error.into()),
    }
}

#[cfg(not(unix))]
fn wait_for_input(timeout: Duration, _reads_stdin: bool) -> io::Result<bool> {
    event::poll(timeout).map(|_| true)
}

/// Reacts to an event; `false` ends the monitor.
fn react(view: &mut MonitorView, event: &Event, commands: &Sender<UiCommand>) -> bool {
    match event {
        // Some terminals also report key releases.
        Event::Key(key) if key.kind != KeyEventKind::Release => match press(view, *key) {
            KeyAction::Redraw => true,
            // The thread ends after this channel is closed, or after a signal, which ends the monitor, too.
            KeyAction::Send(command) => commands.send(command).is_ok(),
            KeyAction::Quit => false,
            KeyAction::Stop => {
                Interrupt::request();
                false
            }
        },
        _ => true,
    }
}
