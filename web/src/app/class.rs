//! A pupil's tab in a class: joins the class, reports the state of the arm, stops when the teacher stops all arms, and drives the
//! class's real arm while the teacher lends it to this pupil.

use classroom::message::Refusal;
use classroom::{ExerciseProgress, LeaseEnd, LentArm, ToPupil};
use wasm_bindgen::prelude::Closure;
use wasm_bindgen::{JsCast, JsValue};
use web_sys::HtmlInputElement;

use super::class_socket::ClassSocket;
use super::class_tab::ClassTab;
use super::editor::Editor;
use super::page::{App, ArmLine, OwnArm, browser_now, with_app};
use super::storage;
use crate::class::{Activity, Membership, report, stop_of_the_real_arm};
use crate::client::Client;
use crate::program::ProgramRun;
use crate::source::LineState;
use crate::source::socket::SocketSource;

/// The time before another attempt to connect, in milliseconds.
const RETRY_MS: f64 = 2_000.0;
/// The period of the timer that checks the connection, also in a tab that draws no pictures, in milliseconds.
const LOOK_MS: i32 = 1_000;
/// The beginning of the query in the address of a class.
const QUERY: &str = "?class";

impl App {
    /// If the page's address is the address of a class: opens the panel of the class, starts the timer that checks the
    /// connection, and joins at once if this tab was in the class before.
    pub(super) fn open_class(&mut self) {
        let query = web_sys::window().and_then(|window| window.location().search().ok());
        let Some(query) = query.filter(|query| query.starts_with(QUERY)) else { return };
        let code = query.strip_prefix("?class=").map(str::to_owned);
        let kept = |name| storage::load_of_tab(name).unwrap_or_default();
        let code = code.unwrap_or_else(|| kept("class-code"));
        self.dom.set_hidden("class", false);
        self.class = Some(ClassTab::default());
        // If there is no timer, the page still checks the connection with each picture.
        let _ = look_without_pictures();
        for (id, value) in [("class-code", &code), ("class-name", &kept("class-name"))] {
            if let Ok(field) = self.dom.get::<HtmlInputElement>(id) {
                field.set_value(value);
            }
        }
        if storage::load_of_tab("class-key").is_some() {
            self.join_class();
        }
    }

    /// Carries out the action of a button. Returns false if the action does not belong to the class.
    pub(super) fn act_on_class(&mut self, action: &str) -> bool {
        match action {
            "join-class" => self.join_class(),
            "rename" => self.leave_class(),
            "close-class-text" => self.dom.set_hidden("class-text-row", true),
            "stop-class-arm" => self.stop_class_arm(),
            _ => return false,
        }
        true
    }

    fn stop_class_arm(&self) {
        if !self.class.as_ref().is_some_and(|class| class.send(&stop_of_the_real_arm())) {
            self.dom.notice(self.language.text("class-stop-not-sent"));
        }
    }

    fn field(&self, id: &str) -> String {
        let field = self.dom.get::<HtmlInputElement>(id).map(|field| field.value());
        field.unwrap_or_default().trim().to_owned()
    }

    fn join_class(&mut self) {
        let (name, code) = (self.field("class-name"), self.field("class-code").to_ascii_lowercase());
        let Some(class) = &mut self.class else { return };
        for (id, value) in [("class-name", &name), ("class-code", &code)] {
            storage::save_of_tab(id, value);
        }
        class.member = Some(Membership::new(name, storage::load_of_tab("class-key")));
        class.code = code;
        class.retry = Some(0.0);
        self.dom.end_notice();
        self.show_membership("class-joining");
    }

    /// Leaves the class, and shows the fields for the name and the code again.
    fn leave_class(&mut self) {
        self.end_real_arm(None);
        if let Some(class) = &mut self.class {
            (class.member, class.socket, class.retry, class.arm) = (None, None, None, None);
        }
        self.dom.set_hidden("class-join", false);
        self.dom.set_hidden("class-there", true);
    }

    fn show_membership(&self, text: &'static str) {
        let name = self.class.as_ref().map_or("", |class| class.name.as_str());
        let name = if text == "class-you-are" { format!(" {name}") } else { String::new() };
        self.dom.set_text("class-state", &format!("{}{name}", self.language.text(text)));
        self.dom.set_hidden("class-join", true);
        self.dom.set_hidden("class-there", false);
    }

