// The page of a live station: frames in, controls out.

import { letGo, letGoAfterPointer } from "./accessibility.js";
import { Connection } from "./connection.js";
import { download, fileName } from "./clip.js";
import { Console } from "./console.js";
import { Controls, show } from "./controls.js";
import { fillHelp, listen } from "./keys.js";
import { Picture } from "./picture.js";
import { Scene3d } from "./scene.js";
import { legend, Status } from "./status.js";
import { MAP } from "./wire.js";

const byId = (id) => document.getElementById(id);
/** Time without a new frame after which a picture that is not frozen counts as not live, ms. */
const SILENCE_MS = 2000;
const OVERLAYS = ["segmentation", "attenuation"];

const stage = byId("stage");
const picture = new Picture(byId("picture"));
const marks = byId("marks");
const status = new Status();
const scene = new Scene3d((text, bad) => status.say(text, bad));
let tissues = [];
let shortcuts = [];
let shown = null;
let next = null;
/** Newest frame of the station; `shown` may be a frame of the cine loop instead. */
let newest = null;
/** Times at which the newest frame arrived and at which the shown frame was first shown, ms since the page began. */
let shownAt = 0;
let shownTime = 0;
let closedReason = "";
let greyMaps = [];

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
      greyMaps = message.grey_maps;
      picture.setColours(tissues, message.attenuation_colours);
      controls.build(message);
      tools.begin(message);
      shortcuts = message.keys;
      fillHelp(byId("shortcuts").querySelector("tbody"), shortcuts);
      byId("version").textContent = `insonify ${message.version}`;
    } else if (message.type === "stats") {
      status.stats(message);
    } else if (message.type === "error") {
      status.say(message.message, true);
    }
  },
  frame(frame) {
    // Only the newest frame waits for the screen; older ones are skipped.
    if (!next) requestAnimationFrame(present);
    next = frame;
  },
  error(text) {
    status.say(text, true);
  },
});

const controls = new Controls((message) => {
  if (connection.isOpen) connection.send(message);
  else status.say("not connected: the station did not hear that", true);
});

const tools = new Console({
  picture,
  shown: () => shown,
  shownDate: () => new Date(performance.timeOrigin + shownTime),
  captions: (settings) => controls.captions(settings),
  greys: (settings) => greyMaps[settings.grey_map] ?? null,
  say: (text, bad) => status.say(text, bad),
  redraw: layOut,
  showKept,
  isOpen: () => connection.isOpen,
  send: (message) => connection.send(message),
  freeze: () => controls.freeze(),
});

function present() {
  const frame = next;
  next = null;
  if (!frame) return;
  newest = frame;
  shownAt = performance.now();
  controls.follow(frame.settings);
  status.frame(frame, shownAt);
  status.notice(frame.notice);
  connection.send({ type: "drawn", number: frame.number });
  tools.follow(frame);
  document.body.dataset.frame = String(frame.number);
  // While the user steps through the cine loop, the station's frozen picture stays in the background.
  if (!tools.cine.isShown) {
    take(frame, shownAt);
    redraw();
    tools.keep(frame);
    scene.show(frame);
  }
  tools.recordFrame();
  watch();
}

/** Makes `frame` the frame that is shown. */
function take(frame, time) {
  const resized = !shown || frame.width !== shown.width || frame.height !== shown.height;
  shown = frame;
  shownTime = time;
  status.picture(frame);
  stage.dataset.pixelMm = String(frame.pixelMm);
  if (resized) layOut();
}

/** Shows a picture of the cine loop. */
function showKept({ frame, time }, bitmap) {
  take(frame, time);
  picture.show(bitmap);
  redrawMarks();
  tools.recordFrame();
}

function redraw() {
  if (!shown) return;
  // A picture of the cine loop already contains its overlays.
  if (tools.cine.isShown) {
    redrawMarks();
    return;
  }
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
  const rect = tools.rect(width, height);
  tools.drawOver(context, rect, shown);
  tools.drawCross(context, rect);
}

function layOut() {
  if (!shown) return;
  const rect = tools.rect();
  Object.assign(picture.canvas.style, {
    left: `${rect.x}px`, top: `${rect.y}px`, width: `${rect.width}px`, height: `${rect.height}px`,
    transform: tools.view.transform,
  });
  redrawMarks();
}

/** Fault of the tracker, as the station reports it; undefined if there is none. */
function trackerFault(frame) {
  const about = "tracker: ";
  return frame?.notice.startsWith(about) ? frame.notice.slice(about.length) : undefined;
}

