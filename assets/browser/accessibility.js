// Accessibility for keyboards and screen readers: focus, spoken values, and the live region.

/** Units as words, singular and plural. */
const UNITS = {
  dB: ["decibel", "decibels"],
  "dB/cm": ["decibel per centimetre", "decibels per centimetre"],
  mm: ["millimetre", "millimetres"],
  cm: ["centimetre", "centimetres"],
  MHz: ["megahertz", "megahertz"],
  s: ["second", "seconds"],
  deg: ["degree", "degrees"],
  angles: ["angle", "angles"],
  "%": ["percent", "percent"],
};
/** Shortest time between two announcements, ms: a screen reader finishes one first. */
const PAUSE_MS = 1200;
/** Largest number of messages in an announcement; older ones are dropped. */
const MESSAGES_MAX = 3;

/** A number with its unit, as it is spoken. */
export function spoken(number, unit) {
  const [one, several] = UNITS[unit] ?? [unit, unit];
  const text = String(number).replace("−", "-");
  const words = text.startsWith("-") ? `minus ${text.slice(1)}` : text;
  return `${words} ${Number(text) === 1 ? one : several}`.trim();
}

/**
 * Gives the keyboard back to the page after a pointer has used a control. A control that was reached by keyboard keeps the focus:
 * browsers show the focus only there (`:focus-visible`).
 */
export function letGo(element) {
  if (!element.matches(":focus-visible")) element.blur();
}

/** Gives the keyboard back after a pointer has used a slider, whether it was moved or not. */
export function letGoAfterPointer(slider) {
  for (const type of ["change", "click"]) slider.addEventListener(type, () => letGo(slider));
}

/** The page's live region, which screen readers announce. */
export class Announcer {
  constructor(element) {
    this.element = element;
    this.waiting = [];
    this.timer = 0;
  }

  say(text) {
    if (!text || this.waiting.at(-1) === text) return;
    this.waiting = [...this.waiting, text].slice(-MESSAGES_MAX);
    if (!this.timer) this.next();
  }

  next() {
    this.timer = 0;
    if (this.waiting.length === 0) return;
    this.element.textContent = this.waiting.join(". ");
    this.waiting = [];
    this.timer = setTimeout(() => this.next(), PAUSE_MS);
  }
}
