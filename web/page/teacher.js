// The teacher's screen: shows each pupil as a tile, and sends the teacher's commands. A text of a pupil is shown as plain
// text, never as HTML. docs/class.md describes the messages.

// Each text by its name: English, Chinese.
const TEXTS = {
  title: ["7Bot V2: the class", "7Bot V2：课堂"],
  language: ["中文", "English"],
  stop: ["STOP all", "全部停止"],
  "stop-key": ["space bar", "空格键"],
  close: ["Close", "关闭"],
  message: ["Message to all", "给全体的消息"],
  send: ["Send", "发送"],
  unsay: ["Take it back", "撤回"],
  said: ["All see:", "全体可见："],
  arm: ["The real arm", "真机"],
  "take-back": ["Take it back", "收回"],
  minutes: ["Minutes", "分钟"],
  give: ["Give the real arm", "交出真机"],
  pupils: ["Pupils", "学生"],
  nobody: ["Nobody is here yet.", "还没有学生加入。"],
  open: ["Pupils open", "学生打开"],
  code: ["class code", "课堂代码"],
  connecting: ["Connecting to the class …", "正在连接课堂……"],
  "connection-lost": ["The connection to `sevenbot class` was lost. Trying again …", "与 `sevenbot class` 的连接已断开，正在重试……"],
  restarted: ["There is still no connection to `sevenbot class`. If it was started again, open the new address that it printed.", "与 `sevenbot class` 仍无连接。如果它已重新启动，请打开它显示的新地址。"],
  "not-sent": ["NOT SENT: there is no connection to `sevenbot class`. Try again when it is back.", "未发送：与 `sevenbot class` 没有连接。连接恢复后请重试。"],
  "bad-address": ["Open the address that `sevenbot class` printed: this one has no secret.", "请打开 `sevenbot class` 显示的地址：此地址不含密钥。"],
  full: ["There are too many teacher's screens. Close one, and load this page again.", "教师屏幕过多。请关闭一个，然后重新加载。"],
  here: ["pupils are here", "名学生在线"],
  asked: ["Stopping: confirmed by", "正在停止：已确认"],
  "last-stop": ["Last stop: confirmed by all arms", "上次停止：全部机械臂已确认"],
  of: ["of", "/"],
  after: ["after", "用时"],
  "not-confirmed": ["Not confirmed:", "未确认："],
  "real-arm": ["the real arm", "真机"],
  lost: ["connection lost", "连接已断开"],
  silent: ["does not answer", "无应答"],
  hidden: ["the tab is in the background", "标签页在后台"],
  stopped: ["stopped: holds", "已停止：保持不动"],
  limp_stopped: ["stopped: the motors are off", "已停止：电机已关闭"],
  stopping_all: ["stop not confirmed yet", "停止尚未确认"],
  goals: ["goals reached:", "已达到的目标："],
  solved: ["exercise solved", "练习完成"],
  "arm-silent": ["does not answer: check its power and its cable", "没有应答：请检查电源和连接线"],
  "arm-free": ["nobody has it", "无人控制"],
  "arm-held": ["holds", "保持不动"],
  "arm-limp": ["its motors are off", "电机已关闭"],
  "arm-holding": ["is being held", "正在停住"],
  has: ["has it", "正在控制"],
  no_arm: ["The class has no real arm: start `sevenbot class` with --port.", "课堂没有真机：请用 --port 启动 `sevenbot class`。"],
  arm_silent: ["The real arm does not answer, so it was not given.", "真机没有应答，未交出。"],
  pupil_gone: ["This pupil is not connected, so the real arm was not given.", "该学生未连接，真机未交出。"],
  bad_time: ["Give the arm for a second to 60 minutes.", "时间应为 1 秒到 60 分钟。"],
  doing: {
    no_arm: ["the arm does not answer", "机械臂无应答"],
    ready: ["ready", "就绪"],
    moving: ["moves", "正在移动"],
    program: ["a program runs", "程序正在运行"],
    playing: ["plays a movement", "正在播放动作"],
    parking: ["is being parked", "正在停放"],
    stopping: ["is stopping", "正在停止"],
    stopped: ["stopped: holds", "已停止：保持不动"],
    stop_failed: ["did not take the stop", "没有接受停止命令"],
    limp: ["motors off", "电机已关闭"],
    blocked: ["a joint is blocked", "有关节被卡住"],
    problem: ["something is wrong with the arm", "机械臂出现问题"],
  },
};
const BAD = ["no_arm", "stop_failed", "blocked", "problem"];
const RETRY_MS = 1000;
// After this many failed attempts, assume that the class has ended: an interrupted network is less likely.
const MOST_REFUSED = 5;
// The server sends the state of the class about twice a second or more often. Silence for this long counts as a lost connection.
const SILENCE_MS = 3000;

