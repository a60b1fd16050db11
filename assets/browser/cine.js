// The cine loop: the pictures of the last seconds, to be gone through while the picture is frozen.

/** Time that is kept, ms. */
export const KEPT_MS = 20_000;
/** Most memory of the pictures, bytes. */
const BYTES_MAX = 256 << 20;
const QUALITY = 0.92;

export class Cine {
  constructor() {
    /** Pictures in order: { time, frame, blob }. `frame` is without its pixels. */
    this.kept = [];
    this.bytes = 0;
    this.encoding = false;
    /** Index of the picture that is shown; null: the live one. */
    this.at = null;
  }

  get isShown() {
    return this.at !== null;
  }

  /** Keeps a picture that was just drawn on `canvas`. Returns whether it does: a page that is slow keeps fewer pictures. */
  keep(canvas, frame, time) {
    if (this.encoding) return false;
    this.encoding = true;
    const { data, ...meta } = frame;
    canvas.toBlob(
      (blob) => {
        this.encoding = false;
        if (!blob) return;
        this.kept.push({ time, frame: meta, blob });
        this.bytes += blob.size;
        // A loop that is gone through keeps its beginning, and so the places of its pictures.
        if (this.isShown) return;
        while (this.kept.length > 1 && (this.kept[0].time < time - KEPT_MS || this.bytes > BYTES_MAX)) {
          this.bytes -= this.kept.shift().blob.size;
        }
      },
      "image/jpeg",
      QUALITY,
    );
    return true;
  }

  /** Goes to a picture; returns it, or null if none is kept. */
  goTo(index) {
    if (this.kept.length === 0) return null;
    this.at = Math.min(Math.max(index, 0), this.kept.length - 1);
    return this.kept[this.at];
  }

  step(by) {
    return this.goTo((this.at ?? this.kept.length - 1) + by);
  }

  live() {
    this.at = null;
  }

  /** Pixels of a kept picture. */
  static pixels(kept) {
    return createImageBitmap(kept.blob);
  }
}
