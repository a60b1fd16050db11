// Sliders, switches and buttons. They show the settings of the newest frame, unless the user is moving them.

import { letGo, letGoAfterPointer, spoken } from "./accessibility.js";

const byId = (id) => document.getElementById(id);
/** Time for which a control keeps the value that the user set, ms. Frames rendered earlier still have the old value. */
const HOLD_MS = 900;
/** Shortest time between two messages of a control, ms. */
const SEND_PERIOD_MS = 40;

export class Controls {
  constructor(send) {
    this.send = send;
    this.values = null;
    /** Live settings and qualities, as the station's first message lists them. */
    this.settings = [];
    this.qualities = [];
    this.heldUntil = new Map();
    this.sendTimers = new Map();
    this.waiting = new Map();
    byId("tgc_reset").addEventListener("click", () => this.resetTgc());
    byId("freeze").addEventListener("click", (e) => this.fromButton(e, () => this.toggle("frozen")));
    byId("generator").addEventListener("change", () => this.toggle("generator"));
    byId("harmonics").addEventListener("change", () => this.toggle("harmonics"));
    // A switch with the focus would take the space bar, which freezes the picture.
    for (const id of ["generator", "harmonics"]) byId(id).addEventListener("change", (event) => letGo(event.currentTarget));
  }

  /** Builds sliders and buttons from the station's first message. */
  build({ settings, qualities, looks, exams, keys }) {
    Object.assign(this, { settings, qualities, presets: [...looks, ...exams], keys, values: null });
    this.heldUntil.clear();
    const withSlider = settings.filter(({ slider }) => slider);
    for (const { slider } of withSlider) byId(slider.section).replaceChildren();
    for (const setting of withSlider) {
      for (let index = 0; index < setting.count; index++) byId(setting.slider.section).append(this.row(setting, index));
    }
    byId("quality").replaceChildren(...qualities.map((point) => this.qualityButton(point)));
    byId("looks").replaceChildren(...looks.map((preset) => this.presetButton(preset)));
    byId("exams").replaceChildren(...exams.map((preset) => this.presetButton(preset)));
  }

  /** Names of the keys that step a setting. */
  hint(key) {
    return this.keys.filter(({ action }) => action.step?.setting === key).map(({ shown }) => shown).join(" ");
  }

  presetButton({ name, label, key }) {
    const button = document.createElement("button");
    button.append(label);
    if (key) {
      const hint = document.createElement("kbd");
      hint.textContent = key.toUpperCase();
      hint.ariaHidden = "true";
      button.append(" ", hint);
    }
    button.dataset.preset = name;
    button.addEventListener("click", (e) => this.fromButton(e, () => this.preset(name)));
    return button;
  }

  /** Sets all values of a preset together. */
  preset(name) {
    const preset = this.presets.find((preset) => preset.name === name);
    if (!preset) return;
    for (const { key, index, value } of preset.values) {
      const setting = this.setting(key);
      const id = idOf(setting, index ?? 0);
      this.hold(setting.slider ? id : key);
      if (setting.slider) {
        byId(id).value = value;
        show(byId(id), value);
      } else if (this.values) this.values[key] = value;
    }
    this.assign(preset.values);
    if (this.values) this.showButtons();
  }

  /** A slider with its name and value. A setting with several values has one numbered slider for each, with its depth next to it. */
  row(setting, index) {
    const { key, count, slider, label, unit, scale, digits, words } = setting;
    const input = document.createElement("input");
    const [min, max, step] = [slider.min, slider.max, slider.step];
    Object.assign(input, { type: "range", min, max, step, value: 0, id: idOf(setting, index) });
    // Sliders of such a setting have no room for the unit, so it is only spoken.
    Object.assign(input.dataset, count > 1 ? { spokenUnit: unit } : { unit, scale, digits, words: words.join(" ") });
    input.setAttribute("aria-label", count > 1 ? `${label} ${index + 1} of ${count}` : label);
    input.addEventListener("input", () => this.moved(setting, index, Number(input.value)));
    letGoAfterPointer(input);
    const row = document.createElement("label");
    const value = Object.assign(document.createElement("span"), { className: "value", ariaHidden: "true" });
    if (count > 1) {
      input.addEventListener("dblclick", () => this.set(setting, index, 0));
      row.append(Object.assign(document.createElement("span"), { className: "depth" }), input, value);
    } else {
      row.className = "slider";
      const name = document.createElement("span");
      name.append(`${label} `);
      const hint = this.hint(key);
      if (hint) name.append(Object.assign(document.createElement("kbd"), { textContent: hint }));
      row.append(name, value, this.stepButton(setting, -1), input, this.stepButton(setting, 1));
    }
    return row;
  }