const $ = id => document.getElementById(id);
// Runs `act`, which accesses the storage. Returns null if the browser blocks the storage: then the access throws.
const stored = act => {
  try {
    return act();
  } catch {
    return null;
  }
};
let language = (stored(() => localStorage.getItem("language")) ?? navigator.language).startsWith("zh") ? 1 : 0;
const text = name => TEXTS[name][language];
let socket, welcome, shown;
let drawn = 0;
// The number of lost or failed connections since a connection was last opened.
let refused = 0;

// Change a text only if it differs: a screen reader announces a live region on each change.
function setText(element, value) {
  if (element.textContent !== value) element.textContent = value;
}

function notice(value) {
  setText($("notice"), value);
  $("notice-bar").hidden = value === "";
}

// Remove the secret from the address bar, which a projector may show. The storage of this tab keeps it for a reload.
function takeSecret() {
  const given = new URLSearchParams(location.search).get("token");
  if (given) {
    stored(() => sessionStorage.setItem("teacher", given));
    history.replaceState(null, "", location.pathname);
  }
  return given ?? stored(() => sessionStorage.getItem("teacher"));
}

function connect(secret) {
  const scheme = location.protocol === "https:" ? "wss" : "ws";
  socket = new WebSocket(`${scheme}://${location.host}/teacher?token=${encodeURIComponent(secret)}`);
  const own = socket;
  let isFull = false;
  let isOver = false;
  let silence;
  const end = () => {
    if (isOver) return;
    isOver = true;
    clearTimeout(silence);
    own.close();
    shown = undefined;
    if (isFull) return;
    refused += 1;
    const lost = refused > MOST_REFUSED ? "restarted" : "connection-lost";
    setText($("state"), text(welcome ? lost : "bad-address"));
    $("state").className = "bad";
    setTimeout(() => connect(secret), RETRY_MS);
  };
  const hear = () => {
    clearTimeout(silence);
    // A network failure does not close the socket, so a timer detects it.
    silence = setTimeout(end, SILENCE_MS);
  };
  socket.onopen = () => {
    refused = 0;
    hear();
  };
  socket.onmessage = event => {
    if (isOver) return;
    hear();
    const message = JSON.parse(event.data);
    if (message === "full") {
      isFull = true;
      setText($("state"), text("full"));
    } else if (message.welcome) {
      welcome = message.welcome;
      show();
    } else if (message.class) {
      shown = message.class;
      show();
    } else if (message.not_given) {
      notice(text(message.not_given));
    }
  };
  socket.onclose = end;
}

function send(message) {
  if (socket?.readyState === WebSocket.OPEN) socket.send(JSON.stringify(message));
  else notice(text("not-sent"));
}

function show() {
  if (welcome) {
    const code = welcome.code ? ` · ${text("code")} ${welcome.code}` : "";
    setText($("join"), `${text("open")} ${welcome.addresses.join(", ")}${code}`);
  }
  if (!shown) return;
  showState();
  setText($("said"), shown.text ? `${text("said")} ${shown.text}` : "");
  showArm();
  $("nobody").hidden = shown.pupils.length > 0;
  const tiles = $("tiles");
  for (const tile of [...tiles.children]) {
    if (!shown.pupils.some(pupil => tile.id === `pupil-${pupil.pupil}`)) tile.remove();
  }
  shown.pupils.forEach(pupil => showTile($(`pupil-${pupil.pupil}`) ?? addTile(pupil), pupil));
  drawn += 1;
}

