//! The page's connection to an arm: how the user chooses it, how it ends, and what is disabled while the server is read-only.

use host_link::sharing::SharingState;
use wasm_bindgen::JsValue;

use super::dom::set_attribute;
use super::events::TOUR;
use super::page::{App, ArmLine};
use super::storage;
use crate::client::Client;
use crate::source::LineState;
use crate::source::serial::SerialSource;
use crate::source::socket::SocketSource;

/// The selectors of the controls that move or stop an arm, or write its registers.
const DRIVING: &str = "#stop, [data-action=stop], #joints input, #tip-x, #tip-y, #tip-z, #joint-speed, \
     [data-action=motors], [data-action=home], [data-action=park], [data-action=grip], [data-action=pump], \
     [data-action=run], [data-action=step], [data-action=play], [data-register]";

impl App {
    /// Connects to the arm behind the server if the page's address has a token. If not, the page keeps its simulated arm. Shows
    /// the tour on the first visit.
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
            "server" => self.server_arm().map(|source| ArmLine::Remote(Box::new(source))).ok(),
            "usb" => {
                self.close_set_aside_usb();
                SerialSource::ask().map(|source| ArmLine::Remote(Box::new(source)))
            }
            _ => Some(ArmLine::Simulated(Box::default())),
        };
        match line {
            Some(line) => self.set_line(line),
            None if self.class.is_some() => {
                self.dom.choose("source", "simulator");
                self.set_line(ArmLine::Simulated(Box::default()));
                self.dom.notice(self.language.text("not-your-arm"));
            }
            None => {
                self.dom.choose("source", "simulator");
                self.set_line(ArmLine::Simulated(Box::default()));
                self.dom.notice(self.language.text("no-serial"));
            }
        }
    }

    /// Closes the USB port of an arm that is set aside, because the browser opens no port twice.
    fn close_set_aside_usb(&mut self) {
        if let Some(own) = self.set_aside.as_mut().filter(|own| own.chosen == "usb") {
            own.line = ArmLine::Simulated(Box::default());
            own.client = Client::default();
            own.chosen = "simulator".to_owned();
        }
    }

    /// Connects to the arm behind the server: in a class, to the class's real arm.
    ///
    /// # Errors
    /// The page has no address, the browser refuses the address of the server, or this pupil does not have the class's real arm.
    fn server_arm(&self) -> Result<SocketSource, JsValue> {
        match &self.class {
            None => SocketSource::connect(),
            Some(class) => SocketSource::connect_with(&class.arm_query().ok_or("another tab has it")?),
        }
    }

    /// Shows once that the connection has ended, and what to do. Outside a class the page does not reconnect: a new server has
    /// another token.
    pub(super) fn tell_end_of_line(&mut self) {
        let LineState::Closed(reason) = self.line_state() else { return };
        if std::mem::replace(&mut self.is_end_told, true) {
            return;
        }
        let text = match (self.dom.choice("source") == "server", self.client.rounds()) {
            // In a class, the messages of the class explain the end.
            (true, _) if self.class.is_some() => return,
            (true, 0) => "no-server",
            (true, _) => "server-ended",
            (false, _) => "closed",
        };
        self.dom.notice(format!("{} {reason}", self.language.text(text)).trim_end());
    }

    /// True if the server is read-only: it discards the writes of this page.
    pub(super) fn only_watches(&self) -> bool {
        SharingState::of(self.client.registers()).is_some_and(|sharing| sharing.is_read_only)
    }

    /// As [`Self::only_watches`], but also shows a notice. [`Self::write`] and [`Self::stop`] call this. The buttons that begin a
    /// park, a movement or a program are disabled instead.
    pub(super) fn refuses_to_drive(&self) -> bool {
        let only_watches = self.only_watches();
        if only_watches {
            self.dom.notice(self.language.text("watch-only"));
        }
        only_watches
    }

    /// Disables the controls in [`DRIVING`] while the server is read-only, and enables them afterwards.
    pub(super) fn show_watching(&mut self) {
        let is_watching = self.only_watches();
        if !is_watching && !self.are_controls_off {
            return;
        }
        // Repeated with each picture, because the table of registers may have new controls.
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
