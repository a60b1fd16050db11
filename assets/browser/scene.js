// 3-D view: the scene with the live probe and its fan, next to the picture.

import { letGo, letGoAfterPointer, spoken } from "./accessibility.js";
import { SceneGl } from "./scene_gl.js";
import { SceneLayers } from "./scene_layers.js";

const byId = (id) => document.getElementById(id);
const add = (a, b, k = 1) => a.map((v, i) => v + k * b[i]);
const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
/** Pause after drawing a live frame, as a multiple of its drawing time. The picture takes precedence if WebGL runs on the CPU. */
const REST = 3;
const AXES = [[1, 0, 0], [0, 1, 0], [0, 0, 1]];
/** Rotation by an arrow key, degrees; shift with Shift, parts of the view's height; zoom by plus and minus. */
const KEY_TURN_DEG = 5;
const KEY_WAY = 0.05;
const KEY_ZOOM = 1.2;

/** Decodes the answer to `/scene`; src/sink/browser/scene.rs has its layout. */
export function decodeScene(buffer) {
  const view = new DataView(buffer);
  if (buffer.byteLength < 12 || view.getUint32(0) !== 0x494e5356) throw new Error("not a scene of insonify");
  if (view.getUint32(4, true) !== 3) throw new Error("the page is of another version than the station: reload it");
  const length = view.getUint32(8, true);
  const header = JSON.parse(new TextDecoder().decode(new Uint8Array(buffer, 12, length)));
  let at = 12 + length;
  const surfaces = header.surfaces.map((surface) => {
    const positions = new Float32Array(buffer, at, 3 * surface.vertices);
    const indices = new Uint32Array(buffer, at + 12 * surface.vertices, 3 * surface.triangles);
    at += 12 * (surface.vertices + surface.triangles);
    return { ...surface, positions, indices };
  });
  if (at !== buffer.byteLength) throw new Error("a scene of the wrong length");
  return { ...header, surfaces };
}

/** Columns of the rotation of a unit quaternion w, x, y, z. */
function columns([w, x, y, z]) {
  return [
    [1 - 2 * (y * y + z * z), 2 * (x * y + w * z), 2 * (x * z - w * y)],
    [2 * (x * y - w * z), 1 - 2 * (x * x + z * z), 2 * (y * z + w * x)],
    [2 * (x * z + w * y), 2 * (y * z - w * x), 1 - 2 * (x * x + y * y)],
  ];
}

/** Position and axes of a pose; null without one. */
function placement(pose) {
  if (!pose) return null;
  const [x, y, z, ...quaternion] = pose;
  return { shift: [x, y, z], columns: columns(quaternion) };
}

export class Scene3d {
  /** `say(text)` shows an error. */
  constructor(say) {
    this.say = say;
    this.panel = byId("scene");
    this.canvas = byId("scene_canvas");
    this.gl = undefined;
    this.scene = null;
    this.frame = null;
    this.startOver();
    this.layers = new SceneLayers(() => this.redraw());
    this.queued = false;
    this.resting = null;
    this.listen();
  }

  /** Resets the view. */
  startOver() {
    [this.azimuth, this.elevation, this.zoom, this.pan] = [35, 20, 1, [0, 0]];
  }

  get isOpen() {
    return !this.panel.hidden;
  }

  async toggle() {
    const open = !this.isOpen;
    this.panel.hidden = !open;
    byId("scene_toggle").setAttribute("aria-pressed", String(open));
    if (!open) return;
    this.gl ??= SceneGl.open(this.canvas);
    byId("scene_none").hidden = Boolean(this.gl);
    if (this.gl && !this.scene) await this.fetch();
    this.redraw();
  }

  /** Forgets the scene, because a restarted station may have another. */
  forget() {
    this.scene = null;
    if (this.isOpen && this.gl) this.fetch();
  }

  async fetch() {
    try {
      const answer = await fetch("/scene", { cache: "no-store" });
      if (!answer.ok) throw new Error((await answer.text()).trim());
      this.load(decodeScene(await answer.arrayBuffer()));
    } catch (error) {
      this.say(`no 3-D view: ${error.message}`, true);
    }
  }

