// What a scanner draws over its picture: depth scale, focus, orientation, grey bar, settings, calipers.

const INK = "#d6dde3";
const FAINT = "#7d8893";
const ACCENT = "#4fd1c5";
const FOCUS = "#f5c542";
const CALIPERS = ["#ffd54a", "#6ee7ff", "#ff9ecb", "#a7f070"];
const FONT = '"Inter", "Segoe UI", "Helvetica Neue", "DejaVu Sans", system-ui, sans-serif';

/** Margins of the picture in its stage, CSS pixels. */
export const MARGINS = { left: 46, right: 62, top: 44, bottom: 30 };

/** Where a picture of `width` × `height` lies in a stage: as large as fits, centred between the margins. */
export function fit(width, height, stageWidth, stageHeight) {
  const roomX = Math.max(stageWidth - MARGINS.left - MARGINS.right, 1);
  const roomY = Math.max(stageHeight - MARGINS.top - MARGINS.bottom, 1);
  const scale = Math.min(roomX / width, roomY / height);
  const [w, h] = [width * scale, height * scale];
  return { x: MARGINS.left + (roomX - w) / 2, y: MARGINS.top + (roomY - h) / 2, width: w, height: h, scale };
}

/** Cm between numbered ticks, so that they keep their distance. */
export function tickStepCm(depthCm, heightPx) {
  const pixelsPerCm = heightPx / Math.max(depthCm, 1e-9);
  return [1, 2, 5, 10, 20, 50].find((step) => step * pixelsPerCm >= 24) ?? 100;
}

/** Draws all marks of `frame`, its picture at `rect`. */
export function drawMarks(context, frame, rect, captions, calipers, pending) {
  const yAt = (depthMm) => rect.y + (frame.faceRow + depthMm / frame.pixelMm) * rect.scale;
  context.save();
  context.font = `12px ${FONT}`;
  context.textBaseline = "middle";
  depthScale(context, frame, rect, yAt);
  orientation(context, frame, rect);
  greyBar(context, frame, rect);
  caption(context, captions, rect);
  calipers.forEach((caliper, i) => drawCaliper(context, frame, rect, caliper, i));
  if (pending) drawCaliper(context, frame, rect, pending, calipers.length);
  context.restore();
}

function depthScale(context, frame, rect, yAt) {
  const x = rect.x + rect.width + 14;
  const depthMm = frame.settings.depth_mm;
  const [top, bottom] = [yAt(0), yAt(depthMm)];
  const step = tickStepCm(depthMm / 10, bottom - top);
  context.strokeStyle = FAINT;
  context.fillStyle = INK;
  context.lineWidth = 1;
  context.textAlign = "left";
  const line = (y, length) => {
    const sharp = Math.round(y) + 0.5;
    context.beginPath();
    context.moveTo(x, sharp);
    context.lineTo(x + length, sharp);
    context.stroke();
  };
  const minor = ((bottom - top) / Math.max(depthMm, 1e-9)) * 5 >= 7 ? 5 : 10;
  for (let mm = 0; mm <= depthMm + 1e-6; mm += minor) {
    const numbered = (mm / 10) % step === 0;
    line(yAt(mm), numbered ? 11 : mm % 10 === 0 ? 7 : 4);
    if (numbered) context.fillText(String(mm / 10), x + 16, yAt(mm));
  }
  context.fillStyle = FAINT;
  context.fillText("cm", x + 14, top - 17);

  // The focus points at the scale from the picture's side.
  const focus = frame.settings.focus_mm;
  const y = yAt(Math.min(focus, depthMm));
  context.fillStyle = FOCUS;
  context.globalAlpha = focus > depthMm ? 0.45 : 1;
  context.beginPath();
  context.moveTo(x - 2, y);
  context.lineTo(x - 11, y - 6);
  context.lineTo(x - 11, y + 6);
  context.fill();
  context.globalAlpha = 1;
}

/** The mark on the side of the first scanline, left of the probe's face. */
function orientation(context, frame, rect) {
  const x = rect.x + rect.width / 2 - Math.min(0.24 * rect.width, 190);
  const y = rect.y + 14;
  context.strokeStyle = ACCENT;
  context.lineWidth = 2;
  context.beginPath();
  context.arc(x, y, 7, 0, 2 * Math.PI);
  context.stroke();
  context.fillStyle = ACCENT;
  context.beginPath();
  context.arc(x, y, 2.5, 0, 2 * Math.PI);
  context.fill();
}

function greyBar(context, frame, rect) {
  const [x, width] = [rect.x - 30, 10];
  const height = Math.min(rect.height * 0.32, 190);
  const y = rect.y + 8;
  const gradient = context.createLinearGradient(0, y, 0, y + height);
  gradient.addColorStop(0, "#fff");
  gradient.addColorStop(1, "#000");
  context.fillStyle = gradient;
  context.fillRect(x, y, width, height);
  context.strokeStyle = "#3a444d";
  context.lineWidth = 1;
  context.strokeRect(x - 0.5, y - 0.5, width + 1, height + 1);
  context.fillStyle = FAINT;
  context.textAlign = "center";
  context.fillText("0", x + 5, y - 10);
  context.fillText(`−${Math.round(frame.settings.dynamic_range_db)}`, x + 4, y + height + 11);
  context.fillText("dB", x + 5, y + height + 25);
}

function caption(context, parts, rect) {
  context.fillStyle = FAINT;
  context.textAlign = "center";
  context.fillText(parts.join("   ·   "), rect.x + rect.width / 2, rect.y + rect.height + 16, rect.width);
}

/** Length of a caliper, mm. */
export function lengthMm(frame, caliper) {
  const [a, b] = caliper.points;
  return Math.hypot(b.x - a.x, b.y - a.y) * frame.pixelMm;
}

function drawCaliper(context, frame, rect, caliper, index) {
  const colour = CALIPERS[index % CALIPERS.length];
  const place = ({ x, y }) => [rect.x + x * rect.scale, rect.y + y * rect.scale];
  const places = caliper.points.map(place);
  context.strokeStyle = context.fillStyle = colour;
  context.lineWidth = 1.5;
  for (const [x, y] of places) {
    context.beginPath();
    context.moveTo(x - 7, y);
    context.lineTo(x + 7, y);
    context.moveTo(x, y - 7);
    context.lineTo(x, y + 7);
    context.stroke();
  }
  if (places.length < 2) return;
  const [[ax, ay], [bx, by]] = places;
  context.setLineDash([3, 5]);
  context.beginPath();
  context.moveTo(ax, ay);
  context.lineTo(bx, by);
  context.stroke();
  context.setLineDash([]);
  const mm = lengthMm(frame, caliper);
  const text = `${index + 1}:  ${mm.toFixed(1)} mm`;
  const [x, y] = bx >= ax ? [bx + 13, by] : [ax + 13, ay];
  context.font = `600 13px ${FONT}`;
  context.textAlign = "left";
  context.fillStyle = "rgb(5 8 10 / 75%)";
  context.fillRect(x - 5, y - 11, context.measureText(text).width + 10, 22);
  context.fillStyle = colour;
  context.fillText(text, x, y);
  context.font = `12px ${FONT}`;
}
