// Shared by calipers and texts: positions on a picture in mm of the probe frame, labels, and messages to the station.

/** Point (x, z) of the probe frame, mm, at a pixel of a frame. */
export const toMm = (frame, { x, y }) => ({
  x: (x - frame.width / 2) * frame.pixelMm,
  z: (y - frame.faceRow) * frame.pixelMm,
});

/** Pixel of a frame at a point (x, z) of the probe frame. */
export const toPixel = (frame, { x, z }) => ({ x: x / frame.pixelMm + frame.width / 2, y: z / frame.pixelMm + frame.faceRow });

/** Draws a text on a dark background, in the current colour. It is shifted to the left so that it ends before `end`. */
export function label(context, text, x, y, size, font, end = Infinity) {
  const colour = context.fillStyle;
  context.font = `600 ${13 * size}px ${font}`;
  context.textAlign = "left";
  context.textBaseline = "middle";
  const width = context.measureText(text).width;
  const left = Math.min(x, end - width - 5 * size);
  context.fillStyle = "rgb(5 8 10 / 75%)";
  context.fillRect(left - 5 * size, y - 11 * size, width + 10 * size, 22 * size);
  context.fillStyle = colour;
  context.fillText(text, left, y);
}

/** Largest number of changes that wait for the station, which accepts 64 at once. */
const WAITING_MAX = 60;

/** Gives identifiers to marks, and sends changes of marks to the station in order. */
export class Outbox {
  /** `link`: { isOpen(), send(message), say(text, bad) }. */
  constructor(link) {
    this.link = link;
    this.page = [...crypto.getRandomValues(new Uint8Array(5))].map((byte) => byte.toString(36).padStart(2, "0")).join("");
    this.count = 0;
    /** Identifier of the station's session. Marks of an earlier session are not sent. */
    this.session = "";
    this.waiting = [];
  }

  /** Handles the station's first message. Changes that waited for the same session are sent. */
  begin(session) {
    if (this.session === session) this.waiting.forEach((message) => this.link.send(message));
    else if (this.waiting.length > 0) {
      const lost = `${this.waiting.length} changes of marks are not recorded`;
      this.link.say(`the station was started again: ${lost}; measure again on a new picture`, true);
    }
    this.session = session;
    this.waiting = [];
  }

  newId() {
    this.count += 1;
    return `${this.page}-${this.count}`;
  }

  /** Sends the state of a mark on a picture. */
  set(id, picture, content) {
    const { number: frame, sampledMs: sampled_ms, pose } = picture;
    this.send(picture, { type: "mark", id, frame, sampled_ms, pose, content });
  }

  remove(marks) {
    const own = marks.filter(({ id, picture }) => id && picture.session === this.session);
    // The station accepts only this many at once.
    for (let i = 0; i < own.length; i += 64) {
      this.send(own[i].picture, { type: "unmark", ids: own.slice(i, i + 64).map(({ id }) => id) });
    }
  }

  send(picture, message) {
    if (picture.session !== this.session) {
      this.link.say("the picture is of an earlier session: the change is not recorded; freeze a new picture", true);
      return;
    }
    if (this.link.isOpen()) {
      this.link.send(message);
      return;
    }
    if (this.waiting.length >= WAITING_MAX) {
      this.link.say("not connected, and many marks wait: this change is not recorded", true);
      return;
    }
    this.waiting.push(message);
    this.link.say("not connected: the mark is recorded if the station comes back", true);
  }
}
