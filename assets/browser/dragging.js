// Dragging of points and texts on the picture.

import { drag } from "./calipers.js";
import { toMm } from "./marking.js";

/** Distance within which a mark is grabbed, and movement from which on it is dragged, CSS pixels. */
const GRAB_PX = 14;
const DRAG_PX = 3;

export class Dragging {
  /** `tools`: { stage, page, calipers, annotations, rect(), pointAt(event), changed(mark) }. */
  constructor(tools) {
    this.tools = tools;
    /** The grabbed mark: { mark, before, move(at), from, moved }; null without one. */
    this.held = null;
    const { stage } = tools;
    stage.addEventListener("pointerdown", (event) => this.grab(event));
    stage.addEventListener("pointermove", (event) => this.move(event));
    stage.addEventListener("pointerup", () => this.release(true));
    stage.addEventListener("pointercancel", () => this.release(false));
  }

  /** The mark under a pointer; null without one. */
  under(event) {
    const { page, calipers, annotations } = this.tools;
    const frame = page.shown();
    if (!frame || calipers.pending || event.target.closest("#cine, #note")) return null;
    const [at, reach] = [this.tools.pointAt(event), GRAB_PX / this.tools.rect().scale];
    const near = calipers.near(at, frame, reach);
    if (near) {
      const { caliper, index } = near;
      return { mark: caliper, before: [...caliper.points], move: (to) => drag(caliper, index, toMm(frame, to)) };
    }
    const text = annotations.near(at, frame, reach);
    return text && { mark: text, before: text.at, move: (to) => Object.assign(text, { at: toMm(frame, to) }) };
  }

  grab(event) {
    this.held = null;
    const found = event.button === 0 ? this.under(event) : null;
    if (!found) return;
    this.held = { ...found, from: { x: event.clientX, y: event.clientY }, moved: false };
    this.tools.stage.setPointerCapture(event.pointerId);
  }

  move(event) {
    const { stage, page } = this.tools;
    const { held } = this;
    if (held && event.buttons & 1) {
      held.moved ||= Math.hypot(event.clientX - held.from.x, event.clientY - held.from.y) > DRAG_PX;
      if (!held.moved) return;
      held.move(this.tools.pointAt(event));
      page.redraw();
    } else {
      stage.classList.toggle("grabbing", Boolean(this.under(event)));
    }
  }

  /** Releases the mark. Without `keep` it returns to its earlier position. */
  release(keep) {
    const { held } = this;
    if (!held) return;
    // Without movement it is a click.
    if (!held.moved || !keep) this.held = null;
    if (!held.moved) return;
    if (keep) this.tools.changed(held.mark);
    else Object.assign(held.mark, held.mark.tool ? { points: held.before } : { at: held.before });
    this.tools.page.redraw();
  }

  /** Whether a click is the end of a drag. True once per drag. */
  tookClick() {
    const ended = this.held !== null;
    this.held = null;
    return ended;
  }
}
