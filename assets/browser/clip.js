// Clips: what is on the screen, as a video that browsers play.

const TYPES = ["video/webm;codecs=vp9", "video/webm;codecs=vp8", "video/webm", "video/mp4"];
const BITS_PER_SECOND = 12_000_000;

/** A recording of a canvas. Each call of `show(draw)` adds what `draw(context)` draws. */
export class Clip {
  constructor(width, height) {
    const type = typeof MediaRecorder === "undefined" ? undefined : TYPES.find((type) => MediaRecorder.isTypeSupported(type));
    if (!type) throw new Error("this browser records no video");
    this.type = type;
    this.canvas = Object.assign(document.createElement("canvas"), { width: width & ~1, height: height & ~1 });
    this.context = this.canvas.getContext("2d", { alpha: false });
    this.stream = this.canvas.captureStream(0);
    this.recorder = new MediaRecorder(this.stream, { mimeType: type, videoBitsPerSecond: BITS_PER_SECOND });
    this.parts = [];
    this.frames = 0;
    this.recorder.ondataavailable = ({ data }) => data.size && this.parts.push(data);
    this.recorder.start(1000);
  }

  show(draw) {
    this.context.fillStyle = "#000";
    this.context.fillRect(0, 0, this.canvas.width, this.canvas.height);
    draw(this.context, this.canvas);
    this.stream.getVideoTracks()[0].requestFrame();
    this.frames += 1;
  }

  /** Ends the recording; resolves with the file's content. */
  end() {
    return new Promise((resolve) => {
      this.recorder.onstop = () => resolve(new Blob(this.parts, { type: this.type.split(";")[0] }));
      this.recorder.stop();
    });
  }

  get extension() {
    return this.type.includes("mp4") ? "mp4" : "webm";
  }
}

/** Offers a file for download. */
export function download(blob, name) {
  const link = document.createElement("a");
  link.href = URL.createObjectURL(blob);
  link.download = name;
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 1000);
}
