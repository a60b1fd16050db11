// Decoder of the station's binary messages; src/sink/browser/wire.rs has the table of their layout.

const FIXED_BYTES = 248;
const VERSION = 6;

export const MAP = { IMAGE: 1, SEGMENTATION: 2, ATTENUATION: 3 };
export const SOURCES = ["RAW", "GENERATED", "HELD GENERATED"];
export const TRACKING = ["good", "held", "stuck", "stale", "lost"];

/** Decodes one message by the station's list of live settings. `data` is a view into `buffer`, not a copy. */
export function decode(buffer, settings) {
  if (buffer.byteLength < FIXED_BYTES) throw new Error(`a message of ${buffer.byteLength} bytes has no header`);
  const view = new DataView(buffer);
  if (view.getUint32(0) !== 0x494e5346) throw new Error("not a message of insonify");
  if (view.getUint16(4, true) !== VERSION) throw new Error("the page is of another version than the station: reload it");
  const f64 = (offset) => view.getFloat64(offset, true);
  const numbers = (offset, count) => Array.from({ length: count }, (_, i) => f64(offset + 8 * i));
  const width = view.getUint32(16, true);
  const height = view.getUint32(20, true);
  const [generatorBytes, noticeBytes] = [view.getUint16(42, true), view.getUint16(44, true)];
  const values = view.getUint16(46, true);
  const start = FIXED_BYTES + 8 * values;
  const end = start + width * height;
  if (buffer.byteLength !== end + generatorBytes + noticeBytes) throw new Error("a message of the wrong length");
  const flags = view.getUint8(41);
  const text = (offset, bytes) => (bytes ? new TextDecoder().decode(new Uint8Array(buffer, offset, bytes)) : "");
  const [generator = "", point = "", reason = "", ...tipEvents] = text(end, generatorBytes).split("\n");
  const [firstByte, sampled, submitted, rendered, inferenceStart, inferenceEnd, presented] = numbers(104, 7);
  return {
    map: view.getUint8(6),
    source: view.getUint8(7),
    number: Number(view.getBigUint64(8, true)),
    width,
    height,
    pixelMm: f64(24),
    faceRow: f64(32),
    tracking: TRACKING[view.getUint8(40)] ?? "lost",
    pose: flags & 1 ? numbers(48, 7) : null,
    // Held, repeated and frozen poses have no latency, because the station did not cause their age.
    latencyMs: flags & 16 ? presented - (flags & 2 ? firstByte : sampled) : null,
    misplaced: flags & 32 ? "deep" : flags & 64 ? "looks_out" : null,
    times: { firstByte, sampled, submitted, rendered, inferenceStart, inferenceEnd, presented },
    contact: flags & 8 ? { part: f64(160), pressMm: f64(168) } : null,
    needle: needleOf(numbers(176, 9)),
    settings: settingsOf(settings, numbers(FIXED_BYTES, values)),
    generator,
    point,
    reason,
    tipEvents,
    notice: text(end + generatorBytes, noticeBytes),
    data: new Uint8Array(buffer, start, width * height),
  };
}

/** Tracking, length and pose of the needle; null if the station has none. */
function needleOf([state, lengthMm, ...pose]) {
  if (state < 0) return null;
  return { tracking: TRACKING[state] ?? "lost", lengthMm, pose: pose.some((v) => v !== 0) ? pose : null };
}

/** Values of settings by key; an array for a setting with several values. */
function settingsOf(settings, values) {
  let next = 0;
  const entries = settings.map(({ key, count }) => {
    const own = values.slice(next, (next += count));
    return [key, count > 1 ? own : own[0]];
  });
  if (next !== values.length) throw new Error("the frame has other settings than the station said: reload the page");
  return Object.fromEntries(entries);
}
