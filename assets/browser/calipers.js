// Calipers: distances, ellipses and angles. Each belongs to one picture; its points are mm of the probe frame.

import { label, toMm, toPixel } from "./marking.js";
import { toStage } from "./view.js";

export const COLOURS = ["#ffd54a", "#6ee7ff", "#ff9ecb", "#a7f070", "#ffb27a", "#c9a7ff"];
/** Largest number of calipers on one picture. */
export const CALIPERS_MAX = 12;
/** Largest number of calipers on all pictures. The oldest are forgotten here, but not in the recording. */
const KEPT_MAX = 1000;

/** Tools in the order in which their key selects them, and the number of points that each takes. */
export const TOOLS = {
  distance: { label: "Distance", points: 2 },
  ellipse: { label: "Ellipse", points: 3 },
  angle: { label: "Angle", points: 3 },
};

export class Calipers {
  constructor() {
    /** { id, picture, tool, name, points }. */
    this.all = [];
    this.pending = null;
    /** Name of the selected tool, or null. */
    this.tool = null;
  }

  /** Selects the next tool; after the last one, no tool. */
  next() {
    const names = Object.keys(TOOLS);
    this.pick(names[names.indexOf(this.tool) + 1] ?? null);
  }

  pick(tool) {
    this.tool = tool;
    this.pending = null;
  }

  /** Sets the next point at a pixel of a frame. The last point completes the caliper, which is then returned. */
  point(at, frame) {
    const point = toMm(frame, at);
    // A caliper that was begun on another picture is discarded.
    if (this.pending?.picture.key !== frame.picture.key) {
      this.pending = { tool: this.tool, name: "", picture: frame.picture, points: [point, point] };
      return null;
    }
    // A finger sets a point without moving to it first.
    this.move(at, frame);
    const done = this.pending;
    if (done.points.length < TOOLS[this.tool].points) {
      done.points.push(point);
      return null;
    }
    settle(done);
    this.all = [...this.all, done].slice(-KEPT_MAX);
    this.pending = null;
    return done;
  }

  /** Calipers on the picture of `frame`. */
  on(frame) {
    return this.all.filter(({ picture }) => picture.key === frame.picture.key);
  }

  /** Moves the point that follows the pointer until it is set. */
  move(at, frame) {
    if (this.pending?.picture.key !== frame.picture.key) return;
    this.pending.points[this.pending.points.length - 1] = toMm(frame, at);
  }

  /** The point nearest to a pixel of a frame, within `reach` pixels: { caliper, index }, or null. */
  near(at, frame, reach) {
    const all = this.on(frame).flatMap((caliper) => caliper.points.map((point, index) => ({ caliper, index, point })));
    const far = ({ point }) => between(toPixel(frame, point), at);
    const [nearest] = all.filter((one) => far(one) <= reach).sort((a, b) => far(a) - far(b));
    return nearest ? { caliper: nearest.caliper, index: nearest.index } : null;
  }

  draw(context, frame, rect, font) {
    const on = this.on(frame);
    const shown = this.pending?.picture.key === frame.picture.key ? [...on, this.pending] : on;
    shown.forEach((caliper, i) => draw(context, frame, rect, caliper, i, font));
  }

  /** All measurements of a picture: name, points and value. */
  values(frame) {
    return this.on(frame).map((caliper, i) => {
      const points = recordedPoints(caliper);
      return {
        number: i + 1,
        tool: caliper.tool,
        name: caliper.name || null,
        points_mm: pairs(points),
        points_px: points.map((point) => toPixel(frame, point)).map(({ x, y }) => [x, y]),
        ...measure(caliper),
      };
    });
  }
}

const between = (a, b) => Math.hypot(b.x - a.x, (b.y ?? b.z) - (a.y ?? a.z));
export const pairs = (points) => points.map(({ x, z }) => [x, z]);

/** Half axes of an ellipse. The first two points are the ends of one axis; the third is an end of the other axis. */
function axes([a, b, c]) {
  const centre = { x: (a.x + b.x) / 2, z: (a.z + b.z) / 2 };
  const major = between(a, b) / 2;
  const turn = Math.atan2(b.z - a.z, b.x - a.x);
  const third = c ?? centre;
  const minor = -Math.sin(turn) * (third.x - centre.x) + Math.cos(turn) * (third.z - centre.z);
  return { centre, major, minor, turn };
}

