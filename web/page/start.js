import init, * as sevenbot from "./sevenbot_web.js";

// The second part of the module, which the first picture does not need.
const REST = new URL("rest.wasm", import.meta.url);

const first = await init({ module_or_path: new URL("sevenbot_web_bg.wasm", import.meta.url) });
let isRestThere = false;

// `loadRest` may be faster than `loadRestInTime`. The later of the two has no effect.
function enter(module) {
  if (!isRestThere) new WebAssembly.Instance(module, { first });
  isRestThere = true;
}

// The first part of the module calls this before it uses the rest. The call is synchronous, so the request has to block. Such a
// request cannot return an `ArrayBuffer`: the bytes come as characters.
window.loadRest = () => {
  if (isRestThere) return;
  const request = new XMLHttpRequest();
  request.open("GET", REST, false);
  request.overrideMimeType("text/plain; charset=x-user-defined");
  request.send();
  enter(new WebAssembly.Module(Uint8Array.from(request.responseText, (letter) => letter.charCodeAt(0))));
};

async function loadRestInTime() {
  try {
    const response = await fetch(REST);
    enter(await WebAssembly.compile(await response.arrayBuffer()));
  } catch {
    setTimeout(loadRestInTime, 1000);
  }
}

function afterFirstPicture() {
  if (sevenbot.frame_count() > 1) loadRestInTime();
  else requestAnimationFrame(afterFirstPicture);
}

sevenbot.start();
// For tests and the console of the browser: state(), project(x, y, z), frame_count(), memory_size().
window.sevenbot = sevenbot;
afterFirstPicture();
