// The editor of block programs: Blockly with the blocks of the arm. It has no connection to the arm: the page reads the text of
// the program and lights its blocks. `cargo xtask web` puts Blockly, its texts and the table of blocks in front of this file.

var blockEditor = (() => {
  "use strict";
  const MOST_BYTES = 200_000;
  const EMPTY = { blocks: { blocks: [{ type: "arm_start", deletable: false, x: 20, y: 20 }] } };
  let workspace = null;
  let shown = null;

  // The colours of the editor on a dark page, as in style.css. The blocks have the same colours on a light page.
  const prefersDark = matchMedia("(prefers-color-scheme: dark)");
  const dark = Blockly.Theme.defineTheme("arm-dark", {
    base: Blockly.Themes.Classic,
    componentStyles: {
      workspaceBackgroundColour: "#1b212a", toolboxBackgroundColour: "#12161c", toolboxForegroundColour: "#e6ebf2",
      flyoutBackgroundColour: "#262e39", flyoutForegroundColour: "#e6ebf2", flyoutOpacity: 1, scrollbarColour: "#a9b4c3",
      insertionMarkerColour: "#ffffff", insertionMarkerOpacity: 0.4, cursorColour: "#4cc3d9",
    },
  });
  const theme = () => (prefersDark.matches ? dark : Blockly.Themes.Classic);
  prefersDark.addEventListener("change", () => {
    workspace?.setTheme(theme());
    adoptStyles();
  });

  // At this brightness, white text has a contrast of at least 4.5 to 1 on every block (WCAG 2, AA).
  Blockly.utils.colour.setHsvValue(0.5);
  Blockly.dialog.setPrompt(ask);
  // Discard Blockly's alerts: the page shows its own messages.
  Blockly.dialog.setAlert((_, done) => done?.());

  // Blockly's styles are in `template` elements, because the content security policy forbids inline `style` elements. Adopt
  // them as style sheets.
  function adoptStyles() {
    for (const text of document.querySelectorAll("template#blockly-common-style, template.blockly-renderer-style")) {
      if (text.dataset.adopted) continue;
      text.dataset.adopted = "yes";
      const sheet = new CSSStyleSheet();
      sheet.replaceSync(text.textContent);
      document.adoptedStyleSheets.push(sheet);
    }
  }

  // Asks for a name. `prompt()` would block the page, and with it the program that moves the arm.
  function ask(message, suggested, done) {
    const dialog = document.getElementById("ask");
    const field = dialog.querySelector("input");
    dialog.querySelector("label span").textContent = message;
    field.value = suggested;
    dialog.returnValue = "";
    dialog.addEventListener("close", () => done(dialog.returnValue == "yes" ? field.value : null), { once: true });
    dialog.onclick = (event) => event.target.dataset.answer && dialog.close(event.target.dataset.answer);
    field.onkeydown = (event) => event.key == "Enter" && dialog.close("yes");
    dialog.showModal();
    field.select();
  }

  // Shows the editor in an element, in this language. The present program stays. Calls `changed` after each edit.
  function open(element, language, changed) {
    const program = workspace ? text() : null;
    workspace?.dispose();
    Blockly.setLocale(blocklyTexts[language]);
    for (const [name, texts] of Object.entries(blockTable.texts)) Blockly.Msg[name] = texts[language];
    const isNarrow = element.clientWidth < 560;
    workspace = Blockly.inject(element, {
      toolbox: blockTable.toolbox, media: "media/", sounds: false, trashcan: false, comments: false, horizontalLayout: isNarrow,
      renderer: "zelos", theme: theme(), zoom: { startScale: isNarrow ? 0.6 : 0.7, wheel: false, pinch: true },
      move: { scrollbars: true, drag: true, wheel: true },
    });
    adoptStyles();
    workspace.addChangeListener(Blockly.Events.disableOrphans);
    workspace.addChangeListener((event) => {
      if (!event.isUiEvent && !workspace.isDragging()) changed();
    });
    shown ??= new ResizeObserver(() => workspace && Blockly.svgResize(workspace));
    shown.observe(element);
    load(program ?? JSON.stringify(EMPTY), false);
  }

  function text() {
    return JSON.stringify(Blockly.serialization.workspaces.save(workspace));
  }

  // Replaces the program, and returns an empty text. If the new text is no program, keeps the old program and returns the error.
  // With `canUndo`, the user can undo the replacement.
  function load(program, canUndo) {
    const before = Blockly.serialization.workspaces.save(workspace);
    try {
      Blockly.serialization.workspaces.load(JSON.parse(program), workspace, { recordUndo: canUndo });
      return "";
    } catch (error) {
      Blockly.serialization.workspaces.load(before, workspace);
      return String(error.message ?? error);
    }
  }

  // Lights the block with this id, and no other. An empty id lights no block.
  function light(id) {
    workspace.highlightBlock(id || null);
  }

  // Shows a warning at this block, and removes all others. Without an id or a text, only removes them.
  function warn(id, message) {
    for (const block of workspace.getAllBlocks(false)) block.setWarningText(null);
    const block = id && workspace.getBlockById(id);
    if (!block || !message) return;
    block.setWarningText(message);
    workspace.centerOnBlock(id);
  }

  // Adds a block for a pose, with angles in degrees, below the last block of the program.
  function addPose(angles) {
    let last = workspace.getBlocksByType("arm_start", false)[0];
    while (last?.getNextBlock()) last = last.getNextBlock();
    const fields = Object.fromEntries(angles.map((angle, index) => [`J${index + 1}`, angle]));
    Blockly.Events.setGroup(true);
    const pose = Blockly.serialization.blocks.append({ type: "arm_pose", fields }, workspace, { recordUndo: true });
    last?.nextConnection?.connect(pose.previousConnection);
    Blockly.Events.setGroup(false);
  }

  async function piped(bytes, stream) {
    const reader = new Blob([bytes]).stream().pipeThrough(stream).getReader();
    const parts = [];
    let size = 0;
    for (let part; !(part = await reader.read()).done && size <= MOST_BYTES; size += part.value.length) parts.push(part.value);
    return new Uint8Array(await new Blob(parts).arrayBuffer());
  }

  // Compresses a program, and encodes it as base64url for an address.
  async function pack(program) {
    const bytes = await piped(program, new CompressionStream("deflate-raw"));
    return btoa(String.fromCharCode(...bytes)).replaceAll("+", "-").replaceAll("/", "_").replaceAll("=", "");
  }

  // Decodes the result of `pack`. Returns an empty text if the letters are not base64url or the bytes cannot be decompressed.
  async function unpack(letters) {
    try {
      const bytes = Uint8Array.from(atob(letters.replaceAll("-", "+").replaceAll("_", "/")), (letter) => letter.charCodeAt(0));
      return new TextDecoder().decode(await piped(bytes, new DecompressionStream("deflate-raw")));
    } catch {
      return "";
    }
  }

  function copy(text) {
    navigator.clipboard?.writeText(text).catch(() => {});
  }

  return { copy, open, text, load, light, warn, addPose, pack, unpack };
})();
