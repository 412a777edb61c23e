//! A client of the maker's WebSocket: its commands one after the other, and the answers in their order.
//!
//! A stop is carried out when it comes, and drops the earlier commands that move the arm. Only its answer waits for its turn.
//! Every message is taken, so that a stop never waits behind others. A command for which the queue has no room is refused, and
//! the refusal is answered in its turn, too.
//!
//! A read is always answered. All other commands are answered only to a browser: the maker's Python client does not wait
//! for their answers, and takes the next message for the answer to its next read.

use std::collections::VecDeque;

use protocol_core::registers::Map;
use protocol_core::registers::map::{FRAMES_REFUSED, MOTOR_STATE, motor_state};
use protocol_core::time::Instant;
use serde_json::{Value, json};

use super::block::has_solution;
use super::command::{MakerCommand, MakerCommandError};
use crate::hub::{Admission, ClientId, HoldOutcome, Hub, HubEvent, WholeRequest};

/// Answers that may wait for a client to take them. While there are this many, its commands wait.
const MOST_ANSWERS: usize = 8;
/// Commands that may wait. A pose takes 1.2 ms at 115 200 baud, and a target is dropped after 200 ms: a longer queue of targets would
/// hold some that are dropped anyway.
const MOST_COMMANDS: usize = 200;
/// A client with this many entries in its queue is disconnected. Stops between refused commands lengthen the queue beyond
/// [`MOST_COMMANDS`].
const MOST_WAITING: usize = 400;

/// An entry of the queue of messages.
#[derive(Debug)]
enum WaitingMessage {
    /// A command, and the earliest time at which it can have been sent.
    Command(Instant, MakerCommand),
    Wrong(MakerCommandError),
    /// A stop that was carried out, and waits for its answer.
    Stopped(Admission),
    /// A command that a later stop dropped, and that waits for its answer.
    Dropped,
    /// This many commands in a row were refused for lack of room, and wait for their answers.
    Refused(usize),
}

/// A client of the maker's WebSocket.
#[derive(Debug)]
pub struct MakerClient {
    id: ClientId,
    is_browser: bool,
    waiting: VecDeque<WaitingMessage>,
    /// The command that has not ended: its read has no reply yet, or the arm has not confirmed the stop.
    current: Option<MakerCommand>,
    /// The first of two events that the command waits for.
    first: Option<HubEvent>,
    answers: VecDeque<String>,
}

impl MakerClient {
    /// A new client of `hub`. `is_browser`: its handshake carried an `Origin`.
    pub fn connect(hub: &mut Hub, is_browser: bool) -> Self {
        let id = hub.connect();
        hub.set_can_receive(id, true);
        Self {
            id,
            is_browser,
            waiting: VecDeque::new(),
            current: None,
            first: None,
            answers: VecDeque::new(),
        }
    }

    /// The id of this client in the hub, for example for [`Hub::leave`].
    #[must_use]
    pub const fn id(&self) -> ClientId {
        self.id
    }

    /// Takes a message that was sent at `since` or later.
    pub fn message(&mut self, since: Instant, text: &str) {
        let command = MakerCommand::parse(text);
        if self.waiting.len() >= MOST_COMMANDS && command != Ok(MakerCommand::Stop) {
            return self.refuse(is_read(&command));
        }
        self.waiting.push_back(match command {
            Ok(command) => WaitingMessage::Command(since, command),
            Err(error) => WaitingMessage::Wrong(error),
        });
    }

    /// Do so many messages wait for their answers that the client has to be disconnected?
    #[must_use]
    pub fn is_overrun(&self) -> bool {
        self.waiting.len() >= MOST_WAITING
    }

    /// Refuses a command for lack of room. Queues its answer, if the client expects one.
    fn refuse(&mut self, is_read: bool) {
        if !is_read && !self.is_browser {
            return;
        }
        match self.waiting.back_mut() {
            Some(WaitingMessage::Refused(count)) => *count += 1,
            _ => self.waiting.push_back(WaitingMessage::Refused(1)),
        }
    }

