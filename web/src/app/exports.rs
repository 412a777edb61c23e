//! What the module exports for tests and for the console of the browser.

use glam::Vec3;
use wasm_bindgen::prelude::wasm_bindgen;

use super::page::with_app;
use crate::arm_state::tip;

/// The state of the page as JSON: angles and targets in degrees, the tip in mm, the time in microseconds. The angle of a joint
/// that was not measured is its target.
#[wasm_bindgen]
#[must_use]
pub fn state() -> String {
    with_app(|app| {
        let state = app.client.state();
        let registers = app.client.registers();
        let bytes = registers.values.iter().map(u8::to_string).collect::<Vec<_>>().join(",");
        format!(
            r#"{{"connected":{},"measured":{:?},"targets":{:?},"missing":{},"faults":{},"motors":{},"tip":{:?},"time":{},"stop":"{:?}","registers":[{bytes}]}}"#,
            app.client.is_connected(),
            state.angles(),
            state.targets,
            state.missing,
            state.faults,
            state.motor_state,
            tip(state.angles()),
            app.now().as_micros(),
            app.client.stop_progress(),
        )
    })
    .unwrap_or_default()
}

/// Projects a point in mm to CSS pixels from the top left of the page's window. `None` if there is no picture of the arm, or if
/// the point is behind the camera or less than 20 mm in front of it.
#[wasm_bindgen]
#[must_use]
pub fn project(x: f32, y: f32, z: f32) -> Option<Vec<f64>> {
    with_app(|app| {
        let place = app.scene.as_ref()?.project(Vec3::new(x, y, z))?;
        let canvas = app.dom.element("scene")?.get_bounding_client_rect();
        Some(vec![f64::from(place.x) + canvas.left(), f64::from(place.y) + canvas.top()])
    })?
}

/// The number of calls of `App::frame` since the start. The browser makes one before each picture.
#[wasm_bindgen]
#[must_use]
pub fn frame_count() -> u32 {
    with_app(|app| app.frames).unwrap_or(0)
}

/// The memory of the module in bytes.
#[wasm_bindgen]
#[must_use]
pub fn memory_size() -> u32 {
    u32::try_from(core::arch::wasm32::memory_size(0) << 16).unwrap_or(u32::MAX)
}
