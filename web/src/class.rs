//! The protocol of a pupil's tab in a class: makes the messages of the tab, and interprets the messages of the server. This file
//! does not know the WebSocket.
//!
//! ```text
//!   ToPupil in JSON ──▶ Membership ──▶ ToPupil: what the page has to do
//!   FromPupil in JSON ◀── Membership, report ◀── the state of the arm
//! ```

use classroom::message::POINTS;
use classroom::{Doing, ExerciseProgress, FromPupil, StopOutcome, TabReport, ToPupil};
use kinematics::forward;
use sevenbot::map::motor_state;

use crate::arm_state::ArmState;
use crate::client::Client;
use crate::stop::StopProgress;

/// The membership of a tab in a class.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Membership {
    wanted: String,
    key: Option<String>,
    is_welcome: bool,
    /// The teacher's last stop: its number, and its outcome once the arm has confirmed it.
    stop: Option<(u32, Option<StopOutcome>)>,
    /// The outcome of the stop still has to be sent.
    is_confirmation_due: bool,
}

impl Membership {
    /// A tab that wants to join with this name. `key` is its secret from an earlier join, and makes it the same pupil again.
    #[must_use]
    pub const fn new(wanted: String, key: Option<String>) -> Self {
        Self { wanted, key, is_welcome: false, stop: None, is_confirmation_due: false }
    }

    /// The name that the pupil typed.
    #[must_use]
    pub fn wanted(&self) -> &str {
        &self.wanted
    }

    /// The secret of this tab; `None` before its first join.
    #[must_use]
    pub fn key(&self) -> Option<&str> {
        self.key.as_deref()
    }

    /// Has the class accepted this tab since its pupil asked to join?
    #[must_use]
    pub const fn is_welcome(&self) -> bool {
        self.is_welcome
    }

    /// The first message on each connection: asks to join.
    #[must_use]
    pub fn hello(&self) -> String {
        FromPupil::Join { name: self.wanted.clone(), key: self.key.clone() }.to_json()
    }

    /// Interprets a message of the class. Returns `None` if the page has nothing to do: the arm has confirmed this stop before,
    /// or the message is unknown, for example from a newer server.
    pub fn receive(&mut self, text: &str) -> Option<ToPupil> {
        let message = ToPupil::parse(text)?;
        match &message {
            ToPupil::Welcome { key, .. } => (self.key, self.is_welcome) = (Some(key.clone()), true),
            &ToPupil::Stop { number } if !self.is_new_stop(number) => return None,
            _ => {}
        }
        Some(message)
    }

    /// Takes a stop. Returns false if its outcome is known already. Then the outcome is sent again, because the server lacks it.
    fn is_new_stop(&mut self, number: u32) -> bool {
        self.is_confirmation_due = matches!(self.stop, Some((known, Some(_))) if known == number);
        if !self.is_confirmation_due {
            self.stop = Some((number, None));
        }
        !self.is_confirmation_due
    }

    /// The message that confirms the teacher's last stop: once when the arm has stopped, and again each time that the same stop
    /// arrives after that. `None` otherwise.
    pub fn confirmation(&mut self, progress: StopProgress) -> Option<String> {
        let (number, outcome) = self.stop.as_mut()?;
        if outcome.is_none() {
            *outcome = match progress {
                StopProgress::Holds => Some(StopOutcome::Holds),
                StopProgress::NotDriven => Some(StopOutcome::Limp),
                StopProgress::None | StopProgress::Verifying | StopProgress::Failed => None,
            };
            self.is_confirmation_due = outcome.is_some();
        }
        let is_due = std::mem::take(&mut self.is_confirmation_due);
        let outcome = (*outcome).filter(|_| is_due)?;
        Some(FromPupil::Stopped { number: *number, outcome }.to_json())
    }
}

/// The message that stops the class's real arm.
#[must_use]
pub fn stop_of_the_real_arm() -> String {
    FromPupil::StopArm.to_json()
}

/// What moves the arm, other than a person.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Activity {
    /// Nothing: at most a person moves the arm.
    #[default]
    None,
    /// A program of blocks runs.
    Program,
    /// A recording is played.
    Playing,
    /// A [`Park`](crate::park::Park) is in progress.
    Parking,
}

/// The answer to [`ToPupil::Ask`]. `is_hidden`: the tab is in the background.
#[must_use]
pub fn report(
    client: &Client,
    activity: Activity,
    goals: Option<ExerciseProgress>,
    is_hidden: bool,
) -> String {
    let state = client.state();
    let is_known = client.is_connected() && state.measured.iter().all(Option::is_some);
    let doing =
        if client.is_connected() { doing(&state, client.stop_progress(), activity) } else { Doing::NoArm };
    let points = is_known.then(|| points(state.angles()));
    FromPupil::Report(TabReport { points, doing, goals, is_hidden }).to_json()
}

/// What the arm does, in one word. If several facts apply, the most important one wins.
fn doing(state: &ArmState, stop: StopProgress, activity: Activity) -> Doing {
    match (stop, activity) {
        (StopProgress::Failed, _) => Doing::StopFailed,
        (StopProgress::Verifying, _) => Doing::Stopping,
        _ if state.stalled != 0 => Doing::Blocked,
        _ if !state.problems.is_empty() => Doing::Problem,
        _ if state.motor_state != motor_state::SERVO => Doing::Limp,
        (_, Activity::Program) => Doing::Program,
        (_, Activity::Playing) => Doing::Playing,
        (_, Activity::Parking) => Doing::Parking,
        _ if state.moving != 0 => Doing::Moving,
        (StopProgress::Holds, _) => Doing::Stopped,
        _ => Doing::Ready,
    }
}