  load(scene) {
    this.scene = scene;
    this.gl.load(scene.surfaces);
    const bodies = scene.surfaces.filter(({ tool }) => !tool);
    let [low, high] = [[Infinity, Infinity, Infinity], [-Infinity, -Infinity, -Infinity]];
    for (const { positions } of bodies) {
      for (let i = 0; i < positions.length; i++) {
        low[i % 3] = Math.min(low[i % 3], positions[i]);
        high[i % 3] = Math.max(high[i % 3], positions[i]);
      }
    }
    this.centre = add(low, high).map((v) => v / 2);
    this.reach = undefined;
    this.radius = Math.max(Math.hypot(...add(high, low, -1)) / 2, 1);
    this.surfaces = scene.surfaces.map(({ colour, layer, part, tissue, tool }) => ({
      colour: colour.map((v) => v / 255), layer, part, tissue, tool,
    }));
    this.panel.dataset.surfaces = String(bodies.length);
    this.layers.load(scene.layers, bodies);
    this.redraw();
  }

  /** Shows the newest frame: pose and image of the probe. */
  show(frame) {
    this.frame = frame;
    if (this.isOpen && !this.resting) this.redraw();
  }

  redraw() {
    if (this.queued) return;
    this.queued = true;
    requestAnimationFrame(() => {
      this.queued = false;
      if (!this.isOpen || !this.gl || !this.scene) return;
      this.draw();
      this.rest(this.frame);
    });
  }

  /** Delays newer frames until this one is drawn and the pause is over. A change by the user is drawn at once. */
  rest(drawn) {
    const start = performance.now();
    const isDone = this.gl.fence();
    const rest = {};
    this.resting = rest;
    const end = () => {
      if (this.resting !== rest) return;
      this.resting = null;
      if (this.frame !== drawn) this.redraw();
    };
    const poll = () => (isDone() ? setTimeout(end, REST * (performance.now() - start)) : setTimeout(poll, 4));
    setTimeout(poll, 0);
  }

  pose() {
    return placement(this.frame?.pose);
  }

  /** Axes of the view: right, up and forward. They move with the probe if the view follows it. */
  basis(pose) {
    const views = { anatomical: [AXES[2], AXES[1]], lps: [[0, -1, 0], AXES[2]] };
    let [back, up] = views[this.scene.axes] ?? [AXES[1], [0, 0, -1]];
    if (byId("scene_follow").checked && pose) [back, up] = [pose.columns[1], pose.columns[2].map((v) => -v)];
    const [a, e] = [this.azimuth, this.elevation].map((degrees) => (degrees * Math.PI) / 180);
    const side = cross(up, back);
    const level = add(back.map((v) => v * Math.cos(a)), side, Math.sin(a));
    const toward = add(level.map((v) => v * Math.cos(e)), up, Math.sin(e));
    const above = add(up.map((v) => v * Math.cos(e)), level, -Math.sin(e));
    return { right: cross(above, toward), up: above, forward: toward.map((v) => -v) };
  }

  draw() {
    const ratio = window.devicePixelRatio || 1;
    const [width, height] = [this.canvas.clientWidth, this.canvas.clientHeight].map((v) => Math.max(Math.round(v * ratio), 1));
    if (this.canvas.width !== width || this.canvas.height !== height) Object.assign(this.canvas, { width, height });
    const pose = this.pose();
    const { right, up, forward } = this.basis(pose);
    const depth = this.frame?.settings.depth_mm ?? 100;
    const follow = byId("scene_follow").checked && pose;
    const middle = follow ? add(pose.shift, pose.columns[2], depth / 2) : this.centre;
    // The first fan fits into the view, and the scale stays.
    if (pose) this.reach ??= Math.max(...[-45, depth].map((z) => Math.hypot(...add(add(pose.shift, pose.columns[2], z), this.centre, -1))));
    const reach = (follow ? 0.75 * depth : Math.max(this.radius, this.reach ?? 0)) / this.zoom;
    const target = add(add(middle, right, this.pan[0]), up, this.pan[1]);
    const [x, y] = width > height ? [reach * width / height, reach] : [reach, reach * height / width];
    const far = 2 * this.radius + 2 * depth + Math.hypot(...add(middle, this.centre, -1));
    if (this.frame && pose) {
      this.gl.setFan(this.scene.probe, this.frame);
      this.gl.setImage(this.frame);
    }
    const needle = placement(this.frame?.needle?.pose);
    const placed = Object.fromEntries(Object.entries({ probe: pose, needle }).filter(([, at]) => at)
      .map(([tool, { shift, columns: turn }]) => [tool, { shift, turn: turn.flat() }]));
    const looks = this.surfaces.map((surface) => ({ ...surface, opacity: this.layers.opacity(surface) }));
    this.gl.draw({ right, up, forward, target, half: [x, y, far] }, looks, placed, this.cut(pose, forward), byId("scene_image").checked);
    this.panel.dataset.drawn = String(Number(this.panel.dataset.drawn ?? 0) + 1);
  }