    /// Carries out commands, as far as possible. Call it after messages, after [`Hub::poll`] and [`Hub::arm_bytes`].
    pub fn advance(&mut self, hub: &mut Hub, now: Instant) {
        while let Some(event) = hub.take_event(self.id) {
            self.finish_read(event);
        }
        self.stop_at_once(hub, now);
        loop {
            if matches!(self.current, Some(MakerCommand::Stop)) {
                self.finish_stop(hub);
            }
            if self.current.is_some() || self.answers.len() >= MOST_ANSWERS || !hub.has_room(self.id) {
                return;
            }
            match self.waiting.pop_front() {
                None => return,
                Some(WaitingMessage::Command(since, command)) => self.start(hub, now, since, command),
                Some(WaitingMessage::Wrong(MakerCommandError { message, is_read })) => {
                    self.answer(is_read, &error(&message));
                }
                Some(WaitingMessage::Stopped(Admission::Queued)) => self.current = Some(MakerCommand::Stop),
                Some(WaitingMessage::Stopped(refused)) => self.answer(false, &done_or_refused("", refused)),
                Some(WaitingMessage::Dropped) => self.answer(false, &error("A stop came after this command")),
                Some(WaitingMessage::Refused(count)) => self.answer_refused(count),
            }
        }
    }

    /// Carries out the stops that wait, and drops the earlier commands that move the arm.
    fn stop_at_once(&mut self, hub: &mut Hub, now: Instant) {
        let is_stop =
            |waiting: &WaitingMessage| matches!(waiting, WaitingMessage::Command(_, MakerCommand::Stop));
        let Some(last) = self.waiting.iter().rposition(is_stop) else { return };
        let admission = hub.stop_arm(now, self.id);
        for waiting in self.waiting.iter_mut().take(last + 1) {
            match waiting {
                WaitingMessage::Command(_, MakerCommand::Stop) => {
                    *waiting = WaitingMessage::Stopped(admission)
                }
                WaitingMessage::Command(_, command)
                    if admission == Admission::Queued
                        && request(command).is_some_and(|it| hub.moves_arm(now, self.id, &it)) =>
                {
                    *waiting = WaitingMessage::Dropped;
                }
                _ => {}
            }
        }
    }

    /// Takes the oldest answer for the client, as JSON; `None` if no answer waits.
    pub fn take_answer(&mut self) -> Option<String> {
        self.answers.pop_front()
    }

    fn start(&mut self, hub: &mut Hub, now: Instant, since: Instant, command: MakerCommand) {
        let Some(request) = request(&command) else {
            return self.answer(false, &json!({"status": "pong", "timestamp": now.as_micros() / 1_000}));
        };
        let admission = hub.request(now, self.id, since, request);
        match (command, admission) {
            (MakerCommand::Write { done, .. }, admission) => {
                self.answer(false, &done_or_refused(done, admission));
            }
            (MakerCommand::InverseKinematics { .. }, refused)
                // A command that is queued or finds no arm ends later, with two events.
                if !matches!(refused, Admission::Queued | Admission::NoArm) =>
            {
                self.answer(false, &done_or_refused("", refused));
            }
            (command, _) => self.current = Some(command),
        }
    }

    /// Answers the first of the commands that found no room.
    fn answer_refused(&mut self, count: usize) {
        if count > 1 {
            self.waiting.push_front(WaitingMessage::Refused(count - 1));
        }
        self.answers.push_back(no_room().to_string());
    }

    /// Answers a stop once the outcome of the hold is known.
    fn finish_stop(&mut self, hub: &Hub) {
        let answer = match hub.hold_outcome() {
            Some(HoldOutcome::Holds | HoldOutcome::Limp) => message("Stopped"),
            Some(HoldOutcome::Unconfirmed) => error("The arm did not confirm the stop: it may be moving"),
            Some(HoldOutcome::NotRestored) => {
                error("The arm is stopped, but did not take back its speeds or its set-point period")
            }
            None if !hub.has_arm() || !hub.is_holding() => error("The arm does not answer"),
            None => return,
        };
        self.current = None;
        self.answer(false, &answer);
    }

