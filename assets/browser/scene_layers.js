// Layers and tissues of the 3-D view: which surfaces are visible, and how opaque they are.

import { letGo, letGoAfterPointer } from "./accessibility.js";
import { show } from "./controls.js";

const byId = (id) => document.getElementById(id);
const named = (name) => name.replaceAll("_", " ");

/** A check box with a text, and a swatch if there is a colour. */
function switchOf(text, isChecked, colour, changed) {
  const label = document.createElement("label");
  const box = Object.assign(document.createElement("input"), { type: "checkbox", checked: isChecked });
  box.addEventListener("change", () => {
    letGo(box);
    changed(box.checked);
  });
  label.append(box);
  if (colour) {
    const swatch = document.createElement("i");
    swatch.style.background = `rgb(${colour.join(" ")})`;
    label.append(swatch);
  }
  label.append(text);
  return { label, box };
}

export class SceneLayers {
  /** `changed()` is called after each change of visibility. */
  constructor(changed) {
    this.changed = changed;
    this.layers = [];
    this.hidden = new Set();
    /** { tissue, layers, label, box }: tissues with the layers of their surfaces. */
    this.tissues = [];
    for (const summary of byId("scene_lists").querySelectorAll("summary")) {
      summary.addEventListener("click", () => letGo(summary));
    }
  }

  /** Builds the lists for a scene of `layers` and `bodies` (its surfaces without the probe). */
  load(layers, bodies) {
    this.layers = layers.map(({ name, opacity, is_shown }) => ({ name, opacity, isShown: is_shown }));
    this.hidden.clear();
    byId("scene_layer_list").replaceChildren(...this.layers.map((layer) => this.layerRow(layer)));
    const tissues = [...new Set(bodies.map(({ tissue }) => tissue))].sort();
    this.tissues = tissues.map((tissue) => {
      const own = bodies.filter((surface) => surface.tissue === tissue);
      const entry = { tissue, layers: [...new Set(own.map(({ layer }) => this.layers[layer]))] };
      const made = switchOf(named(tissue), true, own[0].colour, (isShown) => this.showTissue(entry, isShown));
      made.box.dataset.tissue = tissue;
      return Object.assign(entry, made);
    });
    byId("scene_tissues").replaceChildren(...this.tissues.map(({ label }) => label));
    this.showBoxes();
  }

  /** Shows or hides a tissue. If its layers are hidden, they are shown with it. */
  showTissue({ tissue, layers }, isShown) {
    if (isShown) {
      this.hidden.delete(tissue);
      if (!layers.some((layer) => layer.isShown)) layers.forEach((layer) => Object.assign(layer, { isShown: true }));
    } else {
      this.hidden.add(tissue);
    }
    this.showBoxes();
    this.changed();
  }

  /** Checks the boxes of everything that is visible. */
  showBoxes() {
    for (const { isShown, box } of this.layers) box.checked = isShown;
    for (const { tissue, layers, box } of this.tissues) {
      box.checked = !this.hidden.has(tissue) && layers.some((layer) => layer.isShown);
    }
  }

  layerRow(layer) {
    const row = document.createElement("div");
    const { label, box } = switchOf(named(layer.name), layer.isShown, null, (isShown) => {
      layer.isShown = isShown;
      this.showBoxes();
      this.changed();
    });
    box.dataset.layer = layer.name;
    layer.box = box;
    const slider = Object.assign(document.createElement("input"), { type: "range", min: 0, max: 100, step: 1 });
    slider.value = Math.round(100 * layer.opacity);
    slider.dataset.unit = "%";
    slider.dataset.layer = layer.name;
    slider.setAttribute("aria-label", `Opacity of ${named(layer.name)}`);
    const value = Object.assign(document.createElement("span"), { className: "value", ariaHidden: "true" });
    row.append(label, slider, value);
    slider.addEventListener("input", () => {
      layer.opacity = Number(slider.value) / 100;
      layer.isShown = true;
      show(slider, Number(slider.value));
      this.showBoxes();
      this.changed();
    });
    letGoAfterPointer(slider);
    show(slider, Number(slider.value));
    return row;
  }

  /** Opacity of a surface, 0..1; 0 if it is hidden. */
  opacity({ layer, part, tissue }) {
    const entry = this.layers[layer];
    // The probe is in no layer.
    if (!entry) return part;
    return entry.isShown && !this.hidden.has(tissue) ? entry.opacity * part : 0;
  }
}
