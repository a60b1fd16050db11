// Badges, banner, figures, and the chart of latencies.

import { Announcer } from "./accessibility.js";
import { SOURCES } from "./wire.js";

const byId = (id) => document.getElementById(id);
const HISTORY = 240;
/** Largest age of the latencies in the figures, ms: for the last frame, and for the percentile. */
const [LAST_MS, RECENT_MS] = [2000, 10000];

/** Texts over the picture, the most severe first. */
const BANNERS = {
  disconnected: ["NO CONNECTION", "the picture is not live; connecting again…"],
  silent: ["NO NEW FRAMES", "nothing new arrives; the picture is not live"],
  lost: ["TRACKING LOST", "the probe's pose is not known"],
  stale: ["STALE", "the picture no longer follows the probe"],
  stuck: ["STUCK", "the sensor repeats one reading"],
};

/** Announcements of states without a banner. */
const RUNS = { LIVE: "live", FROZEN: "frozen", CINE: "cine loop", WAITING: "waiting for the first picture" };

const TRACKING = {
  good: ["TRACKING", "good"],
  held: ["POSE HELD", "warn"],
  stuck: ["STUCK", "warn strong"],
  stale: ["STALE", "warn strong"],
  lost: ["LOST", "bad strong"],
};

function badge(element, text, kind) {
  if (element.textContent !== text) element.textContent = text;
  const classes = `badge ${kind}`;
  if (element.className !== classes) element.className = classes;
}

export class Status {
  constructor() {
    /** Latencies of recent frames with a new pose, and the times of their arrival. */
    this.latencies = [];
    this.arrivals = [];
    this.noticeTimer = 0;
    /** States of the run, the banner and the contact that were announced last. */
    this.announced = { run: "", banner: null, contact: "contact", needle: null };
    this.announcer = new Announcer(byId("announcer"));
    this.context = byId("sparkline").getContext("2d");
  }

  /** `state`: a key of BANNERS, or null if the picture can be trusted. `detail` replaces the second line. */
  banner(state, detail) {
    const element = byId("banner");
    element.hidden = !state;
    document.body.dataset.state = state ?? "live";
    const said = state && `${BANNERS[state][0].toLowerCase()}: ${detail || BANNERS[state][1]}`;
    if (said !== this.announced.banner) this.announcer.say(said);
    this.announced.banner = said;
    if (!state) return;
    const [title, text] = BANNERS[state];
    element.className = state;
    element.querySelector("strong").textContent = title;
    element.querySelector("span").textContent = detail || text;
  }

  /** Switches all badges off, because the station's state is unknown. */
  unknown() {
    for (const id of ["source", "tracking"]) badge(byId(id), "–", "");
    byId("contact").hidden = true;
    byId("needle").hidden = byId("needle_switch").hidden = byId("tip_switch").hidden = byId("tip_list").hidden = true;
    this.announced.needle = null;
    this.latencies = [];
    this.arrivals = [];
    byId("dropped").textContent = "–";
  }

  /** Stores the newest frame. */
  frame(frame, now) {
    this.arrivals.push(now);
    while (this.arrivals.length && this.arrivals[0] < now - 1000) this.arrivals.shift();
    if (frame.latencyMs !== null) this.latencies.push({ time: now, ms: frame.latencyMs });
  }

  /** Updates badges for the picture that is shown. */
  picture(frame) {
    const kinds = ["", "good", "warn"];
    badge(byId("source"), SOURCES[frame.source] ?? "?", kinds[frame.source] ?? "");
    badge(byId("tracking"), ...TRACKING[frame.tracking]);
    this.needle(frame.needle);
    tipEvents(frame);
    this.contact(frame.contact, frame.misplaced);
    byId("generator_name").textContent = frame.generator;
    byId("point").hidden = !frame.point;
    byId("point_name").textContent = frame.point;
    byId("point_reason").textContent = frame.reason;
    byId("frame_number").textContent = `frame ${frame.number}`;
    pose(frame.pose);
  }

  run(state) {
    const kinds = { LIVE: "good", FROZEN: "frozen", CINE: "frozen", WAITING: "warn", STALLED: "bad strong", OFFLINE: "bad strong" };
    badge(byId("run"), state, kinds[state]);
    if (state !== this.announced.run) this.announcer.say(RUNS[state]);
    this.announced.run = state;
  }

  /** Updates figures that needn't change with every frame. */
  figures(now) {
    const recent = this.arrivals.filter((time) => time > now - 1000);
    byId("rate").textContent = recent.length ? String(recent.length) : "–";
    while (this.latencies.length && this.latencies[0].time < now - RECENT_MS) this.latencies.shift();
    const last = this.latencies.at(-1);
    byId("latency").textContent = last && last.time > now - LAST_MS ? `${last.ms.toFixed(0)} ms` : "–";
    const sorted = this.latencies.map(({ ms }) => ms).sort((a, b) => a - b);
    // Percentile by nearest rank, as in the station's summary.
    const p95 = sorted[Math.ceil(0.95 * sorted.length) - 1];
    byId("latency_p95").textContent = p95 === undefined ? "–" : `${p95.toFixed(0)} ms`;
    this.sparkline();
  }