  /** A button that steps a slider, for touch screens. */
  stepButton(setting, sign) {
    const button = document.createElement("button");
    Object.assign(button, { className: "step", type: "button", textContent: sign < 0 ? "−" : "+" });
    button.setAttribute("aria-label", `${setting.label} ${sign < 0 ? "less" : "more"}`);
    const by = Math.abs(this.keys.find(({ action }) => action.step?.setting === setting.key)?.action.step.by ?? setting.slider.step);
    button.addEventListener("click", (e) => this.fromButton(e, () => this.step(setting.key, sign * by)));
    return button;
  }

  qualityButton({ label, key, rays, layers }) {
    const button = document.createElement("button");
    const points = document.createElement("small");
    points.textContent = `${rays}×${layers}`;
    button.append(`${label} `, points);
    button.title = `${rays} rays × ${layers} layers (${key})`;
    Object.assign(button.dataset, { rays, layers });
    button.addEventListener("click", (e) => this.fromButton(e, () => this.quality(rays, layers)));
    return button;
  }

  setting(key) {
    return this.settings.find((setting) => setting.key === key);
  }

  /** Runs the action of a button. Afterwards the button must not take the space bar from someone who uses a pointer. */
  fromButton(event, action) {
    action();
    letGo(event.currentTarget);
  }

  hold(name) {
    this.heldUntil.set(name, performance.now() + HOLD_MS);
  }

  isHeld(name) {
    return (this.heldUntil.get(name) ?? 0) > performance.now();
  }

  assign(assignments) {
    this.send({ type: "set", assignments });
  }

  moved(setting, index, value) {
    const id = idOf(setting, index);
    this.hold(id);
    show(byId(id), value);
    this.waiting.set(id, { key: setting.key, index, value });
    if (this.sendTimers.has(id)) return;
    this.flush(id);
    this.sendTimers.set(id, setInterval(() => this.flush(id), SEND_PERIOD_MS));
  }

  flush(id) {
    if (!this.waiting.has(id)) {
      clearInterval(this.sendTimers.get(id));
      this.sendTimers.delete(id);
      return;
    }
    this.assign([this.waiting.get(id)]);
    this.waiting.delete(id);
  }

  /** Sets a slider, within its range. */
  set(setting, index, value) {
    const input = byId(idOf(setting, index));
    const clamped = Math.min(Math.max(value, Number(input.min)), Number(input.max));
    input.value = clamped;
    this.moved(setting, index, clamped);
  }

  /** Steps a setting by a key, or toggles a switch. */
  step(key, by) {
    const setting = this.setting(key);
    if (setting.slider) this.set(setting, 0, Number(byId(key).value) + by);
    else this.toggle(key);
  }

  resetTgc() {
    const setting = this.setting("tgc_sliders_db");
    for (let index = 0; index < setting.count; index++) this.set(setting, index, 0);
  }

  toggle(key) {
    if (!this.values) return;
    this.setAll({ [key]: this.values[key] ? 0 : 1 });
  }

  /** Freezes the picture. A frozen picture stays frozen. */
  freeze() {
    if (this.values) this.setAll({ frozen: 1 });
  }

  quality(rays, layers) {
    if (this.values) this.setAll({ rays, layers });
  }

