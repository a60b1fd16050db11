// Layout of the picture in its stage: size, position, and inversion left to right and up to down.

export const FONT = '"Inter", "Segoe UI", "Helvetica Neue", "DejaVu Sans", system-ui, sans-serif';
/** Separator between two texts of the caption. */
const BETWEEN = "   ·   ";
/** Height of a line of the caption, and space at its sides, CSS pixels at a scale of 1. */
export const LINE = 16;
const CAPTION_ASIDE = 10;
/** Margins of the picture in its stage, CSS pixels at a scale of 1. */
const MARGINS = { left: 46, right: 62, top: 44, bottom: 30 };
/** Height of a stage at which marks have a scale of 1, CSS pixels. */
const USUAL_HEIGHT = 860;

/** Scale of marks and texts. They grow with the stage, to be legible from 3 m, and never shrink below 12 pixels. */
export const markScale = (width, height) => Math.min(Math.max(Math.min(height / USUAL_HEIGHT, width / 1100), 1), 2.4);

/** Size of a saved picture of `width` × `height` with its margins and its caption, pixels. */
export function fileSize(width, height, captions) {
  const [w, h] = [width + MARGINS.left + MARGINS.right, height + MARGINS.top + MARGINS.bottom];
  return [w, h + LINE * (wrap(captions, w - 2 * CAPTION_ASIDE, 1).length - 1)];
}

const measuring = document.createElement("canvas").getContext("2d");

/** Lines of a caption: as few as fit into `width` at the scale of the marks, and at least one. */
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
    /** Space that is left free at the foot of the stage, CSS pixels. */
    this.foot = 0;
  }

  /** Rectangle of a picture of `width` × `height` in a stage: as large as possible, centred between the margins. */
  fit(width, height, stageWidth, stageHeight) {
    return this.rectangle(width, height, stageWidth, stageHeight, markScale(stageWidth, stageHeight), this.foot);
  }

  /** Rectangle of a picture at its own size in a file of `fileSize(width, height)`. */
  inFile(width, height) {
    return this.rectangle(width, height, ...fileSize(width, height, this.captions), 1, 0);
  }

  rectangle(width, height, stageWidth, stageHeight, marks, foot) {
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
      /** Centre of the stage. */
      middle: stageWidth / 2,
      flipX: this.flipX,
      flipY: this.flipY,
    };
  }

  /** CSS transform that inverts the picture's canvas. */
  get transform() {
    return `scale(${this.flipX ? -1 : 1}, ${this.flipY ? -1 : 1})`;
  }
}

/** Position in the stage of a pixel of the picture. */
export function toStage(rect, { x, y }) {
  return {
    x: rect.flipX ? rect.x + rect.width - x * rect.scale : rect.x + x * rect.scale,
    y: rect.flipY ? rect.y + rect.height - y * rect.scale : rect.y + y * rect.scale,
  };
}

/** Pixel of the picture at a position in the stage. */
export function fromStage(rect, { x, y }) {
  return {
    x: (rect.flipX ? rect.x + rect.width - x : x - rect.x) / rect.scale,
    y: (rect.flipY ? rect.y + rect.height - y : y - rect.y) / rect.scale,
  };
}

/** Draws a picture into its rectangle, inverted as the view is. */
export function drawPicture(context, canvas, rect) {
  context.save();
  context.translate(rect.x + (rect.flipX ? rect.width : 0), rect.y + (rect.flipY ? rect.height : 0));
  context.scale(rect.flipX ? -1 : 1, rect.flipY ? -1 : 1);
  context.drawImage(canvas, 0, 0, rect.width, rect.height);
  context.restore();
}
