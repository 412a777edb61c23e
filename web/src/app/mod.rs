//! The page in a browser: connects the sources, the client, the scene and the panels.
//!
//! ```text
//!   source ──▶ client ──▶ ArmState ──▶ scene, panels
//!     ▲           ▲
//!     └── bytes ──┴── events of a person
//! ```
//!
//! The main files: among these, each imports only files of its own group or of groups before it. class.rs, programs.rs and
//! exercises.rs, with the files that they import, add the class, the programs of blocks and the exercises to `App`.
//!
//! ```text
//!   dom.rs, storage.rs, kept_recording.rs ──▶ page.rs ──▶ panels.rs, hand.rs, recording.rs, ──▶ controls.rs
//!   (the browser's elements and storage)     (App)      time_line.rs (what it shows,         (numbers and
//!                                                        pointers, movements)                 buttons)
//!                ──▶ picture.rs, events.rs, movements.rs, connection.rs, exports.rs ──▶ mod.rs
//!                    (before each picture; clicks and keys; what moves the arm by        (start)
//!                     itself; which arm it is; tests)
//! ```

mod class;
mod class_socket;
mod class_tab;
mod connection;
mod controls;
mod dom;
mod editor;
mod events;
mod exercise_list;
mod exercises;
mod exports;
mod files;
mod hand;
mod kept_recording;
mod link;
mod movements;
mod page;
mod panels;
mod picture;
mod program_state;
mod programs;
mod recording;
mod rest;
mod storage;
mod time_line;
mod time_line_state;

use std::cell::RefCell;
use std::rc::Rc;

use wasm_bindgen::prelude::{Closure, wasm_bindgen};
use wasm_bindgen::{JsCast, JsValue};

use dom::Dom;
use page::{App, with_app};

/// Starts the page.
///
/// # Errors
/// The page lacks an element, or the browser refuses something that the page needs, such as a 2D canvas.
#[wasm_bindgen]
pub fn start() -> Result<(), JsValue> {
    let dom = Dom::of_window()?;
    panels::build(&dom)?;
    App::start(dom.clone())?;
    events::listen(&dom)?;
    with_app(|app| {
        app.set_language(app.language);
        app.show_first_arm();
        app.open_link();
        app.open_class();
    });
    request_frames()
}

/// Asks the browser to call [`App::frame`] before each picture, from now on.
fn request_frames() -> Result<(), JsValue> {
    type Callback = Closure<dyn FnMut(f64)>;
    let callback: Rc<RefCell<Option<Callback>>> = Rc::default();
    let again = Rc::clone(&callback);
    *callback.borrow_mut() = Some(Closure::new(move |time| {
        with_app(|app| app.frame(time));
        if let Some(callback) = again.borrow().as_ref() {
            // This cannot fail: the window exists, because it made this call.
            let _ = request_frame(callback);
        }
    }));
    callback.borrow().as_ref().map_or(Ok(()), request_frame)
}

fn request_frame(callback: &Closure<dyn FnMut(f64)>) -> Result<(), JsValue> {
    let window = web_sys::window().ok_or("no window")?;
    window.request_animation_frame(callback.as_ref().unchecked_ref()).map(|_| ())
}