  /** Sets values of settings without a slider, all together. */
  setAll(values) {
    Object.assign(this.values, values);
    for (const key of Object.keys(values)) this.hold(key);
    this.assign(Object.entries(values).map(([key, value]) => ({ key, value })));
    this.showButtons();
  }

  /** Updates the controls to the settings with which a frame was made. */
  follow(values) {
    const before = this.values ?? values;
    this.values = { ...values };
    for (const setting of this.settings) {
      const { key, slider } = setting;
      const list = [values[key]].flat();
      if (slider) list.forEach((value, index) => this.followSlider(idOf(setting, index), value));
      else if (this.isHeld(key)) this.values[key] = before[key];
      if (slider && list.length > 1) this.showDepths(setting);
    }
    this.showButtons();
  }

  /** Writes the depths of sliders that are spread over the image next to them. */
  showDepths(setting) {
    for (let index = 0; index < setting.count; index++) {
      const input = byId(idOf(setting, index));
      const text = ((this.values.depth_mm / 10 / (setting.count - 1)) * index).toFixed(1);
      if (input.dataset.depthCm === text) continue;
      input.dataset.depthCm = input.previousElementSibling.textContent = text;
      show(input, Number(input.value));
    }
  }

  /** Texts under the picture, for the settings that have one. */
  captions(values) {
    const named = this.settings.filter(({ caption }) => caption);
    const texts = named.map((setting) => `${setting.caption} ${shownText(values[setting.key], setting)}`);
    return [...texts, `${values.rays}×${values.layers}`];
  }

  followSlider(id, value) {
    if (this.isHeld(id)) return;
    const input = byId(id);
    // A station file may set a value outside the slider's range.
    if (value < Number(input.min)) input.min = value;
    if (value > Number(input.max)) input.max = value;
    if (Number(input.value) !== value) input.value = value;
    show(input, value);
  }

  showButtons() {
    const { frozen, generator, rays, layers } = this.values;
    byId("freeze").setAttribute("aria-pressed", String(Boolean(frozen)));
    byId("freeze").firstChild.textContent = frozen ? "Unfreeze " : "Freeze ";
    byId("generator").checked = Boolean(generator);
    byId("harmonics").checked = Boolean(this.values.harmonics);
    const as = ({ key, index, value }) => Math.abs([this.values[key]].flat()[index ?? 0] - value) < 1e-6;
    for (const { name, values } of this.presets) {
      const button = document.querySelector(`[data-preset="${name}"]`);
      button?.setAttribute("aria-pressed", String(values.every(as)));
    }
    for (const button of byId("quality").children) {
      const chosen = Number(button.dataset.rays) === rays && Number(button.dataset.layers) === layers;
      button.setAttribute("aria-pressed", String(chosen));
    }
  }
}

/** The `id` of a slider: the setting's key, and the index of its value if there are several. */
const idOf = ({ key, count }, index) => (count > 1 ? `${key}_${index}` : key);

/** A value as text, with its unit. */
const shownText = (value, { unit, scale, digits, words }) => words[value] ?? `${(value * scale).toFixed(digits)} ${unit}`;

/** Writes a slider's value next to it, and as words for screen readers. */
export function show(input, value) {
  const { unit = "", spokenUnit = unit, scale = "1", digits = "0", words = "", depthCm } = input.dataset;
  const output = input.parentElement.querySelector(".value");
  const number = (value * Number(scale)).toFixed(Number(digits));
  const word = words.split(" ")[value];
  const text = word ? word : unit ? `${number} ${unit}` : value > 0 ? `+${number}` : number;
  if (output.textContent !== text) output.textContent = text;
  const said = word ? word.replaceAll("_", " ") : spoken(number, spokenUnit);
  const valueText = depthCm ? `${said} at ${spoken(depthCm, "cm")}` : said;
  if (input.getAttribute("aria-valuetext") !== valueText) input.setAttribute("aria-valuetext", valueText);
  const filled = (Number(input.value) - Number(input.min)) / (Number(input.max) - Number(input.min));
  input.style.setProperty("--filled", `${(100 * filled).toFixed(1)}%`);
}
