//! An arm behind `sevenbot view` or `sevenbot class`, through a WebSocket whose binary messages carry the bytes of frames.

use std::cell::RefCell;
use std::rc::Rc;

use wasm_bindgen::prelude::Closure;
use wasm_bindgen::{JsCast, JsValue};
use web_sys::{BinaryType, CloseEvent, MessageEvent, WebSocket};

use super::{LineState, Source};

/// A line over a WebSocket to the server that the page came from.
pub struct SocketSource {
    socket: WebSocket,
    shared: Rc<RefCell<SocketState>>,
    // Kept, because the browser calls these closures until the socket is dropped.
    _message: Closure<dyn FnMut(MessageEvent)>,
    _close: Closure<dyn FnMut(CloseEvent)>,
}

#[derive(Default)]
struct SocketState {
    received: Vec<u8>,
    closed: Option<String>,
}

impl SocketSource {
    /// Connects to the server that this page came from, with the query of the page's address, which contains the token.
    ///
    /// # Errors
    /// The page has no address, or the browser refuses the address of the server.
    pub fn connect() -> Result<Self, JsValue> {
        let query = web_sys::window().ok_or("no window")?.location().search()?;
        Self::connect_with(&query)
    }

    /// Connects to the server that this page came from, with a query such as `?token=TOKEN`.
    ///
    /// # Errors
    /// The page has no address, or the browser refuses the address of the server.
    pub fn connect_with(query: &str) -> Result<Self, JsValue> {
        let socket = WebSocket::new(&address("frames", query)?)?;
        socket.set_binary_type(BinaryType::Arraybuffer);
        let shared = Rc::new(RefCell::new(SocketState::default()));
        let inbox = Rc::clone(&shared);
        let message = Closure::<dyn FnMut(MessageEvent)>::new(move |event: MessageEvent| {
            if let Ok(buffer) = event.data().dyn_into::<js_sys::ArrayBuffer>() {
                inbox.borrow_mut().received.extend(js_sys::Uint8Array::new(&buffer).to_vec());
            }
        });
        socket.set_onmessage(Some(message.as_ref().unchecked_ref()));
        let inbox = Rc::clone(&shared);
        let close = Closure::<dyn FnMut(CloseEvent)>::new(move |event: CloseEvent| {
            inbox.borrow_mut().closed = Some(event.reason());
        });
        socket.set_onclose(Some(close.as_ref().unchecked_ref()));
        Ok(Self { socket, shared, _message: message, _close: close })
    }
}

/// The address of a WebSocket of the server that this page came from.
///
/// # Errors
/// The page has no address.
pub fn address(path: &str, query: &str) -> Result<String, JsValue> {
    let location = web_sys::window().ok_or("no window")?.location();
    let scheme = if location.protocol()? == "https:" { "wss" } else { "ws" };
    Ok(format!("{scheme}://{}/{path}{query}", location.host()?))
}

impl Drop for SocketSource {
    fn drop(&mut self) {
        self.socket.set_onmessage(None);
        self.socket.set_onclose(None);
        // Without a code and a reason, `close` cannot fail.
        let _ = self.socket.close();
    }
}

impl Source for SocketSource {
    fn send(&mut self, bytes: &[u8]) {
        if self.state() == LineState::Open && !bytes.is_empty() {
            // Ignore a failure here: it closes the socket, which sets the state.
            let _ = self.socket.send_with_u8_array(bytes);
        }
    }

    fn receive(&mut self) -> Vec<u8> {
        std::mem::take(&mut self.shared.borrow_mut().received)
    }

    fn state(&self) -> LineState {
        match (self.socket.ready_state(), &self.shared.borrow().closed) {
            (_, Some(reason)) => LineState::Closed(reason.clone()),
            (WebSocket::OPEN, None) => LineState::Open,
            (WebSocket::CONNECTING, None) => LineState::Opening,
            _ => LineState::Closed(String::new()),
        }
    }
}
