// Marks that a scanner draws around its picture: depth scale, focus, orientation, grey map, settings.

import { FONT, LINE, toStage } from "./view.js";

export { FONT };

const INK = "#d6dde3";
const FAINT = "#7d8893";
const ACCENT = "#4fd1c5";
const FOCUS = "#f5c542";

/** Centimetres between numbered ticks, so that the numbers keep their distance. */
export function tickStepCm(depthCm, heightPx) {
  const pixelsPerCm = heightPx / Math.max(depthCm, 1e-9);
  return [1, 2, 5, 10, 20, 50].find((step) => step * pixelsPerCm >= 24) ?? 100;
}

/** Draws all marks of `frame`, whose picture is at `rect`. `greys` is the table of the grey map, or null. */
export function drawMarks(context, frame, rect, greys) {
  context.save();
  context.font = `${12 * rect.marks}px ${FONT}`;
  context.textBaseline = "middle";
  depthScale(context, frame, rect);
  orientation(context, frame, rect);
  greyBar(context, frame, rect, greys);
  caption(context, rect);
  context.restore();
}

function depthScale(context, frame, rect) {
  const size = rect.marks;
  const yAt = (depthMm) => toStage(rect, { x: 0, y: frame.faceRow + depthMm / frame.pixelMm }).y;
  const x = rect.x + rect.width + 14 * size;
  const depthMm = frame.settings.depth_mm;
  const pixels = Math.abs(yAt(depthMm) - yAt(0));
  const step = tickStepCm(depthMm / 10, pixels / size);
  context.strokeStyle = FAINT;
  context.fillStyle = INK;
  context.lineWidth = size;
  context.textAlign = "left";
  const line = (y, length) => {
    const sharp = Math.round(y) + 0.5;
    context.beginPath();
    context.moveTo(x, sharp);
    context.lineTo(x + length * size, sharp);
    context.stroke();
  };
  const minor = (pixels / Math.max(depthMm, 1e-9)) * 5 >= 7 * size ? 5 : 10;
  for (let mm = 0; mm <= depthMm + 1e-6; mm += minor) {
    const numbered = (mm / 10) % step === 0;
    line(yAt(mm), numbered ? 11 : mm % 10 === 0 ? 7 : 4);
    if (numbered) context.fillText(String(mm / 10), x + 16 * size, yAt(mm));
  }
  context.fillStyle = FAINT;
  context.fillText("cm", x + 14 * size, yAt(0) + (rect.flipY ? 17 : -17) * size);

  // The triangle of the focus points from the picture to the scale.
  const focus = frame.settings.focus_mm;
  const y = yAt(Math.min(focus, depthMm));
  context.fillStyle = FOCUS;
  context.globalAlpha = focus > depthMm ? 0.45 : 1;
  context.beginPath();
  context.moveTo(x - 2 * size, y);
  context.lineTo(x - 11 * size, y - 6 * size);
  context.lineTo(x - 11 * size, y + 6 * size);
  context.fill();
  context.globalAlpha = 1;
}

/** Draws the mark on the side of the first scanline, next to the probe's face. */
function orientation(context, frame, rect) {
  const size = rect.marks;
  const aside = Math.min(0.24 * rect.width, 190 * size) * (rect.flipX ? -1 : 1);
  const x = rect.x + rect.width / 2 - aside;
  const y = rect.flipY ? rect.y + rect.height - 14 * size : rect.y + 14 * size;
  context.strokeStyle = ACCENT;
  context.lineWidth = 2 * size;
  context.beginPath();
  context.arc(x, y, 7 * size, 0, 2 * Math.PI);
  context.stroke();
  context.fillStyle = ACCENT;
  context.beginPath();
  context.arc(x, y, 2.5 * size, 0, 2 * Math.PI);
  context.fill();
}

/** Draws the displayed greys from 0 dB down to the dynamic range, and the curve of the grey map. */
function greyBar(context, frame, rect, greys) {
  const size = rect.marks;
  const [x, width] = [rect.x - 30 * size, 10 * size];
  const height = Math.min(rect.height * 0.32, 190 * size);
  const y = rect.y + 8 * size;
  const shown = (level) => (greys ? greys[level] : level);
  const gradient = context.createLinearGradient(0, y, 0, y + height);
  for (let i = 0; i <= 16; i++) {
    const grey = shown(Math.round(255 * (1 - i / 16)));
    gradient.addColorStop(i / 16, `rgb(${grey} ${grey} ${grey})`);
  }
  context.fillStyle = gradient;
  context.fillRect(x, y, width, height);
  context.strokeStyle = "#3a444d";
  context.lineWidth = 1;
  context.strokeRect(x - 0.5, y - 0.5, width + 1, height + 1);
  context.strokeStyle = ACCENT;
  context.lineWidth = 1.2 * size;
  context.beginPath();
  for (let i = 0; i <= 32; i++) {
    const level = Math.round((255 * i) / 32);
    context.lineTo(x + (width * shown(level)) / 255, y + height * (1 - level / 255));
  }
  context.stroke();
  context.fillStyle = FAINT;
  context.textAlign = "center";
  context.fillText("0", x + 5 * size, y - 10 * size);
  context.fillText(`−${Math.round(frame.settings.dynamic_range_db)}`, x + 4 * size, y + height + 11 * size);
  context.fillText("dB", x + 5 * size, y + height + 25 * size);
}

function caption(context, { caption, middle, y, height, marks }) {
  context.fillStyle = FAINT;
  context.textAlign = "center";
  caption.forEach((line, i) => context.fillText(line, middle, y + height + (16 + LINE * i) * marks));
}
