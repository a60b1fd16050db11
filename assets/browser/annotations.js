// Texts on the picture, and the body mark that shows where the probe is on the body.

import { label, toMm, toPixel } from "./marking.js";
import { toStage } from "./view.js";

const INK = "#f1f5f8";
/** Body marks by name. Each draws an outline into a square of side 2 about the origin. */
const BODY_MARKS = {
  none: null,
  abdomen: (context) => {
    context.moveTo(-0.75, -1);
    context.bezierCurveTo(-0.5, -0.4, -1.05, 0.2, -0.75, 1);
    context.moveTo(0.75, -1);
    context.bezierCurveTo(0.5, -0.4, 1.05, 0.2, 0.75, 1);
    context.moveTo(0.06, 0.2);
    context.arc(0, 0.2, 0.06, 0, 2 * Math.PI);
  },
  pregnant: (context) => {
    context.moveTo(-0.7, -1);
    context.bezierCurveTo(-0.6, -0.6, -1.1, 0, -0.7, 1);
    context.moveTo(0.7, -1);
    context.bezierCurveTo(0.6, -0.6, 1.1, 0, 0.7, 1);
    context.moveTo(0.55, 0.15);
    context.ellipse(0, 0.15, 0.55, 0.62, 0, 0, 2 * Math.PI);
  },
  chest: (context) => {
    context.moveTo(-0.35, -1);
    context.quadraticCurveTo(-1, -0.9, -0.95, -0.3);
    context.lineTo(-0.7, 1);
    context.moveTo(0.35, -1);
    context.quadraticCurveTo(1, -0.9, 0.95, -0.3);
    context.lineTo(0.7, 1);
    context.moveTo(0, -0.6);
    context.lineTo(0, 0.3);
  },
};

export class Annotations {
  constructor() {
    /** Texts on their pictures: { id, picture, at, text }; `at` is a point of the probe frame, mm. */
    this.texts = [];
    this.mark = "none";
    /** Rotation of the probe on the body mark, degrees. */
    this.turn = 0;
  }

  /** Puts a text at a pixel of a frame. Returns it; null if it has no character. */
  add(at, text, frame) {
    const written = text.trim().slice(0, 60);
    if (!written) return null;
    const added = { picture: frame.picture, at: toMm(frame, at), text: written };
    this.texts.push(added);
    return added;
  }

  /** Texts on the picture of `frame`. */
  on(frame) {
    return this.texts.filter(({ picture }) => picture.key === frame.picture.key);
  }

  /** The text that begins at a pixel of a frame, or null. `reach` is the size of a mark in pixels. */
  near(at, frame, reach) {
    const isAt = (text) => {
      const { x, y } = toPixel(frame, text.at);
      return at.x >= x - reach && at.x <= x + 3 * reach && Math.abs(at.y - y) <= reach;
    };
    return this.on(frame).find(isAt) ?? null;
  }

  /** Switches to the next body mark. */
  nextMark() {
    const names = Object.keys(BODY_MARKS);
    this.mark = names[(names.indexOf(this.mark) + 1) % names.length];
  }

  turnMark(degrees) {
    this.turn = (this.turn + degrees + 360) % 360;
  }

  draw(context, frame, rect, font) {
    for (const { at, text } of this.on(frame)) {
      const point = toStage(rect, toPixel(frame, at));
      context.fillStyle = INK;
      label(context, text, point.x, point.y, rect.marks, font);
    }
    const outline = BODY_MARKS[this.mark];
    if (!outline) return;
    const side = 34 * rect.marks;
    context.save();
    context.translate(rect.x + side * 1.2, rect.y + rect.height - side * 1.4);
    context.scale(side, side);
    context.strokeStyle = INK;
    context.lineWidth = 0.045;
    context.beginPath();
    outline(context);
    context.stroke();
    // The probe is a bar with a dot on the marker's side.
    context.rotate((this.turn * Math.PI) / 180);
    context.strokeStyle = context.fillStyle = "#4fd1c5";
    context.lineWidth = 0.14;
    context.beginPath();
    context.moveTo(-0.3, 0.15);
    context.lineTo(0.3, 0.15);
    context.stroke();
    context.beginPath();
    context.arc(-0.42, 0.15, 0.09, 0, 2 * Math.PI);
    context.fill();
    context.restore();
  }

  /** Texts and body mark as data, saved with a picture. */
  values(frame) {
    return {
      texts: this.on(frame).map(({ at, text }) => ({ ...toPixel(frame, at), at_mm: [at.x, at.z], text })),
      body_mark: this.mark === "none" ? null : { name: this.mark, turn_deg: this.turn },
    };
  }
}
