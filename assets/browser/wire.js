// Binary messages of the station; src/sink/browser/wire.rs has the table of their layout.

const HEADER_BYTES = 272;
const VERSION = 2;

export const MAP = { IMAGE: 1, SEGMENTATION: 2, ATTENUATION: 3 };
export const SOURCES = ["LOW QUALITY", "ENHANCED", "HELD"];
export const TRACKING = ["good", "held", "stuck", "stale", "lost"];

/** Reads one message. `data` is a view into `buffer`, not a copy. */
export function decode(buffer) {
  if (buffer.byteLength < HEADER_BYTES) throw new Error(`a message of ${buffer.byteLength} bytes has no header`);
  const view = new DataView(buffer);
  if (view.getUint32(0) !== 0x494e5346) throw new Error("not a message of insonify");
  if (view.getUint16(4, true) !== VERSION) throw new Error("the page is of another version than the station: reload it");
  const f64 = (offset) => view.getFloat64(offset, true);
  const numbers = (offset, count) => Array.from({ length: count }, (_, i) => f64(offset + 8 * i));
  const width = view.getUint32(16, true);
  const height = view.getUint32(20, true);
  const [tierBytes, noticeBytes] = [view.getUint16(42, true), view.getUint16(44, true)];
  const end = HEADER_BYTES + width * height;
  if (buffer.byteLength !== end + tierBytes + noticeBytes) throw new Error("a message of the wrong length");
  const flags = view.getUint8(41);
  const text = (offset, bytes) => (bytes ? new TextDecoder().decode(new Uint8Array(buffer, offset, bytes)) : "");
  const [firstByte, sampled, submitted, rendered, inferenceStart, inferenceEnd, presented] = numbers(104, 7);
  const [gain_db, dynamic_range_db, tgc_db_per_cm, depth_mm, focus_mm] = numbers(160, 5);
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
    latencyMs: presented - (flags & 2 ? firstByte : sampled),
    times: { firstByte, sampled, submitted, rendered, inferenceStart, inferenceEnd, presented },
    settings: {
      gain_db, dynamic_range_db, tgc_db_per_cm, depth_mm, focus_mm,
      tgc_sliders_db: numbers(200, 8),
      rays: view.getUint32(264, true),
      layers: view.getUint32(268, true),
      frozen: Boolean(flags & 8),
      enhance: Boolean(flags & 16),
    },
    tier: text(end, tierBytes),
    notice: text(end + tierBytes, noticeBytes),
    data: new Uint8Array(buffer, HEADER_BYTES, width * height),
  };
}
