// Keyboard shortcuts. The native window has the same (src/sink/hot_keys.rs).

/** [keys as `KeyboardEvent.key`, what is shown, what it does, action's name]. */
export const SHORTCUTS = [
  [[" "], "Space", "freeze, unfreeze", "freeze"],
  [["ArrowUp"], "↑", "more gain", "gain_up"],
  [["ArrowDown"], "↓", "less gain", "gain_down"],
  [["ArrowRight"], "→", "more dynamic range", "dynamic_range_up"],
  [["ArrowLeft"], "←", "less dynamic range", "dynamic_range_down"],
  [["PageDown"], "Page ↓", "deeper", "depth_up"],
  [["PageUp"], "Page ↑", "shallower", "depth_down"],
  [["End"], "End", "focus deeper", "focus_up"],
  [["Home"], "Home", "focus nearer", "focus_down"],
  [["t", "T"], "T", "TGC sliders to 0", "tgc_reset"],
  [["1"], "1", "low quality, 1×1", "quality_low"],
  [["2"], "2", "4×3", "quality_middle"],
  [["3"], "3", "high quality, 32×3", "quality_high"],
  [["e", "E"], "E", "generator on, off", "enhance"],
  [["s", "S"], "S", "tissues", "segmentation"],
  [["a", "A"], "A", "attenuation", "attenuation"],
  [["c", "C"], "C", "measure between two clicks", "caliper"],
  [["Delete", "Backspace"], "Del", "remove measurements", "caliper_clear"],
  [["v", "V"], "V", "3-D view of the scene", "scene"],
  [["p", "P"], "P", "save as PNG", "save"],
  [["f", "F"], "F", "full screen", "full_screen"],
  [["?", "h", "H"], "?", "this list", "help"],
];

/** Calls `actions[name]()` for a key, unless it belongs to what has the focus. */
export function listen(actions) {
  document.addEventListener("keydown", (event) => {
    if (event.ctrlKey || event.metaKey || event.altKey) return;
    const dialogOpen = document.querySelector("dialog[open]") !== null;
    const shortcut = SHORTCUTS.find(([keys]) => keys.includes(event.key));
    if (!shortcut || (dialogOpen && shortcut[3] !== "help")) return;
    const focused = document.activeElement;
    const arrows = event.key.startsWith("Arrow") || ["Home", "End", "PageUp", "PageDown"].includes(event.key);
    if (focused?.matches("input[type=range]") && arrows) return;
    if (focused?.matches("button, input[type=checkbox]") && event.key === " ") return;
    event.preventDefault();
    actions[shortcut[3]]();
  });
}

/** Fills the table of the help. */
export function fillHelp(body) {
  for (const [, shown, meaning] of SHORTCUTS) {
    const row = body.insertRow();
    const key = document.createElement("kbd");
    key.textContent = shown;
    row.insertCell().append(key);
    row.insertCell().textContent = meaning;
  }
}
