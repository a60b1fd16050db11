// Sliders, switches and buttons: they show the settings of the newest frame, unless a hand is on them.

const byId = (id) => document.getElementById(id);
/** A control that was moved keeps its own value for so long: frames made before lag behind. */
const HOLD_MS = 900;
/** At most one message a control in so long. */
const SEND_PERIOD_MS = 40;

const SLIDERS = ["gain_db", "dynamic_range_db", "depth_mm", "focus_mm", "tgc_db_per_cm"];
export const TGC_SLIDERS = 8;

export class Controls {
  constructor(send) {
    this.send = send;
    this.settings = null;
    this.heldUntil = new Map();
    this.sendTimers = new Map();
    this.waiting = new Map();
    this.buildTgc();
    for (const name of SLIDERS) {
      const input = byId(name);
      input.addEventListener("input", () => this.moved(name, Number(input.value)));
      input.addEventListener("change", () => input.blur());
    }
    byId("tgc_reset").addEventListener("click", () => this.resetTgc());
    byId("freeze").addEventListener("click", (e) => this.fromButton(e, () => this.toggle("freeze", "frozen")));
    byId("enhance").addEventListener("change", (e) => {
      this.hold("enhance");
      this.send({ type: "enhance", on: e.target.checked });
    });
    for (const button of byId("quality").children) {
      const { rays, layers } = button.dataset;
      button.addEventListener("click", (e) => this.fromButton(e, () => this.quality(Number(rays), Number(layers))));
    }
  }

  /** Runs an action of a button, which must not take the space bar afterwards. */
  fromButton(event, action) {
    action();
    event.currentTarget.blur();
  }

  buildTgc() {
    for (let index = 0; index < TGC_SLIDERS; index++) {
      const input = document.createElement("input");
      Object.assign(input, { type: "range", min: -24, max: 24, step: 1, value: 0, id: `tgc_${index}` });
      input.setAttribute("aria-label", `TGC slider ${index + 1} of ${TGC_SLIDERS}`);
      input.addEventListener("input", () => this.moved(input.id, Number(input.value)));
      input.addEventListener("change", () => input.blur());
      input.addEventListener("dblclick", () => this.set(input.id, 0));
      const row = document.createElement("label");
      const depth = document.createElement("span");
      row.append(depth, input, document.createElement("output"));
      byId("tgc_sliders").append(row);
    }
  }

  hold(name) {
    this.heldUntil.set(name, performance.now() + HOLD_MS);
  }

  isHeld(name) {
    return (this.heldUntil.get(name) ?? 0) > performance.now();
  }

  /** The message for a slider's value. */
  message(name, value) {
    const index = /^tgc_(\d)$/.exec(name)?.[1];
    return index === undefined ? { type: name, value } : { type: "tgc_slider", index: Number(index), db: value };
  }

  moved(name, value) {
    this.hold(name);
    show(byId(name), value);
    this.waiting.set(name, value);
    if (this.sendTimers.has(name)) return;
    this.flush(name);
    this.sendTimers.set(name, setInterval(() => this.flush(name), SEND_PERIOD_MS));
  }

  flush(name) {
    if (!this.waiting.has(name)) {
      clearInterval(this.sendTimers.get(name));
      this.sendTimers.delete(name);
      return;
    }
    this.send(this.message(name, this.waiting.get(name)));
    this.waiting.delete(name);
  }

  /** Sets a slider from a key, within its ends. */
  set(name, value) {
    const input = byId(name);
    const clamped = Math.min(Math.max(value, Number(input.min)), Number(input.max));
    input.value = clamped;
    this.moved(name, clamped);
  }

  step(name, by) {
    this.set(name, Number(byId(name).value) + by);
  }

  resetTgc() {
    for (let i = 0; i < TGC_SLIDERS; i++) this.set(`tgc_${i}`, 0);
  }

  toggle(type, setting) {
    if (!this.settings) return;
    const on = !this.settings[setting];
    this.settings[setting] = on;
    this.hold(type);
    this.send({ type, on });
    this.showToggles();
  }

  quality(rays, layers) {
    if (!this.settings) return;
    Object.assign(this.settings, { rays, layers });
    this.hold("quality");
    this.send({ type: "quality", rays, layers });
    this.showToggles();
  }

  /** Follows the settings that a frame was made with. */
  follow(settings) {
    const before = this.settings ?? settings;
    this.settings = { ...settings };
    if (this.isHeld("freeze")) this.settings.frozen = before.frozen;
    if (this.isHeld("enhance")) this.settings.enhance = before.enhance;
    if (this.isHeld("quality")) Object.assign(this.settings, { rays: before.rays, layers: before.layers });
    for (const name of SLIDERS) this.followSlider(name, settings[name]);
    settings.tgc_sliders_db.forEach((db, i) => {
      this.followSlider(`tgc_${i}`, db);
      const depthCm = (settings.depth_mm / 10 / (TGC_SLIDERS - 1)) * i;
      const label = byId(`tgc_${i}`).previousElementSibling;
      const text = depthCm.toFixed(1);
      if (label.textContent !== text) label.textContent = text;
    });
    this.showToggles();
  }

  followSlider(name, value) {
    if (this.isHeld(name)) return;
    const input = byId(name);
    // A station file may go beyond what the slider offers.
    if (value < Number(input.min)) input.min = value;
    if (value > Number(input.max)) input.max = value;
    if (Number(input.value) !== value) input.value = value;
    show(input, value);
  }

  showToggles() {
    const { frozen, enhance, rays, layers } = this.settings;
    byId("freeze").setAttribute("aria-pressed", String(frozen));
    byId("freeze").firstChild.textContent = frozen ? "Unfreeze " : "Freeze ";
    if (!this.isHeld("enhance")) byId("enhance").checked = enhance;
    for (const button of byId("quality").children) {
      const chosen = Number(button.dataset.rays) === rays && Number(button.dataset.layers) === layers;
      button.setAttribute("aria-pressed", String(chosen));
    }
  }
}

/** Writes a slider's value beside it. */
export function show(input, value) {
  const { unit = "", scale = "1", digits = "0" } = input.dataset;
  const output = input.parentElement.querySelector("output");
  const number = (value * Number(scale)).toFixed(Number(digits));
  const text = unit ? `${number} ${unit}` : value > 0 ? `+${number}` : number;
  if (output.textContent !== text) output.textContent = text;
  const filled = (Number(input.value) - Number(input.min)) / (Number(input.max) - Number(input.min));
  input.style.setProperty("--filled", `${(100 * filled).toFixed(1)}%`);
}
