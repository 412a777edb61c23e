//! The monitor on a terminal: draws the view, listens to keys, and leaves the terminal as it was.

use std::io::{self, IsTerminal};
use std::sync::mpsc::{self, Receiver, Sender};
use std::thread;
use std::time::{Duration, Instant};

use ratatui::DefaultTerminal;
use ratatui::crossterm::event::{self, Event, KeyEventKind};

use super::draw::draw;
use super::keys::{Outcome, press};
use super::view::{News, View, Wish};
use super::watch::Watcher;
use crate::failure::Failure;
use crate::interrupt::{Interrupt, say_how_it_stands};
use crate::output::warn;
use crate::session::Session;

/// How long a key may wait for the picture, and the picture for news.
const FRAME: Duration = Duration::from_millis(40);

/// Shows the arm until the user has seen enough; gives the last view back.
pub(crate) fn run(session: &Session, period: Duration) -> Result<View, Failure> {
    // A port that cannot be chosen is a failure; one that does not answer yet is waited for.
    let port = session.port_name()?;
    let start = Instant::now();
    let mut view = View::new(&port);
    let (news, hear) = mpsc::channel();
    let (wish, wishes) = mpsc::channel();
    let asked = session.port.clone();
    let options = session.options;
    let watcher = Watcher { port: asked, last_port: port, options, period, start, news, wishes, arm: None };
    let watching = thread::spawn(|| watcher.run());
    let shown = on_terminal(|terminal| show(terminal, &mut view, start, &hear, &wish));
    // Without a wish to come the watcher ends, after those that it has already.
    drop(wish);
    let held = watching.join().ok().flatten();
    shown?;
    match held {
        Some(held) => say_how_it_stands(&held?),
        None if Interrupt::is_wished() => warn("there is no arm that could be made to hold"),
        None => {}
    }
    Ok(view)
}

/// Does something on the whole screen, and gives it back as it was, even after a failure.
fn on_terminal(work: impl FnOnce(&mut DefaultTerminal) -> io::Result<()>) -> Result<(), Failure> {
    let mut terminal = ratatui::try_init()?;
    let done = work(&mut terminal);
    let restored = ratatui::try_restore();
    done.and(restored).map_err(Failure::from)
}

fn show(
    terminal: &mut DefaultTerminal,
    view: &mut View,
    start: Instant,
    news: &Receiver<News>,
    wishes: &Sender<Wish>,
) -> io::Result<()> {
    // In raw mode Ctrl-C is a key; other signals to end still come.
    let interrupt = Interrupt::catch();
    let reads_stdin = io::stdin().is_terminal();
    while !interrupt.has_come() {
        view.tick(start.elapsed());
        news.try_iter().for_each(|news| view.hear(news));
        terminal.draw(|frame| draw(frame, view))?;
        if !wait_for_input(FRAME, reads_stdin)? {
            break;
        }
        if event::poll(Duration::ZERO)? && !react(view, &event::read()?, wishes) {
            break;
        }
    }
    Ok(())
}

/// Waits until there may be an event. Returns false if the terminal is gone: crossterm would read its end for ever.
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

/// Does what an event asks for; `false` when that is to end.
fn react(view: &mut View, event: &Event, wishes: &Sender<Wish>) -> bool {
    match event {
        // Some terminals report releases too.
        Event::Key(key) if key.kind != KeyEventKind::Release => match press(view, *key) {
            Outcome::Shown => true,
            // The watcher only ends after this end of the channel does.
            Outcome::Ask(wish) => wishes.send(wish).is_ok(),
            Outcome::Quit => false,
            Outcome::Stop => {
                Interrupt::wish();
                false
            }
        },
        _ => true,
    }
}