    /// Checks the connections, reconnects, and confirms a stop. Called with each picture, and once a second by a timer.
    pub(super) fn class_on(&mut self, time: f64) {
        let Some(class) = &mut self.class else { return };
        if class.is_lost(time) {
            class.socket = None;
            self.class_ended(time);
        }
        self.reconnect_real_arm(time);
        let Some(class) = &mut self.class else { return };
        if class.retry.is_some_and(|retry| retry <= time) {
            class.retry = None;
            class.hear();
            class.socket = ClassSocket::connect(
                &class.code,
                || {
                    with_app(|app| app.greet_class());
                },
                |text| {
                    with_app(|app| app.hear_class(&text));
                },
            )
            .ok();
        }
        self.confirm_stop();
    }

    fn class_ended(&mut self, time: f64) {
        let Some(class) = &mut self.class else { return };
        let Some(member) = &class.member else { return };
        if !member.is_welcome() {
            self.leave_class();
            return self.dom.notice(self.language.text("class-not-joined"));
        }
        class.retry = Some(time + RETRY_MS);
        self.end_real_arm(Some("arm-over-lost"));
        self.show_membership("class-lost");
    }

    fn greet_class(&self) {
        let Some(class) = &self.class else { return };
        if let Some(member) = &class.member {
            class.send(&member.hello());
        }
    }

    fn hear_class(&mut self, text: &str) {
        let Some(class) = &mut self.class else { return };
        class.hear();
        let member = class.member.as_mut();
        match member.and_then(|member| member.receive(text)) {
            None => {}
            Some(ToPupil::Stop { .. }) => self.stop_for_teacher(),
            Some(ToPupil::Welcome { name, key }) => self.be_welcome(name, &key),
            Some(ToPupil::Refused(why)) => self.be_refused(why),
            Some(ToPupil::Message { text }) => {
                self.dom.set_text("class-text", &text);
                self.dom.set_hidden("class-text-row", text.is_empty());
            }
            Some(ToPupil::Ask { arm, over }) => {
                self.show_real_arm(arm, over);
                self.tell_class();
            }
        }
        self.confirm_stop();
    }

    fn be_welcome(&mut self, name: String, key: &str) {
        storage::save_of_tab("class-key", key);
        let Some(class) = &mut self.class else { return };
        let is_other_name = class.member.as_ref().is_some_and(|member| member.wanted() != name);
        class.name = name;
        if is_other_name {
            self.dom.notice(&format!("{} {}", self.language.text("class-name-taken"), class.name));
        }
        self.show_membership("class-you-are");
    }

    fn be_refused(&mut self, why: Refusal) {
        self.leave_class();
        self.dom.notice(self.language.text(match why {
            Refusal::NoName => "class-no-name",
            Refusal::Full => "class-full",
            Refusal::OtherTab => "class-other-tab",
            Refusal::BadMessage => "class-not-joined",
        }));
    }

    /// Handles the teacher's stop at once, not with the next picture: a tab in the background draws none.
    fn stop_for_teacher(&mut self) {
        let run = self.programs.run.as_ref();
        let block = run.and_then(ProgramRun::block).map(ToString::to_string);
        let was_program = run.is_some();
        self.stop();
        self.carry_out_stop();
        let stopped = self.language.text("stopped-by-teacher");
        if was_program {
            let text = format!("{} {stopped}", self.language.text("program-failed"));
            Editor.warn(block.as_deref(), &text);
            self.dom.notice(&text);
        } else {
            self.dom.notice(stopped);
        }
    }

    /// Sends the confirmation of the teacher's stop when the arm has stopped.
    fn confirm_stop(&mut self) {
        let progress = self.client.stop_progress();
        let Some(class) = &mut self.class else { return };
        let confirmation = class.member.as_mut().and_then(|member| member.confirmation(progress));
        if let Some(text) = confirmation {
            class.send(&text);
        }
    }

    /// Sends the class a report of the arm's state.
    fn tell_class(&self) {
        let activity = match (&self.programs.run, &self.player, &self.park) {
            (Some(_), ..) => Activity::Program,
            (_, Some(_), _) => Activity::Playing,
            (.., Some(_)) => Activity::Parking,
            _ => Activity::None,
        };
        let count = |number: usize| u8::try_from(number).unwrap_or(u8::MAX);
        let goals = self.exercises.attempt.as_ref().map(|attempt| ExerciseProgress {
            reached: count(attempt.reached().filter(|&is_reached| is_reached).count()),
            all: count(attempt.reached().count()),
        });
        let report = report(&self.client, activity, goals, self.dom.0.hidden());
        if let Some(class) = &self.class {
            class.send(&report);
        }
    }