    fn finish_read(&mut self, event: HubEvent) {
        match (self.current.take(), event) {
            (
                Some(command @ MakerCommand::InverseKinematics { .. }),
                event @ (HubEvent::Reply { .. } | HubEvent::NoReply { .. }),
            ) => match self.first.take() {
                None => (self.first, self.current) = (Some(event), Some(command)),
                Some(before) => self.answer(false, &solution(&before, &event)),
            },
            (Some(_), HubEvent::Reply { values, .. }) => {
                self.answer(true, &json!({"status": "ok", "data": values}))
            }
            (Some(command), HubEvent::NoReply { .. }) => {
                self.answer(is_read(&Ok(command)), &error("The arm does not answer"));
            }
            // Reports are not sent: the maker's programs take any message for an answer.
            (current, _) => self.current = current,
        }
    }

    /// Sends an answer, if the client expects one.
    fn answer(&mut self, is_read: bool, answer: &Value) {
        if is_read || self.is_browser {
            self.answers.push_back(answer.to_string());
        }
    }
}

/// The request of a command to the arm; `None` for a ping or a stop.
fn request(command: &MakerCommand) -> Option<WholeRequest> {
    Some(match command {
        MakerCommand::Ping | MakerCommand::Stop => return None,
        MakerCommand::Write { address, values, .. } => write(*address, values.clone()),
        &MakerCommand::Read { address, count } => WholeRequest::Read { address, count },
        MakerCommand::InverseKinematics { address, values } => WholeRequest::WritesBetweenReads {
            map: Map::V21,
            writes: solving_writes(*address, values),
            read: (FRAMES_REFUSED.address, FRAMES_REFUSED.count),
        },
    })
}

/// A write by function 04, so that offsets have the forms of the maker's programs ([M5](protocol_core::decisions#m5)).
fn write(address: u8, values: Vec<u8>) -> WholeRequest {
    WholeRequest::Write { map: Map::V21, address, values }
}

/// The writes of a block. As on the maker's arm, the first one switches the motors to the servo state, if the position has
/// a solution.
fn solving_writes(address: u8, values: &[u8]) -> Vec<(u8, Vec<u8>)> {
    let block = (address, values.to_vec());
    let engage = has_solution(address, values).then(|| (MOTOR_STATE.address, vec![motor_state::SERVO]));
    engage.into_iter().chain([block]).collect()
}

/// The answer to a block, from the arm's counter of refused frames before and after the writes. The counter shows a
/// refusal, because no other client's frame is between the two reads. The maker's firmware has no such counter: there the answer
/// means nothing.
fn solution(before: &HubEvent, after: &HubEvent) -> Value {
    match (before, after) {
        (HubEvent::Reply { values: before, .. }, HubEvent::Reply { values: after, .. }) => {
            if before == after { message("IK calculation completed") } else { error("IK calculation failed") }
        }
        _ => error("The arm does not answer"),
    }
}

/// The answer to a command whose request was queued or refused.
fn done_or_refused(done: &str, admission: Admission) -> Value {
    match admission {
        Admission::Queued => message(done),
        Admission::NoRoom => no_room(),
        Admission::NoArm => error("The arm does not answer"),
        Admission::ReadOnly => error("The server is read-only"),
        Admission::Stopped => error("Another program stopped the arm: pause for a second to start anew"),
        Admission::Late => error("The command waited too long"),
        Admission::AnotherDrives => error("Another program drives the arm"),
    }
}

fn no_room() -> Value {
    error("Too many commands wait")
}

/// Is the message a read? Only a read is answered to every client.
fn is_read(command: &Result<MakerCommand, MakerCommandError>) -> bool {
    match command {
        Ok(command) => matches!(command, MakerCommand::Read { .. }),
        Err(error) => error.is_read,
    }
}

fn message(text: &str) -> Value {
    json!({"status": "ok", "message": text})
}

fn error(text: &str) -> Value {
    json!({"status": "error", "message": text})
}