  /** Plane of the cut, with its normal towards the viewer. */
  cut(pose, forward) {
    const kind = byId("scene_cut").value;
    const slider = byId("scene_cut_place");
    slider.parentElement.hidden = !["x", "y", "z"].includes(kind);
    let normal = null;
    let offset = 0;
    if (kind === "fan" && pose) {
      normal = pose.columns[1];
      offset = dot(normal, pose.shift);
    } else if (kind !== "none" && kind !== "fan") {
      const axis = "xyz".indexOf(kind);
      normal = AXES[axis];
      offset = this.centre[axis] + (this.radius * Number(slider.value)) / 100;
      slider.previousElementSibling.textContent = `${offset.toFixed(0)} mm`;
      slider.setAttribute("aria-valuetext", spoken(offset.toFixed(0), "mm"));
    }
    if (!normal) return null;
    const sign = dot(normal, forward) > 0 ? -1 : 1;
    return [...normal.map((v) => sign * v), sign * offset];
  }

  /** Rotates the view to the right and down, degrees. */
  turn(right, down) {
    this.azimuth = (this.azimuth - right) % 360;
    this.elevation = Math.min(Math.max(this.elevation + down, -89), 89);
    this.panel.dataset.azimuth = this.azimuth.toFixed(1);
    this.redraw();
  }

  /** Moves the scene to the right and down, parts of the view's height. */
  move(right, down) {
    const scale = (2 * (this.radius ?? 1)) / this.zoom;
    this.pan = [this.pan[0] - right * scale, this.pan[1] + down * scale];
    this.redraw();
  }

  magnify(by) {
    this.zoom = Math.min(Math.max(this.zoom * by, 0.2), 30);
    this.redraw();
  }

  /** Handles a key while the view has the focus. */
  pressed(event) {
    if (event.ctrlKey || event.metaKey || event.altKey) return;
    const way = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] }[event.key];
    if (way && event.shiftKey) this.move(KEY_WAY * way[0], KEY_WAY * way[1]);
    else if (way) this.turn(KEY_TURN_DEG * way[0], KEY_TURN_DEG * way[1]);
    else if (event.key === "+") this.magnify(KEY_ZOOM);
    else if (event.key === "-") this.magnify(1 / KEY_ZOOM);
    else if (event.key === "Home") {
      this.startOver();
      this.redraw();
    } else return;
    event.preventDefault();
  }

  listen() {
    let last = null;
    this.canvas.addEventListener("pointerdown", (event) => {
      last = event;
      this.canvas.setPointerCapture(event.pointerId);
    });
    this.canvas.addEventListener("pointerup", () => { last = null; });
    this.canvas.addEventListener("pointermove", (event) => {
      if (!last || !this.scene) return;
      const [dx, dy] = [event.clientX - last.clientX, event.clientY - last.clientY];
      const height = Math.max(this.canvas.clientHeight, 1);
      if (event.shiftKey || event.buttons & 6) this.move(dx / height, dy / height);
      else this.turn(0.5 * dx, 0.5 * dy);
      last = event;
    });
    this.canvas.addEventListener("keydown", (event) => this.pressed(event));
    this.canvas.addEventListener("contextmenu", (event) => event.preventDefault());
    this.canvas.addEventListener("wheel", (event) => {
      event.preventDefault();
      this.magnify(Math.exp(-0.0015 * event.deltaY));
    }, { passive: false });
    this.canvas.addEventListener("dblclick", () => {
      this.startOver();
      this.redraw();
    });
    for (const id of ["scene_cut", "scene_cut_place", "scene_follow", "scene_image"]) {
      byId(id).addEventListener("input", (event) => {
        if (event.target.type !== "range") letGo(event.target);
        this.redraw();
      });
    }
    letGoAfterPointer(byId("scene_cut_place"));
    new ResizeObserver(() => this.redraw()).observe(this.canvas);
  }
}