    /// Shows who has the class's real arm. Begins to drive the arm when this pupil gets it, and returns to the pupil's own arm when
    /// this pupil loses it.
    fn show_real_arm(&mut self, arm: Option<LentArm>, over: Option<LeaseEnd>) {
        let text = arm.as_ref().map_or(String::new(), |arm| {
            let time = format!("{}:{:02}", arm.seconds / 60, arm.seconds % 60);
            match arm.is_yours {
                true => format!("{} {time}", self.language.text("arm-is-yours")),
                false => format!("{} {} {time}", arm.holder, self.language.text("arm-is-of")),
            }
        });
        self.dom.set_text("class-arm", &text);
        self.dom.set_hidden("stop-class-arm", arm.is_none());
        let Some(class) = &mut self.class else { return };
        let is_own = |arm: &Option<LentArm>| arm.as_ref().is_some_and(|arm| arm.is_yours);
        let (was_own, is_own) = (is_own(&class.arm), is_own(&arm));
        class.arm = arm;
        match (was_own, is_own, over) {
            // In the second case the teacher gave the arm to this pupil again: the server closed the connection of the old lease.
            (false, true, _) | (true, true, Some(_)) => self.begin_real_arm(),
            (true, false, over) => self.end_real_arm(Some(match over {
                Some(LeaseEnd::Time) => "arm-over-time",
                Some(LeaseEnd::Lost) => "arm-over-lost",
                Some(LeaseEnd::TakenBack) | None => "arm-over-back",
            })),
            (false, false, Some(LeaseEnd::Lost)) => self.dom.notice(self.language.text("arm-over-lost")),
            _ => {}
        }
    }

    /// Begins to drive the class's real arm. The pupil's own arm is set aside; the time of a simulated one stands still.
    fn begin_real_arm(&mut self) {
        self.stop();
        self.carry_out_stop();
        let Some(query) = self.class.as_ref().and_then(ClassTab::arm_query) else { return };
        let Ok(source) = SocketSource::connect_with(&query) else { return };
        let chosen = self.dom.choice("source");
        let (line, client) = self.swap_line((ArmLine::Remote(Box::new(source)), Client::default()));
        if chosen != "server" || self.set_aside.is_none() {
            self.set_aside = Some(OwnArm { line, client, chosen });
        }
        self.dom.choose("source", "server");
        self.dom.notice(self.language.text("arm-begins"));
    }

    /// Reconnects to the real arm if the connection was lost while this pupil still has the arm.
    fn reconnect_real_arm(&mut self, time: f64) {
        let is_driven = self.set_aside.is_some() && self.dom.choice("source") == "server";
        let is_closed = is_driven && matches!(self.line_state(), LineState::Closed(_));
        let Some(class) = &mut self.class else { return };
        let Some(query) = class.arm_query().filter(|_| is_closed) else { return class.arm_retry = None };
        if *class.arm_retry.get_or_insert(time + RETRY_MS) > time {
            return;
        }
        class.arm_retry = None;
        if let Ok(source) = SocketSource::connect_with(&query) {
            self.set_line(ArmLine::Remote(Box::new(source)));
        }
    }

    /// Hides the lease of the real arm, and returns to the pupil's own arm if the page drove the real one. `text` is the name of
    /// the text that gives the reason; `None` shows no notice.
    fn end_real_arm(&mut self, text: Option<&'static str>) {
        self.dom.set_text("class-arm", "");
        self.dom.set_hidden("stop-class-arm", true);
        self.class.iter_mut().for_each(|class| class.arm = None);
        let Some(OwnArm { line, client, chosen }) = self.set_aside.take() else { return };
        // During the lease the pupil can choose another arm.
        if self.dom.choice("source") == "server" {
            self.swap_line((line, client));
            self.last_frame = browser_now();
            self.dom.choose("source", &chosen);
        }
        text.into_iter().for_each(|text| self.dom.notice(self.language.text(text)));
    }
}

/// Starts a timer that calls [`App::class_on`], because a tab in the background draws no pictures.
fn look_without_pictures() -> Result<(), JsValue> {
    let window = web_sys::window().ok_or("no window")?;
    let look = Closure::<dyn FnMut()>::new(|| {
        with_app(|app| app.class_on(browser_now()));
    });
    let call = look.as_ref().unchecked_ref();
    window.set_interval_with_callback_and_timeout_and_arguments_0(call, LOOK_MS)?;
    look.forget();
    Ok(())
}