/// The points from which the teacher's screen draws the arm: shoulder, elbow, forearm, wrist and tip, in mm.
#[expect(clippy::cast_possible_truncation, reason = "the arm is shorter than a metre, and `as` saturates")]
fn points(angles: [f32; 7]) -> [[i16; 3]; POINTS] {
    let [t1, t2, t3, t4, t5, t6, _] = angles.map(f64::from);
    let frames = forward([t1, t2, t3, t4, t5, t6]);
    let points =
        [frames.arm.shoulder, frames.arm.elbow, frames.arm.forearm, frames.arm.wrist, frames.hand.tip];
    points.map(|point| [point.x, point.y, point.z].map(|millimetres| millimetres.round() as i16))
}

#[cfg(test)]
mod tests {
    use super::*;
    use classroom::message::Refusal;

    use crate::arm_state::{target_frame, tip};
    use crate::tab::Tab;

    const STOP: &str = r#"{"stop":{"number":3}}"#;
    const STOPPED: &str = r#"{"stopped":{"number":3,"outcome":"holds"}}"#;

    fn reported(tab: &Tab, activity: Activity) -> TabReport {
        match serde_json::from_str(&report(&tab.client, activity, None, false)) {
            Ok(FromPupil::Report(report)) => report,
            other => panic!("{other:?}"),
        }
    }

    fn send(tab: &mut Tab, joint: u8, degrees: f32) {
        let (address, values) = target_frame(tab.client.registers(), joint, degrees).expect("a target");
        tab.client.write(tab.arm.now(), address, &values);
    }

    #[test]
    fn a_tab_that_was_there_comes_back_with_its_key() {
        let mut tab = Membership::new("Mia".to_owned(), None);
        assert_eq!(tab.hello(), r#"{"join":{"name":"Mia","key":null}}"#);
        let welcome = tab.receive(r#"{"welcome":{"name":"Mia 2","key":"secret"}}"#);
        assert!(matches!(welcome, Some(ToPupil::Welcome { name, .. }) if name == "Mia 2"));
        assert_eq!(tab.hello(), r#"{"join":{"name":"Mia","key":"secret"}}"#);
        assert_eq!(tab.receive(r#"{"refused":"full"}"#), Some(ToPupil::Refused(Refusal::Full)));
        for unknown in ["", "{}", r#"{"dance":{}}"#] {
            assert_eq!(tab.receive(unknown), None);
        }
    }

    #[test]
    fn a_stop_is_confirmed_when_the_arm_holds_and_again_if_it_comes_again() {
        let (mut member, mut tab) = (Membership::new("Mia".to_owned(), None), Tab::new());
        send(&mut tab, 1, 170.0);
        tab.pass(20);
        assert_eq!(member.confirmation(tab.client.stop_progress()), None, "nobody asked");
        let stop = Some(ToPupil::Stop { number: 3 });
        assert_eq!(member.receive(STOP), stop);
        assert_eq!(member.receive(STOP), stop, "until it holds");
        tab.client.stop(tab.arm.now(), None);
        assert_eq!(member.confirmation(tab.client.stop_progress()), None);
        assert_eq!(reported(&tab, Activity::None).doing, Doing::Stopping);
        tab.pass(30);
        assert_eq!(member.confirmation(tab.client.stop_progress()).as_deref(), Some(STOPPED));
        assert_eq!(reported(&tab, Activity::None).doing, Doing::Stopped);
        assert_eq!(member.confirmation(tab.client.stop_progress()), None, "once");
        // The pupil moves the arm again. A repetition of the same stop does not stop it.
        send(&mut tab, 1, 90.0);
        assert_eq!(member.receive(STOP), None);
        assert_eq!(member.confirmation(tab.client.stop_progress()).as_deref(), Some(STOPPED));
        assert_eq!(member.receive(r#"{"stop":{"number":4}}"#), Some(ToPupil::Stop { number: 4 }));
        assert_eq!(member.confirmation(StopProgress::Failed), None, "the class asks again");
        let limp = member.confirmation(StopProgress::NotDriven);
        assert_eq!(limp.as_deref(), Some(r#"{"stopped":{"number":4,"outcome":"limp"}}"#));
    }

    #[test]
    fn a_report_says_in_a_word_what_the_arm_does() {
        let mut tab = Tab::new();
        let ready = reported(&tab, Activity::None);
        let [x, y, z] = tip(tab.client.state().angles()).map(|millimetres| millimetres.round());
        let shown = ready.points.map(|points| points[POINTS - 1].map(f64::from));
        assert_eq!((ready.doing, shown), (Doing::Ready, Some([x, y, z])));
        for (activity, doing) in [
            (Activity::Program, Doing::Program),
            (Activity::Playing, Doing::Playing),
            (Activity::Parking, Doing::Parking),
        ] {
            assert_eq!(reported(&tab, activity).doing, doing);
        }
        send(&mut tab, 1, 170.0);
        tab.pass(12);
        assert_eq!(reported(&tab, Activity::None).doing, Doing::Moving);
        tab.act("fault 1=stuck");
        tab.pass(240);
        assert_eq!(reported(&tab, Activity::Program).doing, Doing::Blocked);
        let mut tab = Tab::new();
        tab.client.write(tab.arm.now(), sevenbot::map::MOTOR_STATE.address, &[motor_state::FORCELESS]);
        tab.pass(30);
        assert_eq!(reported(&tab, Activity::None).doing, Doing::Limp);
        tab.act("halt");
        tab.pass(200);
        let silent = reported(&tab, Activity::None);
        assert_eq!((silent.doing, silent.points), (Doing::NoArm, None));
    }
}
