// The page of a live station: frames in, controls out.

import { Connection } from "./connection.js";
import { Controls, show } from "./controls.js";
import { fillHelp, listen } from "./keys.js";
import { drawMarks, fit, lengthMm } from "./marks.js";
import { Picture } from "./picture.js";
import { Scene3d } from "./scene.js";
import { legend, Status } from "./status.js";
import { MAP } from "./wire.js";

const byId = (id) => document.getElementById(id);
/** Without a new frame for so long a picture that is not frozen is no longer live. */
const SILENCE_MS = 2000;
const CALIPERS_MAX = 4;
const OVERLAYS = ["segmentation", "attenuation"];

const stage = byId("stage");
const picture = new Picture(byId("picture"));
const marks = byId("marks");
const status = new Status();
const scene = new Scene3d((text, bad) => status.notice(text, bad));
let tissues = [];
let shortcuts = [];
let shown = null;
let next = null;
let shownAt = 0;
let closedReason = "";
let calipers = [];
let pending = null;

const connection = new Connection({
  open() {
    closedReason = "";
    shownAt = performance.now();
    sendOverlays();
    watch();
  },
  closed(reason) {
    closedReason = reason;
    next = null;
    watch();
  },
  message(message) {
    if (message.type === "hello") {
      tissues = message.tissues;
      scene.forget();
      picture.setColours(tissues, message.attenuation_colours);
      controls.build(message);
      shortcuts = message.keys;
      fillHelp(byId("shortcuts").querySelector("tbody"), shortcuts);
      byId("version").textContent = `insonify ${message.version}`;
    } else if (message.type === "stats") {
      status.stats(message);
    } else if (message.type === "error") {
      status.notice(message.message, true);
    }
  },
  frame(frame) {
    // The newest wins here, too: one frame waits for the screen.
    if (!next) requestAnimationFrame(present);
    next = frame;
  },
  error(text) {
    status.notice(text, true);
  },
});

const controls = new Controls((message) => {
  if (connection.isOpen) connection.send(message);
  else status.notice("not connected: the station did not hear that", true);
});

function present() {
  const frame = next;
  next = null;
  if (!frame) return;
  if (shown && (frame.pixelMm !== shown.pixelMm || frame.width !== shown.width)) clearCalipers();
  const resized = !shown || frame.width !== shown.width || frame.height !== shown.height;
  shown = frame;
  shownAt = performance.now();
  controls.follow(frame.settings);
  status.frame(frame, shownAt);
  status.notice(frame.notice);
  if (resized) layOut();
  redraw();
  scene.show(frame);
  watch();
  connection.send({ type: "drawn", number: frame.number });
  document.body.dataset.frame = String(frame.number);
  stage.dataset.pixelMm = String(frame.pixelMm);
}

function redraw() {
  if (!shown) return;
  const overlay = (name, map) => {
    const data = byId(name).checked ? connection.mapOf(shown, map) : null;
    return data && { data, opacity: Number(byId(`${name}_opacity`).value) / 100 };
  };
  const segmentation = overlay("segmentation", MAP.SEGMENTATION);
  picture.draw(shown, { segmentation, attenuation: overlay("attenuation", MAP.ATTENUATION) });
  legend(tissues, segmentation ? picture.seen : null);
  redrawMarks();
}

function redrawMarks() {
  const ratio = window.devicePixelRatio || 1;
  const [width, height] = [stage.clientWidth, stage.clientHeight];
  if (marks.width !== Math.round(width * ratio) || marks.height !== Math.round(height * ratio)) {
    marks.width = Math.round(width * ratio);
    marks.height = Math.round(height * ratio);
  }
  const context = marks.getContext("2d");
  context.setTransform(ratio, 0, 0, ratio, 0, 0);
  context.clearRect(0, 0, width, height);
  if (!shown) return;
  const rect = fit(shown.width, shown.height, width, height);
  drawMarks(context, shown, rect, controls.captions(shown.settings), calipers, pending);
}

function layOut() {
  if (!shown) return;
  const rect = fit(shown.width, shown.height, stage.clientWidth, stage.clientHeight);
  Object.assign(picture.canvas.style, {
    left: `${rect.x}px`, top: `${rect.y}px`, width: `${rect.width}px`, height: `${rect.height}px`,
  });
  redrawMarks();
}

/** Says what the picture is worth now. */
function watch() {
  if (!connection.isOpen) {
    status.run("OFFLINE");
    status.banner("disconnected", closedReason);
    return;
  }
  const frozen = shown?.settings.frozen ?? false;
  const silent = performance.now() - shownAt > SILENCE_MS;
  status.run(!shown ? "WAITING" : frozen ? "FROZEN" : silent ? "STALLED" : "LIVE");
  if (!frozen && silent) status.banner("silent");
  else if (shown && ["lost", "stale", "stuck"].includes(shown.tracking)) status.banner(shown.tracking);
  else status.banner(null);
}

