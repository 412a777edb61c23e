//! The WebSocket of a class, with text messages. The browser calls the handler when a message arrives, also in a tab in the
//! background, which draws no pictures.

use std::cell::Cell;
use std::rc::Rc;

use wasm_bindgen::prelude::Closure;
use wasm_bindgen::{JsCast, JsValue};
use web_sys::{Event, MessageEvent, WebSocket};

use crate::source::socket::address;

pub(super) struct ClassSocket {
    socket: WebSocket,
    is_closed: Rc<Cell<bool>>,
    // Kept, because the browser calls these closures until the socket is dropped.
    _opened: Closure<dyn FnMut(Event)>,
    _message: Closure<dyn FnMut(MessageEvent)>,
    _closed: Closure<dyn FnMut(Event)>,
}

impl ClassSocket {
    /// Connects to the class of the server that this page came from. Calls `opened` when the connection is open, and `heard` with
    /// each message.
    pub(super) fn connect(
        code: &str,
        mut opened: impl FnMut() + 'static,
        mut heard: impl FnMut(String) + 'static,
    ) -> Result<Self, JsValue> {
        let code = String::from(js_sys::encode_uri_component(code));
        let socket = WebSocket::new(&address("class", &format!("?token={code}"))?)?;
        let is_closed = Rc::new(Cell::new(false));
        let opened = Closure::<dyn FnMut(Event)>::new(move |_| opened());
        socket.set_onopen(Some(opened.as_ref().unchecked_ref()));
        let message = Closure::<dyn FnMut(MessageEvent)>::new(move |event: MessageEvent| {
            event.data().as_string().into_iter().for_each(&mut heard);
        });
        socket.set_onmessage(Some(message.as_ref().unchecked_ref()));
        let flag = Rc::clone(&is_closed);
        let closed = Closure::<dyn FnMut(Event)>::new(move |_| flag.set(true));
        socket.set_onclose(Some(closed.as_ref().unchecked_ref()));
        Ok(Self { socket, is_closed, _opened: opened, _message: message, _closed: closed })
    }

    /// Has the connection ended, or did it fail to open?
    pub(super) fn is_closed(&self) -> bool {
        self.is_closed.get()
    }

    /// Sends a message. Returns false if the socket is not open or did not accept the message.
    pub(super) fn send(&self, text: &str) -> bool {
        self.socket.ready_state() == WebSocket::OPEN && self.socket.send_with_str(text).is_ok()
    }
}

impl Drop for ClassSocket {
    fn drop(&mut self) {
        self.socket.set_onopen(None);
        self.socket.set_onmessage(None);
        self.socket.set_onclose(None);
        // Without a code and a reason, `close` cannot fail.
        let _ = self.socket.close();
    }
}
