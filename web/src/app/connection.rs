//! Which arm the page has, and what becomes of it: it is chosen, its server ends, or lets the page only watch.

use host_link::sharing::SharingState;
use wasm_bindgen::JsValue;

use super::dom::set_attribute;
use super::events::TOUR;
use super::page::{App, Line};
use super::storage;
use crate::source::LineState;
use crate::source::serial::SerialSource;
use crate::source::socket::SocketSource;

/// Everything that moves an arm.
const DRIVING: &str = "#stop, [data-action=stop], #joints input, #tip-x, #tip-y, #tip-z, #joint-speed, \
     [data-action=motors], [data-action=home], [data-action=park], [data-action=grip], [data-action=pump], \
     [data-action=run], [data-action=step], [data-action=play], [data-register]";

impl App {
    /// Shows the arm behind the server if the opened address has its token, or else the simulated one.
    pub(super) fn show_first_arm(&mut self) {
        let query = web_sys::window().and_then(|window| window.location().search().ok());
        if query.is_some_and(|query| query.contains("token=")) {
            self.dom.choose("source", "server");
            self.choose_source();
            self.tour_step = TOUR.len() - 1;
        }
        if storage::load("tour").is_none() {
            self.begin_tour();
        }
    }

    pub(super) fn choose_source(&mut self) {
        let line = match self.dom.choice("source").as_str() {
            "server" => self.server_arm().map(|source| Line::Remote(Box::new(source))).ok(),
            "usb" => SerialSource::ask().map(|source| Line::Remote(Box::new(source))),
            _ => Some(Line::Simulated(Box::default())),
        };
        match line {
            Some(line) => self.set_line(line),
            None if self.class.is_some() => {
                self.dom.choose("source", "simulator");
                self.set_line(Line::Simulated(Box::default()));
                self.dom.notice(self.language.text("not-your-arm"));
            }
            None => {
                self.dom.choose("source", "simulator");
                self.set_line(Line::Simulated(Box::default()));
                self.dom.notice(self.language.text("no-serial"));
            }
        }
    }

    /// The arm at the server: in a class the real one, while this tab has it.
    fn server_arm(&self) -> Result<SocketSource, JsValue> {
        match &self.class {
            None => SocketSource::connect(),
            Some(class) => SocketSource::connect_with(&class.arm_query().ok_or("another tab has it")?),
        }
    }

    /// Tells once that the connection has ended, and what to do. A new server has another token, so the page does not look for it.
    pub(super) fn tell_end_of_line(&mut self) {
        let LineState::Closed(reason) = self.line_state() else { return };
        if std::mem::replace(&mut self.is_end_told, true) {
            return;
        }
        let text = match (self.dom.choice("source") == "server", self.client.rounds()) {
            // A class tells by itself what becomes of its arm.
            (true, _) if self.class.is_some() => return,
            (true, 0) => "no-server",
            (true, _) => "server-ended",
            (false, _) => "closed",
        };
        self.dom.notice(format!("{} {reason}", self.language.text(text)).trim_end());
    }

    /// True if nothing that this page writes reaches the arm.
    pub(super) fn only_watches(&self) -> bool {
        SharingState::of(self.client.registers()).is_some_and(|sharing| sharing.is_read_only)
    }

    /// As [`Self::only_watches`], for a person who wants to move or stop the arm.
    pub(super) fn refuses_to_drive(&self) -> bool {
        let only_watches = self.only_watches();
        if only_watches {
            self.dom.notice(self.language.text("watch-only"));
        }
        only_watches
    }

    /// Switches the controls off while the server lets nobody write.
    pub(super) fn show_watching(&mut self) {
        let is_watching = self.only_watches();
        if !is_watching && !self.are_controls_off {
            return;
        }
        // The table of registers gets more of them.
        for control in self.dom.all(DRIVING) {
            if is_watching {
                set_attribute(&control, "disabled", "");
            } else {
                let _ = control.remove_attribute("disabled");
            }
        }
        self.are_controls_off = is_watching;
    }
}
