//! Loads the rest of the WebAssembly module, which the first picture does not need. `cargo xtask web` splits the module.

use core::cell::Cell;

use wasm_bindgen::prelude::wasm_bindgen;

thread_local! {
    static IS_LOADED: Cell<bool> = const { Cell::new(false) };
}

#[wasm_bindgen]
extern "C" {
    /// `loadRest` of `start.js`: loads the rest, unless it is loaded. Blocks until it is loaded.
    #[wasm_bindgen(js_name = loadRest)]
    fn load_rest();
}

/// Returns when the rest is there. The first part calls this before each function of the rest.
#[wasm_bindgen]
pub fn need_rest() {
    if !IS_LOADED.get() {
        load_rest();
        IS_LOADED.set(true);
    }
}
