//! An arm on this computer's USB, through Web Serial, which only some browsers have.

use std::cell::RefCell;
use std::rc::Rc;

use js_sys::{Function, Object, Promise, Reflect, Uint8Array};
use wasm_bindgen::{JsCast, JsValue};
use wasm_bindgen_futures::{JsFuture, spawn_local};

use super::{LineState, Source};

/// The baud rate of an arm as it is delivered.
const BAUD: u32 = 115_200;

/// A serial port of this computer.
pub struct SerialSource(Rc<RefCell<SerialPort>>);

struct SerialPort {
    received: Vec<u8>,
    state: LineState,
    port: Option<JsValue>,
    writer: Option<JsValue>,
    reader: Option<JsValue>,
}

impl SerialSource {
    /// Lets the user choose a port, and opens the port. Call this only while the page handles an input of the user, such as a
    /// click: the browser allows the choice only then. `None` if the browser has no Web Serial.
    #[must_use]
    pub fn ask() -> Option<Self> {
        let navigator = web_sys::window()?.navigator();
        let serial = get(&navigator, "serial").filter(JsValue::is_object)?;
        let port = SerialPort {
            received: Vec::new(),
            state: LineState::Opening,
            port: None,
            writer: None,
            reader: None,
        };
        let port = Rc::new(RefCell::new(port));
        let shared = Rc::clone(&port);
        spawn_local(async move {
            let ended = run(&serial, &shared).await;
            let reason = ended.err().map_or(String::new(), |reason| message(&reason));
            shared.borrow_mut().state = LineState::Closed(reason);
        });
        Some(Self(port))
    }
}

/// Opens a port, and stores the received bytes until the port closes.
async fn run(serial: &JsValue, shared: &Rc<RefCell<SerialPort>>) -> Result<(), JsValue> {
    let port = call(serial, "requestPort", &[])?.await?;
    let options = Object::new();
    Reflect::set(&options, &"baudRate".into(), &BAUD.into())?;
    call(&port, "open", &[options.into()])?.await?;
    let stream = |name, getter| {
        let stream = get(&port, name).ok_or("the port has no stream")?;
        function(&stream, getter)?.call0(&stream)
    };
    let (reader, writer) = (stream("readable", "getReader")?, stream("writable", "getWriter")?);
    {
        let mut shared = shared.borrow_mut();
        (shared.port, shared.reader) = (Some(port.clone()), Some(reader.clone()));
        (shared.writer, shared.state) = (Some(writer), LineState::Open);
    }
    loop {
        let chunk = call(&reader, "read", &[])?.await?;
        if get(&chunk, "done").is_some_and(|done| done.is_truthy()) {
            return Ok(());
        }
        let bytes = get(&chunk, "value").unwrap_or_default();
        shared.borrow_mut().received.extend(Uint8Array::new(&bytes).to_vec());
    }
}

fn get(object: &JsValue, name: &str) -> Option<JsValue> {
    Reflect::get(object, &name.into()).ok().filter(|value| !value.is_undefined())
}

fn function(object: &JsValue, name: &str) -> Result<Function, JsValue> {
    get(object, name).unwrap_or_default().dyn_into()
}

fn call(object: &JsValue, name: &str, values: &[JsValue]) -> Result<JsFuture, JsValue> {
    let list: js_sys::Array = values.iter().collect();
    let promise = Reflect::apply(&function(object, name)?, object, &list)?;
    Ok(JsFuture::from(promise.dyn_into::<Promise>()?))
}

fn message(reason: &JsValue) -> String {
    get(reason, "message").and_then(|text| text.as_string()).unwrap_or_default()
}

impl Drop for SerialSource {
    fn drop(&mut self) {
        let port = self.0.borrow();
        let (reader, writer, port) = (port.reader.clone(), port.writer.clone(), port.port.clone());
        spawn_local(async move {
            // Ignore errors: each of these may have ended already.
            if let Some(Ok(done)) = reader.map(|reader| call(&reader, "cancel", &[])) {
                let _ = done.await;
            }
            if let Some(Ok(done)) = writer.map(|writer| call(&writer, "close", &[])) {
                let _ = done.await;
            }
            if let Some(Ok(done)) = port.map(|port| call(&port, "close", &[])) {
                let _ = done.await;
            }
        });
    }
}

impl Source for SerialSource {
    fn send(&mut self, bytes: &[u8]) {
        let port = self.0.borrow();
        if let (Some(writer), false) = (&port.writer, bytes.is_empty()) {
            // The writer queues the bytes in order. Ignore a failure here: it also ends the reader, which sets the state.
            if let Ok(sent) = call(writer, "write", &[Uint8Array::from(bytes).into()]) {
                spawn_local(async move {
                    let _ = sent.await;
                });
            }
        }
    }

    fn receive(&mut self) -> Vec<u8> {
        std::mem::take(&mut self.0.borrow_mut().received)
    }

    fn state(&self) -> LineState {
        self.0.borrow().state.clone()
    }
}