/** Point on the second axis of an ellipse, at the distance `far` from its centre. */
const aside = ({ centre, turn }, far) => ({ x: centre.x - Math.sin(turn) * far, z: centre.z + Math.cos(turn) * far });

/** Moves the third point of an ellipse to the end of its axis. */
function settle(caliper) {
  if (caliper.tool !== "ellipse") return;
  const found = axes(caliper.points);
  caliper.points[2] = aside(found, found.minor);
}

/** Moves a point of a finished caliper. If the first axis of an ellipse changes, the second keeps its length. */
export function drag(caliper, index, point) {
  const { minor } = caliper.tool === "ellipse" ? axes(caliper.points) : {};
  caliper.points[index] = point;
  if (caliper.tool === "ellipse" && index < 2) caliper.points[2] = aside(axes(caliper.points), minor);
  settle(caliper);
}

/** Points as a recording stores them: both ends of both axes for an ellipse. */
export function recordedPoints({ tool, points }) {
  if (tool !== "ellipse") return points;
  const found = axes(points);
  return [points[0], points[1], aside(found, found.minor), aside(found, -found.minor)];
}

/** Measured values; their names contain the units. */
export function measure({ tool, points }) {
  if (tool === "ellipse") {
    const { major: a, minor } = axes(points);
    const b = Math.abs(minor);
    // Ramanujan's second approximation of the circumference, as the station computes it.
    const h = a + b > 0 ? ((a - b) / (a + b)) ** 2 : 0;
    const circumference = Math.PI * (a + b) * (1 + (3 * h) / (10 + Math.sqrt(4 - 3 * h)));
    return { circumference_mm: circumference, area_mm2: Math.PI * a * b, axes_mm: [2 * a, 2 * b] };
  }
  if (tool === "angle") {
    // The second point is the corner.
    const [a, corner, b] = points.length > 2 ? points : [points[0], points[1], points[1]];
    const one = Math.atan2(a.z - corner.z, a.x - corner.x);
    const other = Math.atan2(b.z - corner.z, b.x - corner.x);
    const turn = Math.abs(one - other);
    return { angle_deg: ((turn > Math.PI ? 2 * Math.PI - turn : turn) * 180) / Math.PI };
  }
  return { length_mm: between(points[0], points[1]) };
}

/** Name and value of a caliper as text. */
export function caption(caliper) {
  const found = measure(caliper);
  const name = caliper.name ? `${caliper.name} ` : "";
  if (caliper.tool === "ellipse") {
    return `${name || "C "}${found.circumference_mm.toFixed(1)} mm  A ${(found.area_mm2 / 100).toFixed(2)} cm²`;
  }
  if (caliper.tool === "angle") return `${name}${found.angle_deg.toFixed(1)}°`;
  return `${name}${found.length_mm.toFixed(1)} mm`;
}

function draw(context, frame, rect, caliper, index, font) {
  const size = rect.marks;
  const stage = (point) => toStage(rect, toPixel(frame, point));
  const corners = caliper.points.map(stage);
  context.strokeStyle = context.fillStyle = COLOURS[index % COLOURS.length];
  context.lineWidth = 1.5 * size;
  for (const { x, y } of corners) {
    context.beginPath();
    context.moveTo(x - 7 * size, y);
    context.lineTo(x + 7 * size, y);
    context.moveTo(x, y - 7 * size);
    context.lineTo(x, y + 7 * size);
    context.stroke();
  }
  context.setLineDash([3 * size, 5 * size]);
  context.beginPath();
  if (caliper.tool === "ellipse" && corners.length > 2) {
    const found = axes(caliper.points);
    const [centre, tip, side] = [found.centre, caliper.points[1], aside(found, found.minor)].map(stage);
    const turn = Math.atan2(tip.y - centre.y, tip.x - centre.x);
    context.ellipse(centre.x, centre.y, between(centre, tip), between(centre, side), turn, 0, 2 * Math.PI);
  } else {
    corners.forEach(({ x, y }, i) => (i ? context.lineTo(x, y) : context.moveTo(x, y)));
  }
  context.stroke();
  context.setLineDash([]);
  const last = corners.reduce((right, corner) => (corner.x > right.x ? corner : right));
  label(context, `${index + 1}:  ${caption(caliper)}`, last.x + 13 * size, last.y, size, font, rect.x + rect.width + 44 * size);
}
