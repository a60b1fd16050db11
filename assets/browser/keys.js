// Keyboard shortcuts, as the station's first message lists them.

const ARROWS = ["ArrowUp", "ArrowDown", "ArrowLeft", "ArrowRight", "Home", "End", "PageUp", "PageDown"];

/** Name of a pressed key in the station's list. */
export function nameOf({ key, code, shiftKey }) {
  // The digit row of a French or Czech keyboard gives digits with Shift only.
  const digit = /^Digit(\d)$/.exec(code ?? "");
  if (digit && !shiftKey) return digit[1];
  // On a Greek or Cyrillic keyboard: the Latin letter of the same key.
  const letter = /^Key([A-Z])$/.exec(code ?? "");
  if (letter && key.length === 1 && key > "\x7f") return letter[1].toLowerCase();
  return key.toLowerCase();
}

/** Whether the focused element itself uses the key. */
function isTaken(focused, key) {
  if (!focused) return false;
  if (focused.matches("input[type=text], textarea, select")) return true;
  if (focused.matches("input[type=range]")) return ARROWS.includes(key);
  return focused.matches("button, summary, a, input[type=checkbox]") && [" ", "Enter"].includes(key);
}

/**
 * Calls `run(action)` for a key of `shortcuts()`, unless the focused element uses it. `first(key, shift)` may use a
 * key before.
 */
export function listen(shortcuts, run, first) {
  document.addEventListener("keydown", (event) => {
    if (event.defaultPrevented || event.ctrlKey || event.metaKey || event.altKey) return;
    if (isTaken(document.activeElement, event.key)) return;
    const isDialogOpen = document.querySelector("dialog[open]") !== null;
    if (!isDialogOpen && first(event.key, event.shiftKey)) {
      event.preventDefault();
      return;
    }
    const name = nameOf(event);
    const shortcut = shortcuts().find(({ keys }) => keys.some((key) => key.toLowerCase() === name));
    if (!shortcut || (isDialogOpen && shortcut.action !== "help")) return;
    event.preventDefault();
    run(shortcut.action);
  });
}

/** Fills the help's table of keys. */
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

/** Rays × layers with a multiplication sign. */
export const times = (text) => text.replace(/(\d)x(\d)/g, "$1×$2");
