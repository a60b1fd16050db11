// Cine loop: the pictures of the last seconds, which the user can step through while the picture is frozen.

/** Duration of the loop, ms. */
export const KEPT_MS = 20_000;
/** Largest memory of the pictures, bytes. */
const BYTES_MAX = 256 << 20;
const QUALITY = 0.92;

export class Cine {
  constructor() {
    /** Pictures in order: { time, frame, blob }. `frame` has no pixels. */
    this.kept = [];
    this.bytes = 0;
    this.encoding = false;
    /** Index of the picture that is shown; null for the live picture. */
    this.at = null;
  }

  get isShown() {
    return this.at !== null;
  }

  /** Adds the picture that was just drawn on `canvas`. Returns whether it was added: a slow page adds fewer pictures. */
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
        // While the user steps through the loop, its beginning stays, so that pictures keep their indices.
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

  /** Steps to the picture at `index`. Returns it, or null if the loop is empty. */
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

  /** Pixels of a picture in the loop. */
  static pixels(kept) {
    return createImageBitmap(kept.blob);
  }
}