  sparkline() {
    const { context } = this;
    const latencies = this.latencies.slice(-HISTORY).map(({ ms }) => ms);
    const { width, height } = context.canvas;
    context.clearRect(0, 0, width, height);
    // The chart is at least 100 ms high, so that small changes look small.
    const most = Math.max(100, ...latencies);
    const y = (ms) => height - 1 - (ms / most) * (height - 3);
    context.strokeStyle = "#2c353d";
    context.setLineDash([2, 3]);
    context.beginPath();
    context.moveTo(0, y(100));
    context.lineTo(width, y(100));
    context.stroke();
    context.setLineDash([]);
    context.strokeStyle = "#4fd1c5";
    context.lineWidth = 1.25;
    context.beginPath();
    latencies.forEach((ms, i) => context.lineTo(width - (latencies.length - i) * (width / HISTORY), y(ms)));
    context.stroke();
  }

  /** Shows the station's text at the foot of the picture; an empty text clears it. It waits while the page shows a message. */
  notice(text) {
    if (!this.noticeTimer) this.write(text, "");
  }

  /** Shows a message of the page for some seconds. Only an error replaces an error. */
  say(text, isError = false) {
    if (byId("notice").className === "error" && this.noticeTimer && !isError) return;
    this.write(text, isError ? "error" : "");
    clearTimeout(this.noticeTimer);
    this.noticeTimer = setTimeout(() => {
      this.noticeTimer = 0;
      this.notice("");
    }, isError ? 6000 : 4000);
  }

  write(text, kind) {
    const element = byId("notice");
    element.hidden = !text;
    if (element.textContent !== text) {
      element.textContent = text;
      this.announcer.say(text);
    }
    element.className = kind;
  }

  /** Shows the tracking of the needle, and the switch of its projection. Hidden if the station has none. */
  needle(needle) {
    byId("needle").hidden = byId("needle_switch").hidden = byId("tip_switch").hidden = !needle;
    if (!needle) return;
    const [text, kind] = TRACKING[needle.tracking];
    badge(byId("needle"), `NEEDLE ${text}`, kind);
    if (needle.tracking === this.announced.needle) return;
    if (this.announced.needle) this.announcer.say(`needle: ${text.toLowerCase()}`);
    this.announced.needle = needle.tracking;
  }

  /** Shows the part of the face in contact, or that no hand can hold the probe there. Hidden if everything is coupled. */
  contact(contact, misplaced) {
    const element = byId("contact");
    element.hidden = !contact;
    if (!contact) return;
    const percent = Math.round(100 * contact.part);
    const warning = { deep: "DEEP IN THE BODY", looks_out: "LOOKS OUT OF THE BODY" }[misplaced];
    if (warning) badge(element, warning, "bad strong");
    else if (percent === 0) badge(element, "NO CONTACT", "warn strong");
    else badge(element, `CONTACT ${percent} %`, percent < 90 ? "warn" : "good");
    const said = warning?.toLowerCase() ?? (percent > 0 ? "contact" : "no contact");
    if (said !== this.announced.contact) this.announcer.say(said);
    this.announced.contact = said;
  }

  stats({ dropped, clients }) {
    byId("dropped").textContent = String(dropped);
    byId("dropped").parentElement.title = `Frames that this page was too slow for; pages watching: ${clients}`;
  }
}

/** Lists the latest events of the needle's tip, the newest first, if the switch is on. */
export function tipEvents(frame) {
  const list = byId("tip_list");
  list.hidden = !frame?.needle || !byId("tip_shown").checked;
  if (list.hidden) return;
  const lines = frame.tipEvents.length ? frame.tipEvents : ["nothing yet"];
  const key = lines.join("\n");
  if (list.dataset.key === key) return;
  list.dataset.key = key;
  const items = lines.map((line) => {
    const item = document.createElement("li");
    item.textContent = line;
    item.classList.toggle("bad", line.endsWith("forbidden"));
    return item;
  });
  list.querySelector("ol").replaceChildren(...items.reverse());
}

/** Position, and orientation as rotations about the scene's x, then y, then z axis. */
function pose(pose) {
  const set = (name, value) => {
    byId(`pose_${name}`).textContent = value === undefined ? "–" : value.toFixed(1);
  };
  const [x, y, z, w, i, j, k] = pose ?? [];
  [["x", x], ["y", y], ["z", z]].forEach(([name, value]) => set(name, value));
  if (!pose) {
    ["rx", "ry", "rz"].forEach((name) => set(name, undefined));
    return;
  }
  const degrees = 180 / Math.PI;
  set("rx", degrees * Math.atan2(2 * (w * i + j * k), 1 - 2 * (i * i + j * j)));
  set("ry", degrees * Math.asin(Math.max(-1, Math.min(1, 2 * (w * j - k * i)))));
  set("rz", degrees * Math.atan2(2 * (w * k + i * j), 1 - 2 * (j * j + k * k)));
}

/** Shows the list of tissues in the picture; null hides it. */
export function legend(tissues, seen) {
  const list = byId("legend");
  const shown = seen ? tissues.filter(({ number }) => seen[number]) : [];
  const key = shown.map(({ number }) => number).join();
  list.hidden = shown.length === 0;
  if (list.dataset.key === key) return;
  list.dataset.key = key;
  list.replaceChildren(
    ...shown.map(({ name, colour }) => {
      const item = document.createElement("li");
      const swatch = document.createElement("i");
      swatch.style.backgroundColor = `rgb(${colour.join(" ")})`;
      item.append(swatch, name.replaceAll("_", " "));
      return item;
    }),
  );
}
