// Clips: recordings of the screen as a video with a known duration.

import { withDuration } from "./clip_duration.js";

/** Video types by preference: MP4 plays everywhere, WebM only in browsers. */
const TYPES = ["video/mp4;codecs=avc1.640028", "video/mp4;codecs=avc1.42E01E", "video/webm;codecs=vp9", "video/webm;codecs=vp8", "video/webm", "video/mp4"];
const BITS_PER_SECOND = 12_000_000;

/** A recording of a canvas. Each call of `show(draw)` adds a frame that `draw(context)` draws. */
export class Clip {
  constructor(width, height) {
    const type = typeof MediaRecorder === "undefined" ? undefined : TYPES.find((type) => MediaRecorder.isTypeSupported(type));
    if (!type) throw new Error("this browser records no video");
    this.type = type;
    // Encoders require even sizes.
    const even = { width: width + (width & 1), height: height + (height & 1) };
    this.canvas = Object.assign(document.createElement("canvas"), even);
    this.context = this.canvas.getContext("2d", { alpha: false });
    this.stream = this.canvas.captureStream(0);
    this.recorder = new MediaRecorder(this.stream, { mimeType: type, videoBitsPerSecond: BITS_PER_SECOND });
    this.parts = [];
    this.frames = 0;
    /** Time at which the first frame was shown, ms since the page began. */
    this.begun = 0;
    this.recorder.onerror = ({ error }) => {
      this.error = error ?? new Error("the browser stopped the recording");
    };
    this.recorder.ondataavailable = ({ data }) => data.size && this.parts.push(data);
    this.recorder.start(1000);
  }

  show(draw) {
    this.context.fillStyle = "#000";
    this.context.fillRect(0, 0, this.canvas.width, this.canvas.height);
    draw(this.context, this.canvas);
    this.stream.getVideoTracks()[0].requestFrame();
    if (this.frames === 0) this.begun = performance.now();
    this.frames += 1;
  }

  /** Ends the recording. Resolves with the file's content, or rejects with the fault. */
  async end() {
    // The last frame is shown until now.
    const seconds = (performance.now() - this.begun) / 1000;
    try {
      if (this.recorder.state !== "inactive") {
        await new Promise((resolve) => {
          this.recorder.onstop = resolve;
          this.recorder.stop();
        });
      }
      if (this.error) throw this.error;
      if (this.frames === 0) throw new Error("the clip is empty: nothing was shown meanwhile");
      return await withDuration(new Blob(this.parts, { type: this.type.split(";")[0] }), seconds);
    } finally {
      this.stream.getTracks().forEach((track) => track.stop());
    }
  }

  get extension() {
    return this.type.includes("mp4") ? "mp4" : "webm";
  }
}

/** Name of a picture's file, from the time at which it was shown and its frame number. */
export function fileName(date, number, extension) {
  const [day, time] = date.toISOString().split("T");
  return `insonify_${day.replaceAll("-", "")}_${time.slice(0, 8).replaceAll(":", "")}_${String(number).padStart(6, "0")}.${extension}`;
}

/** Offers a file for download. */
export function download(blob, name) {
  if (!blob) throw new Error(`${name} can't be made: the picture is too large for this browser`);
  const link = document.createElement("a");
  link.href = URL.createObjectURL(blob);
  link.download = name;
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 1000);
}