function sendOverlays() {
  const [segmentation, attenuation] = OVERLAYS.map((name) => byId(name).checked);
  connection.send({ type: "overlays", segmentation, attenuation });
}

function toggleOverlay(name) {
  byId(`${name}_opacity`).parentElement.hidden = !byId(name).checked;
  sendOverlays();
  redraw();
}

function clearCalipers() {
  calipers = [];
  pending = null;
}

function measuring(on) {
  byId("caliper").setAttribute("aria-pressed", String(on));
  stage.classList.toggle("measuring", on);
  if (!on) pending = null;
  redrawMarks();
}

function pointAt(event) {
  const rect = fit(shown.width, shown.height, stage.clientWidth, stage.clientHeight);
  const box = stage.getBoundingClientRect();
  const x = (event.clientX - box.left - rect.x) / rect.scale;
  const y = (event.clientY - box.top - rect.y) / rect.scale;
  return { x: Math.min(Math.max(x, 0), shown.width), y: Math.min(Math.max(y, 0), shown.height) };
}

stage.addEventListener("click", (event) => {
  if (!shown || !stage.classList.contains("measuring")) return;
  if (!pending) {
    pending = { points: [pointAt(event), pointAt(event)] };
  } else {
    pending.points[1] = pointAt(event);
    calipers = [...calipers, pending].slice(-CALIPERS_MAX);
    stage.dataset.lengthMm = lengthMm(shown, pending).toFixed(2);
    pending = null;
  }
  redrawMarks();
});

stage.addEventListener("pointermove", (event) => {
  if (!pending) return;
  pending.points[1] = pointAt(event);
  redrawMarks();
});

/** The picture with its marks at its own size, as a file. */
function save() {
  if (!shown) return;
  const canvas = document.createElement("canvas");
  const size = { width: shown.width + 108, height: shown.height + 74 };
  Object.assign(canvas, size);
  const context = canvas.getContext("2d");
  context.fillStyle = "#000";
  context.fillRect(0, 0, canvas.width, canvas.height);
  const rect = fit(shown.width, shown.height, canvas.width, canvas.height);
  context.drawImage(picture.canvas, rect.x, rect.y, rect.width, rect.height);
  drawMarks(context, shown, rect, controls.captions(shown.settings), calipers, null);
  const state = document.body.dataset.state;
  context.fillStyle = state === "live" ? "#7d8893" : "#ff6b5e";
  context.font = "13px sans-serif";
  context.fillText(`${new Date().toISOString()}   frame ${shown.number}   ${state}`, rect.x, 18);
  canvas.toBlob((blob) => {
    const link = document.createElement("a");
    link.href = URL.createObjectURL(blob);
    link.download = `insonify_${String(shown.number).padStart(6, "0")}.png`;
    link.click();
    setTimeout(() => URL.revokeObjectURL(link.href), 1000);
  }, "image/png");
}

function fullScreen() {
  const change = document.fullscreenElement ? document.exitFullscreen() : document.documentElement.requestFullscreen();
  change.catch((error) => status.notice(`full screen is not possible: ${error.message}`, true));
}

const toggleHelp = () => (byId("shortcuts").open ? byId("shortcuts").close() : byId("shortcuts").showModal());
const toggleMeasuring = () => measuring(!stage.classList.contains("measuring"));
const click = (id) => () => byId(id).click();

/** What the page does by itself, by the names of the station's keys. */
const pageActions = {
  segmentation: click("segmentation"),
  attenuation: click("attenuation"),
  caliper: toggleMeasuring,
  caliper_clear: () => {
    clearCalipers();
    redrawMarks();
  },
  scene: () => scene.toggle(),
  save,
};

listen(
  () => shortcuts,
  (action) => {
    if (action === "tgc_reset") controls.resetTgc();
    else if (action === "full_screen") fullScreen();
    else if (action === "help") toggleHelp();
    else if (action.step) controls.step(action.step.setting, action.step.by);
    else if (action.quality) controls.quality(action.quality.rays, action.quality.layers);
    else if (action.page) pageActions[action.page]();
  },
);

for (const name of OVERLAYS) {
  const opacity = byId(`${name}_opacity`);
  byId(name).addEventListener("change", () => toggleOverlay(name));
  opacity.addEventListener("input", () => {
    show(opacity, Number(opacity.value));
    redraw();
  });
  show(opacity, Number(opacity.value));
}
const unfocused = (action) => (event) => {
  event.currentTarget.blur();
  action();
};
byId("caliper").addEventListener("click", unfocused(toggleMeasuring));
byId("scene_toggle").addEventListener("click", unfocused(() => scene.toggle()));
byId("save").addEventListener("click", unfocused(save));
byId("help").addEventListener("click", unfocused(toggleHelp));
byId("full_screen").addEventListener("click", unfocused(fullScreen));
new ResizeObserver(layOut).observe(stage);
setInterval(() => {
  status.figures(performance.now());
  watch();
}, 250);
