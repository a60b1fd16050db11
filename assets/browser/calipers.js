// Calipers: distances, ellipses and angles, measured in the picture's own scale.

import { toStage } from "./view.js";

const COLOURS = ["#ffd54a", "#6ee7ff", "#ff9ecb", "#a7f070", "#ffb27a", "#c9a7ff"];
const CALIPERS_MAX = 6;

/** Tools in the order of their key, and the points that each takes. */
export const TOOLS = {
  distance: { label: "Distance", points: 2 },
  ellipse: { label: "Ellipse", points: 3 },
  angle: { label: "Angle", points: 3 },
};

export class Calipers {
  constructor() {
    this.all = [];
    this.pending = null;
    /** Name of the tool in the hand, or null. */
    this.tool = null;
  }

  /** Takes the next tool, or none after the last. */
  next() {
    const names = Object.keys(TOOLS);
    this.pick(names[names.indexOf(this.tool) + 1] ?? null);
  }

  pick(tool) {
    this.tool = tool;
    this.pending = null;
  }

  clear() {
    this.all = [];
    this.pending = null;
  }

  /** Sets the next point on a frame; the last one completes the caliper, which is returned. */
  point(at, frame) {
    if (!this.pending) {
      this.pending = { tool: this.tool, scale: scaleOf(frame), points: [at, at] };
      return null;
    }
    // A finger sets a point without having moved to it.
    this.move(at);
    const done = this.pending;
    if (done.points.length < TOOLS[this.tool].points) {
      done.points.push(at);
      return null;
    }
    this.all = [...this.all, done].slice(-CALIPERS_MAX);
    this.pending = null;
    return done;
  }

  /** Calipers that were set at the frame's scale; on another one they lie elsewhere. */
  on(frame) {
    return this.all.filter(({ scale }) => scale === scaleOf(frame));
  }

  /** Moves the point that is not set yet. */
  move(at) {
    if (this.pending) this.pending.points[this.pending.points.length - 1] = at;
  }

  draw(context, frame, rect, font) {
    const shown = this.pending?.scale === scaleOf(frame) ? [...this.on(frame), this.pending] : this.on(frame);
    shown.forEach((caliper, i) => draw(context, frame, rect, caliper, i, font));
  }

  /** Every measurement by name and value. */
  values(frame) {
    return this.on(frame).map((caliper, i) => ({ number: i + 1, tool: caliper.tool, ...measure(frame, caliper) }));
  }
}

/** What places on a picture depend on: its size and the side of a pixel. */
export const scaleOf = (frame) => `${frame.width} ${frame.height} ${frame.pixelMm}`;

const between = (a, b) => Math.hypot(b.x - a.x, b.y - a.y);

/** Half axes of an ellipse: the first two points are the ends of one axis, the third lies at the end of the other. */
function axes([a, b, c]) {
  const centre = { x: (a.x + b.x) / 2, y: (a.y + b.y) / 2 };
  const major = between(a, b) / 2;
  const turn = Math.atan2(b.y - a.y, b.x - a.x);
  const third = c ?? centre;
  const minor = Math.abs(-Math.sin(turn) * (third.x - centre.x) + Math.cos(turn) * (third.y - centre.y));
  return { centre, major, minor, turn };
}

/** Measured values, with their units in their names. */
export function measure(frame, { tool, points }) {
  const mm = frame.pixelMm;
  if (tool === "ellipse") {
    const { major, minor } = axes(points);
    const [a, b] = [major * mm, minor * mm];
    // Ramanujan's first approximation of the circumference.
    const circumference = Math.PI * (3 * (a + b) - Math.sqrt((3 * a + b) * (a + 3 * b)));
    return { circumference_mm: circumference, area_mm2: Math.PI * a * b, axes_mm: [2 * a, 2 * b] };
  }
  if (tool === "angle") {
    // The second point is the corner.
    const [a, corner, b] = points.length > 2 ? points : [points[0], points[1], points[1]];
    const one = Math.atan2(a.y - corner.y, a.x - corner.x);
    const other = Math.atan2(b.y - corner.y, b.x - corner.x);
    const turn = Math.abs(one - other);
    return { angle_deg: ((turn > Math.PI ? 2 * Math.PI - turn : turn) * 180) / Math.PI };
  }
  return { length_mm: between(points[0], points[1]) * mm };
}

function caption(frame, caliper) {
  const found = measure(frame, caliper);
  if (caliper.tool === "ellipse") return `C ${found.circumference_mm.toFixed(1)} mm  A ${(found.area_mm2 / 100).toFixed(2)} cm²`;
  if (caliper.tool === "angle") return `${found.angle_deg.toFixed(1)}°`;
  return `${found.length_mm.toFixed(1)} mm`;
}

function draw(context, frame, rect, caliper, index, font) {
  const size = rect.marks;
  const places = caliper.points.map((point) => toStage(rect, point));
  context.strokeStyle = context.fillStyle = COLOURS[index % COLOURS.length];
  context.lineWidth = 1.5 * size;
  for (const { x, y } of places) {
    context.beginPath();
    context.moveTo(x - 7 * size, y);
    context.lineTo(x + 7 * size, y);
    context.moveTo(x, y - 7 * size);
    context.lineTo(x, y + 7 * size);
    context.stroke();
  }
  context.setLineDash([3 * size, 5 * size]);
  context.beginPath();
  if (caliper.tool === "ellipse" && places.length > 2) {
    const { centre, major, minor, turn } = axes(places);
    context.ellipse(centre.x, centre.y, major, minor, turn, 0, 2 * Math.PI);
  } else {
    places.forEach(({ x, y }, i) => (i ? context.lineTo(x, y) : context.moveTo(x, y)));
  }
  context.stroke();
  context.setLineDash([]);
  const last = places.reduce((right, place) => (place.x > right.x ? place : right));
  label(context, `${index + 1}:  ${caption(frame, caliper)}`, last.x + 13 * size, last.y, size, font);
}

/** A text on a dark ground, in the current colour. */
export function label(context, text, x, y, size, font) {
  const colour = context.fillStyle;
  context.font = `600 ${13 * size}px ${font}`;
  context.textAlign = "left";
  context.textBaseline = "middle";
  context.fillStyle = "rgb(5 8 10 / 75%)";
  context.fillRect(x - 5 * size, y - 11 * size, context.measureText(text).width + 10 * size, 22 * size);
  context.fillStyle = colour;
  context.fillText(text, x, y);
}
