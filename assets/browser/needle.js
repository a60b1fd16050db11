// The tracked needle on the picture: its tip and shaft, projected across the slice onto the image plane.

import { FONT, toStage } from "./view.js";

/** Length of the planned path beyond the tip, mm. */
const PLANNED_MM = 60;
/** Distance from the image plane within which the tip counts as in the plane, mm. */
const IN_PLANE_MM = 1;

/** Vector `v` in the frame of the unit quaternion w, x, y, z. */
function turnedBack([w, x, y, z], v) {
  // v + w·t + q × t with t = 2·q × v, for the conjugate quaternion.
  const q = [-x, -y, -z];
  const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
  const t = cross(q, v).map((c) => 2 * c);
  const u = cross(q, t);
  return v.map((c, i) => c + w * t[i] + u[i]);
}

/** Direction of the needle's shaft in the scene: the z axis of its frame. */
function direction([w, x, y, z]) {
  return [2 * (x * z + w * y), 2 * (y * z - w * x), 1 - 2 * (x * x + y * y)];
}

/** Tip and direction of the needle in the probe's frame, mm; null without a pose of both. */
export function inProbe(frame) {
  if (!frame?.pose || !frame.needle?.pose) return null;
  const turn = frame.pose.slice(3);
  const from = frame.needle.pose.slice(0, 3).map((v, i) => v - frame.pose[i]);
  return { tip: turnedBack(turn, from), along: turnedBack(turn, direction(frame.needle.pose.slice(3))) };
}

/** Draws the projected shaft, its planned path, and the tip with its distance from the image plane. */
export function drawNeedle(context, frame, rect) {
  const placed = inProbe(frame);
  if (!placed) return;
  const { tip, along } = placed;
  const at = (mm) => {
    const [x, , z] = tip.map((v, i) => v + mm * along[i]);
    return toStage(rect, { x: x / frame.pixelMm + frame.width / 2, y: z / frame.pixelMm + frame.faceRow });
  };
  const line = (from, to, dash, alpha) => {
    context.setLineDash(dash.map((v) => v * rect.marks));
    context.globalAlpha = alpha;
    context.beginPath();
    context.moveTo(from.x, from.y);
    context.lineTo(to.x, to.y);
    context.stroke();
  };
  context.save();
  context.beginPath();
  context.rect(rect.x, rect.y, rect.width, rect.height);
  context.clip();
  context.strokeStyle = "#4fd0ff";
  context.lineWidth = 1.5 * rect.marks;
  line(at(-frame.needle.lengthMm), at(0), [], 0.55);
  line(at(0), at(PLANNED_MM), [4, 5], 0.55);
  const point = at(0);
  context.setLineDash([]);
  context.globalAlpha = 1;
  context.beginPath();
  context.arc(point.x, point.y, 5 * rect.marks, 0, 2 * Math.PI);
  context.stroke();
  const off = Math.abs(tip[1]);
  context.font = `${12 * rect.marks}px ${FONT}`;
  context.fillStyle = off <= IN_PLANE_MM ? "#4fd0ff" : "#ffb454";
  context.textBaseline = "middle";
  const text = off <= IN_PLANE_MM ? "tip in plane" : `tip ${off.toFixed(1)} mm out of plane`;
  context.fillText(text, point.x + 9 * rect.marks, point.y);
  context.restore();
}
