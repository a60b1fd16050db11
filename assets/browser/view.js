// How the picture lies in its stage: size, place, and inversion left to right and up to down.

export const FONT = '"Inter", "Segoe UI", "Helvetica Neue", "DejaVu Sans", system-ui, sans-serif';
/** Between two texts of the caption. */
const BETWEEN = "   ·   ";
/** Height of a line of the caption, and the room at its sides, CSS pixels at a scale of 1. */
export const LINE = 16;
const CAPTION_ASIDE = 10;
/** Margins of the picture in its stage, CSS pixels at a scale of 1. */
const MARGINS = { left: 46, right: 62, top: 44, bottom: 30 };
/** Height of a stage whose marks have a scale of 1, CSS pixels. */
const USUAL_HEIGHT = 860;

/** Size of marks and texts: they grow with the stage, to be read from 3 m, and never shrink below 12 pixels. */
export const markScale = (width, height) => Math.min(Math.max(Math.min(height / USUAL_HEIGHT, width / 1100), 1), 2.4);

/** Size of a saved picture of `width` × `height` with its margins and the lines of its caption, pixels. */
export function fileSize(width, height, captions) {
  const [w, h] = [width + MARGINS.left + MARGINS.right, height + MARGINS.top + MARGINS.bottom];
  return [w, h + LINE * (wrap(captions, w - 2 * CAPTION_ASIDE, 1).length - 1)];
}

const measuring = document.createElement("canvas").getContext("2d");

/** Lines of a caption, as few as fit into `width` at the marks' scale. There is one at least. */
function wrap(captions, width, marks) {
  measuring.font = `${12 * marks}px ${FONT}`;
  const lines = [];
  for (const part of captions) {
    const longer = lines.length ? `${lines.at(-1)}${BETWEEN}${part}` : part;
    if (lines.length && measuring.measureText(longer).width <= width) lines[lines.length - 1] = longer;
    else lines.push(part);
  }
  return lines.length ? lines : [""];
}

export class View {
  constructor() {
    this.flipX = false;
    this.flipY = false;
    /** Texts under the picture. */
    this.captions = [];
    /** Room that is left free at the foot of the stage, CSS pixels. */
    this.foot = 0;
  }

  /** Where a picture of `width` × `height` lies in a stage: as large as fits, centred between the margins. */
  fit(width, height, stageWidth, stageHeight) {
    return this.place(width, height, stageWidth, stageHeight, markScale(stageWidth, stageHeight), this.foot);
  }

  /** Where a picture of its own size lies in a file of `fileSize(width, height)`. */
  inFile(width, height) {
    return this.place(width, height, ...fileSize(width, height, this.captions), 1, 0);
  }

  place(width, height, stageWidth, stageHeight, marks, foot) {
    const caption = wrap(this.captions, stageWidth - 2 * CAPTION_ASIDE * marks, marks);
    const bottom = MARGINS.bottom + LINE * (caption.length - 1);
    const room = {
      x: Math.max(stageWidth - (MARGINS.left + MARGINS.right) * marks, 1),
      y: Math.max(stageHeight - (MARGINS.top + bottom) * marks - foot, 1),
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
      caption,
      /** Middle of the stage. */
      middle: stageWidth / 2,
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
