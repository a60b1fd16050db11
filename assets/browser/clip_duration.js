// The duration of a WebM clip. Browsers write clips as streams without a duration; players then show no length and can't seek.

const IDS = { EBML: 0x1a45dfa3, SEGMENT: 0x18538067, INFO: 0x1549a966, SEEK_HEAD: 0x114d9b74, TIMECODE_SCALE: 0x2ad7b1, DURATION: 0x4489, CLUSTER: 0x1f43b675 };
const VOID = 0xec;
/** Bytes at the start of the file that contain its description. */
const HEAD_BYTES = 1 << 16;

/** The clip with its duration. A clip is returned unchanged if it is not WebM of the usual form, or already has a duration. */
export async function withDuration(blob, seconds) {
  if (!blob.type.includes("webm")) return blob;
  const head = new Uint8Array(await blob.slice(0, HEAD_BYTES).arrayBuffer());
  const described = withDurationIn(head, seconds);
  return described ? new Blob([described, blob.slice(head.length)], { type: blob.type }) : blob;
}

/** First bytes of a WebM file with a duration, s; null if nothing has to be changed. */
export function withDurationIn(head, seconds) {
  const ebml = element(head, 0);
  const segment = ebml?.id === IDS.EBML ? element(head, ebml.end) : null;
  if (segment?.id !== IDS.SEGMENT) return null;
  let seekHead = null;
  for (let at = segment.start; ; ) {
    const found = element(head, at);
    if (!found || found.id === IDS.CLUSTER || found.end > head.length) return null;
    if (found.id === IDS.SEEK_HEAD) seekHead = found;
    if (found.id === IDS.INFO) return lengthened(head, segment, found, seekHead, seconds);
    at = found.end;
  }
}

function lengthened(head, segment, info, seekHead, seconds) {
  let nsPerTick = 1e6;
  for (let at = info.start; at < info.end; ) {
    const found = element(head, at);
    if (!found || found.end > info.end) return null;
    const content = head.subarray(found.start, found.end);
    if (found.id === IDS.TIMECODE_SCALE) nsPerTick = content.reduce((value, byte) => 256 * value + byte, 0);
    if (found.id === IDS.DURATION) return null;
    at = found.end;
  }
  const duration = new Uint8Array(11);
  duration.set([0x44, 0x89, 0x88]);
  new DataView(duration.buffer).setFloat64(3, (seconds * 1e9) / nsPerTick);
  const content = [head.subarray(info.start, info.end), duration];
  const infoHead = [0x15, 0x49, 0xa9, 0x66, ...size(info.end - info.start + duration.length)];
  const longer = infoHead.length + duration.length - (info.start - info.at);
  const before = head.slice(0, info.at);
  if (segment.size !== null) {
    // The size field keeps its position: a field of 8 bytes holds any size.
    if (segment.start - segment.at !== 12) return null;
    before.set(size(segment.size + longer), segment.at + 4);
  }
  // The positions of what follows have moved, so the index of positions is cleared.
  if (seekHead) before.set(empty(seekHead.end - seekHead.at), seekHead.at);
  return concatenated([before, infoHead, ...content, head.subarray(info.end)]);
}

/** The element at a position: { id, at, start, end, size }; `size` is null if it is unknown. Null beyond the end. */
function element(bytes, at) {
  const id = number(bytes, at, true);
  const length = id && number(bytes, id.end, false);
  if (!length) return null;
  const start = length.end;
  return { id: id.value, at, start, end: length.value === null ? Infinity : start + length.value, size: length.value };
}

/** A number of variable length; null if all its bits are set, which means unknown. */
function number(bytes, at, isId) {
  const first = bytes[at];
  const count = first ? Math.clz32(first) - 23 : 0;
  if (count < 1 || at + count > bytes.length) return null;
  let value = isId ? first : first & (0xff >> count);
  let unknown = value === 0xff >> count;
  for (const byte of bytes.subarray(at + 1, at + count)) {
    value = 256 * value + byte;
    unknown &&= byte === 0xff;
  }
  return { value: unknown && !isId ? null : value, end: at + count };
}

/** A size in 8 bytes. */
function size(value) {
  const bytes = new Uint8Array(8);
  new DataView(bytes.buffer).setBigUint64(0, BigInt(value) | (1n << 56n));
  return bytes;
}

/** An empty element that takes `length` bytes. */
function empty(length) {
  const bytes = new Uint8Array(length);
  bytes.set(length > 9 ? [VOID, ...size(length - 9)] : [VOID, 0x80 | (length - 2)]);
  return bytes;
}

function concatenated(parts) {
  const all = new Uint8Array(parts.reduce((sum, part) => sum + part.length, 0));
  let at = 0;
  for (const part of parts) {
    all.set(part, at);
    at += part.length;
  }
  return all;
}