function showState() {
  const here = shown.pupils.filter(pupil => pupil.presence === "here").length;
  const stop = shown.stop;
  let line = `${here} ${text("here")}.`;
  let mood = "";
  if (stop && stop.confirmed < stop.asked) {
    const missing = shown.pupils.filter(pupil => pupil.stop === "asked").map(pupil => pupil.name);
    if (shown.arm?.stop === "asked") missing.push(text("real-arm"));
    line = `${text("asked")} ${stop.confirmed} ${text("of")} ${stop.asked}. ${text("not-confirmed")} ${missing.join(", ")}`;
    mood = "bad";
  } else if (stop) {
    line += ` ${text("last-stop")} (${stop.confirmed}), ${text("after")} ${stop.millis} ms.`;
    mood = stop.confirmed > 0 ? "good" : "";
  }
  setText($("state"), line);
  $("state").className = mood;
}

function showArm() {
  const arm = shown.arm;
  $("arm").hidden = !arm;
  if (!arm) return;
  const holder = shown.pupils.find(pupil => pupil.pupil === arm.holder);
  const held = { asked: "arm-holding", holds: "arm-held", limp: "arm-limp" }[arm.stop];
  const who = holder ? `${holder.name} ${text("has")}` : [text("arm-free"), held && text(held)].filter(Boolean).join(" · ");
  setText($("arm-state"), arm.answers ? who : text("arm-silent"));
  setText($("arm-time"), holder ? time(arm.seconds) : "");
  document.querySelector("[data-action=take-back]").disabled = !holder;
}

const time = seconds => `${Math.floor(seconds / 60)}:${String(seconds % 60).padStart(2, "0")}`;

function addTile({ pupil }) {
  const tile = document.createElement("li");
  tile.id = `pupil-${pupil}`;
  const add = (kind, name) => {
    const element = document.createElement(kind);
    element.className = name;
    tile.append(element);
    return element;
  };
  add("h3", "name");
  const canvas = add("canvas", "picture");
  [canvas.width, canvas.height] = [240, 180];
  canvas.setAttribute("aria-hidden", "true");
  ["doing", "stopped", "more"].forEach(name => add("p", name));
  const give = add("button", "give");
  give.type = "button";
  give.dataset.action = "give";
  give.dataset.pupil = pupil;
  $("tiles").append(tile);
  return tile;
}

function showTile(tile, pupil) {
  const part = name => tile.querySelector(`.${name}`);
  const { report, presence } = pupil;
  const isHolder = shown.arm?.holder === pupil.pupil;
  const doing = presence === "here" ? report && TEXTS.doing[report.doing][language] : text(presence);
  // Do not show "stopped" for an arm that moves again.
  const isStopped = pupil.stop === "asked" || ["stopped", "limp"].includes(report?.doing);
  const stopped = isStopped && { asked: "stopping_all", holds: "stopped", limp: "limp_stopped" }[pupil.stop];
  const goals = report?.goals;
  const solved = goals && goals.reached >= goals.all;
  const more = [
    goals && (solved ? text("solved") : `${text("goals")} ${goals.reached} ${text("of")} ${goals.all}`),
    presence === "here" && report?.is_hidden && text("hidden"),
    isHolder && `${text("real-arm")} ${time(shown.arm.seconds)}`,
  ];
  setText(part("name"), pupil.name);
  setText(part("doing"), doing ?? "");
  setText(part("stopped"), stopped ? text(stopped) : "");
  setText(part("more"), more.filter(Boolean).join(" · "));
  const isBad = presence !== "here" || BAD.includes(report?.doing) || pupil.stop === "asked";
  const classes = [isBad && "bad", presence === "lost" && "lost", isHolder && "holder"];
  tile.className = classes.filter(Boolean).join(" ");
  const give = part("give");
  give.hidden = !shown.arm;
  give.disabled = isHolder || presence !== "here";
  setText(give, text("give"));
  give.setAttribute("aria-label", `${text("give")}: ${pupil.name}`);
  draw(part("picture"), report?.points, isBad);
}