/** Updates badges and banner: whether the picture can be trusted now. */
function watch() {
  if (!connection.isOpen) {
    status.run("OFFLINE");
    status.unknown();
    status.banner("disconnected", closedReason);
    return;
  }
  const frozen = newest?.settings.frozen ?? false;
  for (const name of OVERLAYS) byId(name).disabled = tools.cine.isShown;
  const silent = performance.now() - shownAt > SILENCE_MS;
  status.run(!shown ? "WAITING" : tools.cine.isShown ? "CINE" : frozen ? "FROZEN" : silent ? "STALLED" : "LIVE");
  if (!frozen && silent && shown) status.unknown();
  if (!frozen && silent) status.banner("silent");
  else if (shown && ["lost", "stale", "stuck"].includes(shown.tracking)) status.banner(shown.tracking, trackerFault(newest));
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

/** Saves the picture at its own size with its marks, and its measurements, as files. */
function save() {
  if (!shown) return;
  const canvas = document.createElement("canvas");
  const [width, height] = tools.fileSize(shown);
  Object.assign(canvas, { width, height });
  const context = canvas.getContext("2d");
  context.fillStyle = "#000";
  context.fillRect(0, 0, canvas.width, canvas.height);
  const rect = tools.compose(context, true);
  const state = tools.cine.isShown ? "cine" : shown.settings.frozen ? "frozen" : document.body.dataset.state;
  context.fillStyle = ["live", "frozen"].includes(state) ? "#7d8893" : "#ff6b5e";
  context.font = "13px sans-serif";
  context.textAlign = "left";
  const date = new Date(performance.timeOrigin + shownTime);
  context.fillText(`${date.toISOString()}   frame ${shown.number}   ${state}`, rect.x, 18);
  const [png, json] = ["png", "json"].map((extension) => fileName(date, shown.number, extension));
  const offer = (blob, name) => {
    try {
      download(blob, name);
    } catch (error) {
      status.say(error.message, true);
    }
  };
  const picturePlace = { x_px: rect.x, y_px: rect.y, width_px: rect.width, height_px: rect.height };
  canvas.toBlob((blob) => offer(blob, png), "image/png");
  const { number, pixelMm, pose, tracking, contact, settings } = shown;
  const record = {
    version: byId("version").textContent,
    picture_time: date.toISOString(),
    state,
    frame: number,
    pixel_mm: pixelMm,
    picture: picturePlace,
    pose,
    tracking,
    contact,
    inverted: { left_right: tools.view.flipX, up_down: tools.view.flipY },
    ...tools.values(shown),
    settings,
  };
  offer(new Blob([JSON.stringify(record, null, 2)], { type: "application/json" }), json);
}

function fullScreen() {
  const change = document.fullscreenElement ? document.exitFullscreen() : document.documentElement.requestFullscreen();
  change.catch((error) => status.say(`full screen is not possible: ${error.message}`, true));
}

const toggleHelp = () => (byId("shortcuts").open ? byId("shortcuts").close() : byId("shortcuts").showModal());
const click = (id) => () => byId(id).click();

/** Actions that the page performs itself, by their names in the station's list of keys. */
const pageActions = {
  segmentation: click("segmentation"),
  attenuation: click("attenuation"),
  caliper: () => tools.nextTool(),
  caliper_clear: () => tools.clear(),
  mark_undo: () => tools.undo(),
  put_away: () => tools.putAway(),
  annotate: () => tools.annotate(),
  body_mark: () => tools.nextBodyMark(),
  body_mark_turn: () => tools.turnBodyMark(15),
  invert_x: () => tools.invert("flipX"),
  invert_y: () => tools.invert("flipY"),
  record: () => tools.record(),
  save_loop: () => tools.saveLoop(),
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
    else if (action.preset) controls.preset(action.preset);
    else if (action.page) pageActions[action.page]();
  },
  // Arrow keys step through the cine loop while the picture is frozen.
  (key, shift) => {
    if (tools.pointByKey(key, shift)) return true;
    if (!newest?.settings.frozen) return false;
    if (tools.cine.kept.length < 2) return false;
    const steps = { ArrowLeft: -1, ArrowRight: 1, ArrowDown: -10, ArrowUp: 10 };
    if (key === "Home") tools.goTo(0);
    else if (key === "End") tools.goTo(Infinity);
    else if (steps[key]) tools.step(steps[key]);
    else return false;
    return true;
  },
);

/** Scroll distance that counts as a step, and distance so far, CSS pixels. */
const WHEEL_PX = 50;
let wheel = 0;

/** The wheel over the picture changes the depth, with Shift the gain, with Alt the focus. While the picture is frozen, it steps through the cine loop. */
stage.addEventListener(
  "wheel",
  (event) => {
    // With Ctrl, the wheel zooms the page.
    if (event.ctrlKey) return;
    event.preventDefault();
    // A trackpad sends many small steps instead of one.
    const way = event.deltaY || event.deltaX;
    wheel = Math.sign(way) === Math.sign(wheel) ? wheel + way : way;
    if (Math.abs(wheel) < (event.deltaMode === 0 ? WHEEL_PX : 1) || !shown) return;
    const by = Math.sign(wheel);
    wheel = 0;
    if (newest.settings.frozen && tools.cine.kept.length > 1) tools.step(by);
    else if (event.shiftKey) controls.step("gain_db", -by);
    else if (event.altKey) controls.step("focus_mm", 5 * by);
    else controls.step("depth_mm", 10 * by);
  },
  { passive: false },
);

for (const name of OVERLAYS) {
  const opacity = byId(`${name}_opacity`);
  letGoAfterPointer(opacity);
  byId(name).addEventListener("change", (event) => {
    letGo(event.currentTarget);
    toggleOverlay(name);
  });
  opacity.addEventListener("input", () => {
    show(opacity, Number(opacity.value));
    redraw();
  });
  show(opacity, Number(opacity.value));
}
const unfocused = (action) => (event) => {
  letGo(event.currentTarget);
  action();
};
byId("scene_toggle").addEventListener("click", unfocused(() => scene.toggle()));
byId("save").addEventListener("click", unfocused(save));
byId("help").addEventListener("click", unfocused(toggleHelp));
byId("full_screen").addEventListener("click", unfocused(fullScreen));
new ResizeObserver(layOut).observe(stage);
setInterval(() => {
  status.figures(performance.now());
  watch();
}, 250);
