// How the picture lies in its stage: size, place, and inversion left to right and up to down.

/** Margins of the picture in its stage, CSS pixels at a scale of 1. */
const MARGINS = { left: 46, right: 62, top: 44, bottom: 30 };
/** Height of a stage whose marks have a scale of 1, CSS pixels. */
const USUAL_HEIGHT = 860;

/** Size of marks and texts: they grow with the stage, to be read from 3 m, and never shrink below 12 pixels. */
export const markScale = (width, height) => Math.min(Math.max(Math.min(height / USUAL_HEIGHT, width / 1100), 1), 2.4);

/** Size of a saved picture of `width` × `height` with its margins, pixels. */
export const fileSize = (width, height) => [width + MARGINS.left + MARGINS.right, height + MARGINS.top + MARGINS.bottom];

export class View {
  constructor() {
    this.flipX = false;
    this.flipY = false;
    /** Room that is left free at the foot of the stage, CSS pixels. */
    this.foot = 0;
  }

  /** Where a picture of `width` × `height` lies in a stage: as large as fits, centred between the margins. */
  fit(width, height, stageWidth, stageHeight) {
    return this.place(width, height, stageWidth, stageHeight, markScale(stageWidth, stageHeight), this.foot);
  }

  /** Where a picture of its own size lies in a file of `fileSize(width, height)`. */
  inFile(width, height) {
    return this.place(width, height, ...fileSize(width, height), 1, 0);
  }

  place(width, height, stageWidth, stageHeight, marks, foot) {
    const room = {
      x: Math.max(stageWidth - (MARGINS.left + MARGINS.right) * marks, 1),
      y: Math.max(stageHeight - (MARGINS.top + MARGINS.bottom) * marks - foot, 1),
    };
    const scale = Math.min(room.x / width, room.y / height);
    const [w, h] = [width * scale, height * scale];
    return {
      x: MARGINS.left * marks + (room.x - w) / 2,
      y: MARGINS.top * marks + (room.y - h) / 2,
      width: w,
      height: h,
      scale,
      marks,
      flipX: this.flipX,
      flipY: this.flipY,
    };
  }

  /** CSS that turns the picture's canvas. */
  get transform() {
    return `scale(${this.flipX ? -1 : 1}, ${this.flipY ? -1 : 1})`;
  }
}

/** A pixel of the picture in its stage. */
export function toStage(rect, { x, y }) {
  return {
    x: rect.flipX ? rect.x + rect.width - x * rect.scale : rect.x + x * rect.scale,
    y: rect.flipY ? rect.y + rect.height - y * rect.scale : rect.y + y * rect.scale,
  };
}

/** The pixel of the picture at a place of its stage. */
export function fromStage(rect, { x, y }) {
  return {
    x: (rect.flipX ? rect.x + rect.width - x : x - rect.x) / rect.scale,
    y: (rect.flipY ? rect.y + rect.height - y : y - rect.y) / rect.scale,
  };
}

/** Draws a picture at its place, inverted as the view says. */
export function drawPicture(context, canvas, rect) {
  context.save();
  context.translate(rect.x + (rect.flipX ? rect.width : 0), rect.y + (rect.flipY ? rect.height : 0));
  context.scale(rect.flipX ? -1 : 1, rect.flipY ? -1 : 1);
  context.drawImage(canvas, 0, 0, rect.width, rect.height);
  context.restore();
}
