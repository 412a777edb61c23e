//! A tab of a class on its WebSocket: messages in JSON.

use std::sync::Arc;

use protocol_core::time::Instant;
use tokio::sync::Notify;
use tungstenite::Message;

use classroom::ConnectionId;

use super::answer::Role;
use super::class::Class;
use super::seat::End;
use super::web_socket::SocketSession;

/// A tab of a class. A dropped session is a lost connection.
pub(super) struct ClassSession {
    class: Arc<Class>,
    id: ConnectionId,
    wake: Arc<Notify>,
    is_closing: bool,
}

impl ClassSession {
    /// Opens the session of a new tab. `key` is a new secret; a teacher's screen does not use it.
    pub(super) fn open(class: &Arc<Class>, role: Role, key: String) -> Self {
        let id = class.with(|room, now| match role {
            Role::Pupil => room.open_pupil(now, key),
            Role::Teacher => room.open_teacher(),
        });
        Self { class: Arc::clone(class), id, wake: class.join(id), is_closing: false }
    }

    /// The message that closes the connection, once, if the class ends it.
    fn farewell(&mut self) -> Option<Message> {
        let is_over = !self.is_closing && self.class.with(|room, _| room.is_over(self.id));
        self.is_closing |= is_over;
        is_over.then_some(Message::Close(None))
    }
}

impl SocketSession for ClassSession {
    fn advance(&mut self, can_send: bool) -> Option<Message> {
        if !can_send {
            return None;
        }
        let message = self.class.with(|room, now| room.next_message(now, self.id));
        message.map(Message::text).or_else(|| self.farewell())
    }

    fn has_room(&self) -> bool {
        true
    }

    fn put(&mut self, _since: Instant, message: Message) {
        if let Message::Text(text) = message {
            self.class.with(|room, now| room.receive(now, self.id, &text));
        }
    }

    fn news(&self) -> impl Future<Output = ()> + Send {
        self.wake.notified()
    }

    fn close(self, _end: End) {}
}

impl Drop for ClassSession {
    fn drop(&mut self) {
        self.class.part(self.id);
    }
}
