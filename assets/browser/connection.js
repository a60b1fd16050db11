// The WebSocket to the station. It reconnects by itself.

import { decode, MAP } from "./wire.js";

const RETRY_MS = [250, 500, 1000, 2000];

/** Calls `on.open()`, `on.closed(reason)`, `on.message(json)`, `on.frame(frame)`, `on.error(text)`. */
export class Connection {
  constructor(on) {
    this.on = on;
    this.socket = null;
    this.attempts = 0;
    /** Reason why the station refuses the stream; empty if it gave none. */
    this.refusal = "";
    this.maps = {};
    /** The station's live settings, as its first message lists them. */
    this.settings = [];
    this.connect();
  }

  get isOpen() {
    return this.socket?.readyState === WebSocket.OPEN;
  }

  connect() {
    const scheme = location.protocol === "https:" ? "wss:" : "ws:";
    const socket = new WebSocket(`${scheme}//${location.host}/stream`);
    socket.binaryType = "arraybuffer";
    socket.onopen = () => {
      this.attempts = 0;
      this.refusal = "";
      this.maps = {};
      this.on.open();
    };
    socket.onmessage = (event) => this.receive(event.data);
    socket.onclose = (event) => this.retry(event.reason);
    this.socket = socket;
  }

  retry(reason) {
    this.on.closed(reason || this.refusal);
    const wait = RETRY_MS[Math.min(this.attempts, RETRY_MS.length - 1)];
    this.attempts += 1;
    setTimeout(() => this.connect(), wait);
    // A refused WebSocket doesn't give the reason, but a request does.
    if (this.attempts % 3 === 0) this.ask();
  }

  /** Asks the station why the stream is refused. */
  async ask() {
    try {
      const answer = await fetch("/stream", { method: "POST", cache: "no-store" });
      if (answer.status === 401) this.refusal = "the station has a new token: open the address that it prints";
      else this.refusal = answer.status === 403 || answer.status === 421 ? (await answer.text()).trim() : "";
      if (this.refusal && !this.isOpen) this.on.closed(this.refusal);
    } catch {
      this.refusal = "";
    }
  }

  receive(data) {
    try {
      if (typeof data === "string") {
        const message = JSON.parse(data);
        if (message.type === "hello") this.settings = message.settings;
        this.on.message(message);
        return;
      }
      const message = decode(data, this.settings);
      this.maps[message.map] = message;
      if (message.map === MAP.IMAGE) this.on.frame(message);
    } catch (error) {
      this.on.error(error.message);
    }
  }

  /** The map of this frame, or null if it was not sent. */
  mapOf(frame, map) {
    const found = this.maps[map];
    const fits = found && found.number === frame.number && found.data.length === frame.data.length;
    return fits ? found.data : null;
  }

  send(message) {
    if (this.isOpen) this.socket.send(JSON.stringify(message));
  }
}