// Projects a point in mm to pixels of the canvas. The view is from a corner, so that each axis is visible: x to the right, y to
// the back, z up.
const place = ([x, y, z]) => [120 + 0.3 * (x - 0.45 * (y - 120)), 150 - 0.3 * (z + 60 + 0.35 * (y - 120))];

function draw(canvas, points, isBad) {
  const colours = getComputedStyle(document.documentElement);
  const colour = name => colours.getPropertyValue(name).trim();
  const shape = JSON.stringify([points, isBad, colour("--line"), matchMedia("(prefers-color-scheme: dark)").matches]);
  if (canvas.dataset.shape === shape) return;
  canvas.dataset.shape = shape;
  const context = canvas.getContext("2d");
  const paint = name => {
    // Let the browser resolve `light-dark()`, which needs an element: the canvas does not accept it.
    canvas.style.color = `var(${name})`;
    return getComputedStyle(canvas).color;
  };
  context.clearRect(0, 0, canvas.width, canvas.height);
  const line = (width, name, ends) => {
    [context.lineWidth, context.strokeStyle, context.lineCap, context.lineJoin] = [width, paint(name), "round", "round"];
    context.beginPath();
    ends.map(place).forEach(([u, v], index) => (index ? context.lineTo(u, v) : context.moveTo(u, v)));
    context.stroke();
  };
  const corners = [[-250, -100, -60], [250, -100, -60], [250, 350, -60], [-250, 350, -60], [-250, -100, -60]];
  line(1, "--line", corners);
  if (!points) return;
  const shadow = points.map(([x, y]) => [x, y, -60]);
  line(4, "--line", [[0, 0, -60], ...shadow]);
  line(12, "--quiet", [[0, 0, -60], [0, 0, 0]]);
  line(7, isBad ? "--bad" : "--text", [[0, 0, 0], ...points.slice(0, 4)]);
  line(5, "--accent", points.slice(3));
}

const ACTIONS = {
  stop: () => send("stop_all"),
  say: () => {
    if ($("say").value.trim() === "") return;
    send({ say: { text: $("say").value } });
    $("say").value = "";
  },
  unsay: () => send({ say: { text: "" } }),
  "take-back": () => send("take_back"),
  give: button => {
    const seconds = Math.round(Number($("minutes").value) * 60);
    const isGood = seconds >= 1 && seconds <= 3600;
    notice(isGood ? "" : text("bad_time"));
    if (isGood) send({ give: { pupil: Number(button.dataset.pupil), seconds } });
  },
  "close-notice": () => notice(""),
  language: () => {
    language = 1 - language;
    stored(() => localStorage.setItem("language", ["en", "zh-CN"][language]));
    translate();
  },
};

function translate() {
  document.documentElement.lang = ["en", "zh-CN"][language];
  document.title = text("title");
  document.querySelectorAll("[data-text]").forEach(element => setText(element, text(element.dataset.text)));
  document.querySelectorAll("[data-label]").forEach(element => element.setAttribute("aria-label", text(element.dataset.label)));
  show();
}

document.addEventListener("click", event => {
  const button = event.target.closest("[data-action]");
  if (button) ACTIONS[button.dataset.action](button);
});
document.addEventListener("keydown", event => {
  if (event.key === " " && event.target.id !== "say") {
    // The space bar stops everywhere, except in the field for a message. On a button it must not press the button, too.
    event.preventDefault();
    if (!event.repeat) ACTIONS.stop();
  }
  // An Enter that confirms Chinese input in an input method must not send the text.
  if (event.key === "Enter" && event.target.id === "say" && !event.isComposing) ACTIONS.say();
});
// Some browsers click a button when the space bar is released.
document.addEventListener("keyup", event => event.key === " " && event.target.id !== "say" && event.preventDefault());

translate();
const secret = takeSecret();
setText($("state"), text(secret ? "connecting" : "bad-address"));
if (secret) connect(secret);
// For tests and the console of the browser: how often the class was drawn, and the number of the last stop for all.
window.sevenbot = { frame_count: () => drawn, stop_number: () => shown?.stop?.number ?? 0 };
