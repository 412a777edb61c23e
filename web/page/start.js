import init, * as sevenbot from "./sevenbot_web.js";

await init({ module_or_path: new URL("sevenbot_web_bg.wasm", import.meta.url) });
// For tests and the console of the browser: state(), project(x, y, z), frame_count().
window.sevenbot = sevenbot;
