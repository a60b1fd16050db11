// Keyboard shortcuts, as the station's first message names them.

/**
 * Calls `run(action)` for a key of `shortcuts()`, unless it belongs to what has the focus. `first(key)` may take a key
 * before.
 */
export function listen(shortcuts, run, first) {
  document.addEventListener("keydown", (event) => {
    if (event.ctrlKey || event.metaKey || event.altKey) return;
    const dialogOpen = document.querySelector("dialog[open]") !== null;
    if (document.activeElement?.matches("input[type=text]")) return;
    if (!dialogOpen && !document.activeElement?.matches("input[type=range]") && first(event.key, event.shiftKey)) {
      event.preventDefault();
      return;
    }
    const shortcut = shortcuts().find(({ keys }) => keys.some((key) => key.toLowerCase() === event.key.toLowerCase()));
    if (!shortcut || (dialogOpen && shortcut.action !== "help")) return;
    const focused = document.activeElement;
    const arrows = event.key.startsWith("Arrow") || ["Home", "End", "PageUp", "PageDown"].includes(event.key);
    if (focused?.matches("input[type=range]") && arrows) return;
    if (focused?.matches("button, input[type=checkbox]") && event.key === " ") return;
    event.preventDefault();
    run(shortcut.action);
  });
}

/** Fills the table of the help. */
export function fillHelp(body, shortcuts) {
  body.replaceChildren();
  for (const { shown, meaning } of shortcuts) {
    const row = body.insertRow();
    const key = document.createElement("kbd");
    key.textContent = shown;
    row.insertCell().append(key);
    row.insertCell().textContent = times(meaning);
  }
}

/** Rays and layers with a multiplication sign. */
export const times = (text) => text.replace(/(\d)x(\d)/g, "$1×$2");
