// The 3-D view: the scene with the live probe and its fan beside the picture.

import { SceneGl } from "./scene_gl.js";

const byId = (id) => document.getElementById(id);
const add = (a, b, k = 1) => a.map((v, i) => v + k * b[i]);
const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
/** Rest after a live frame of the view, in durations of its drawing: the picture comes first where WebGL runs on the CPU. */
const REST = 3;
const AXES = [[1, 0, 0], [0, 1, 0], [0, 0, 1]];

/** Reads what `/scene` answers; src/sink/browser/scene.rs has the layout. */
export function decodeScene(buffer) {
  const view = new DataView(buffer);
  if (buffer.byteLength < 12 || view.getUint32(0) !== 0x494e5356) throw new Error("not a scene of insonify");
  if (view.getUint32(4, true) !== 1) throw new Error("the page is of another version than the station: reload it");
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

export class Scene3d {
  /** `say(text)` shows an error. */
  constructor(say) {
    this.say = say;
    this.panel = byId("scene");
    this.canvas = byId("scene_canvas");
    this.gl = undefined;
    this.scene = null;
    this.frame = null;
    this.azimuth = 35;
    this.elevation = 20;
    this.zoom = 1;
    this.pan = [0, 0];
    this.queued = false;
    this.resting = null;
    this.listen();
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

  /** A station that was started again may hold another scene. */
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
    const bodies = scene.surfaces.slice(0, -2);
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
    this.looks = scene.surfaces.map((surface, i) => ({
      colour: surface.colour.map((v) => v / 255), opacity: surface.opacity, shown: true, probe: i >= bodies.length,
    }));
    this.panel.dataset.surfaces = String(bodies.length);
    this.list(bodies);
    this.redraw();
  }

  /** A switch a tissue. */
  list(bodies) {
    const list = byId("scene_tissues");
    list.replaceChildren();
    for (const tissue of [...new Set(bodies.map((s) => s.tissue))].sort()) {
      const label = document.createElement("label");
      const box = document.createElement("input");
      const swatch = document.createElement("i");
      box.type = "checkbox";
      box.checked = true;
      box.dataset.tissue = tissue;
      const [r, g, b] = bodies.find((s) => s.tissue === tissue).colour;
      swatch.style.background = `rgb(${r} ${g} ${b})`;
      label.append(box, swatch, tissue.replaceAll("_", " "));
      box.addEventListener("change", () => {
        box.blur();
        bodies.forEach((s, i) => { if (s.tissue === tissue) this.looks[i].shown = box.checked; });
        this.redraw();
      });
      list.append(label);
    }
  }

  /** The newest frame: where the probe is and what it sees. */
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

  /** Draws no newer frame until this one is done and the rest is over. A user's change is drawn at once. */
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
    if (!this.frame?.pose) return null;
    const [x, y, z, ...quaternion] = this.frame.pose;
    return { shift: [x, y, z], columns: columns(quaternion) };
  }

  /** Right, up and forward of the view; it rides on the probe while it follows. */
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
    // The first fan is within the picture, and the scale stays.
    if (pose) this.reach ??= Math.max(...[-45, depth].map((z) => Math.hypot(...add(add(pose.shift, pose.columns[2], z), this.centre, -1))));
    const reach = (follow ? 0.75 * depth : Math.max(this.radius, this.reach ?? 0)) / this.zoom;
    const target = add(add(middle, right, this.pan[0]), up, this.pan[1]);
    const [x, y] = width > height ? [reach * width / height, reach] : [reach, reach * height / width];
    const far = 2 * this.radius + 2 * depth + Math.hypot(...add(middle, this.centre, -1));
    if (this.frame && pose) {
      this.gl.setFan(this.scene.probe, this.frame);
      this.gl.setImage(this.frame);
    }
    const placed = pose && { shift: pose.shift, turn: pose.columns.flat() };
    this.gl.draw({ right, up, forward, target, half: [x, y, far] }, this.looks, placed, this.cut(pose, forward), byId("scene_image").checked);
    this.panel.dataset.drawn = String(Number(this.panel.dataset.drawn ?? 0) + 1);
  }

  /** Plane of the cut, its normal toward the viewer. */
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
    }
    if (!normal) return null;
    const sign = dot(normal, forward) > 0 ? -1 : 1;
    return [...normal.map((v) => sign * v), sign * offset];
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
      if (event.shiftKey || event.buttons & 6) {
        const scale = (2 * this.radius) / this.zoom / Math.max(this.canvas.clientHeight, 1);
        this.pan = [this.pan[0] - dx * scale, this.pan[1] + dy * scale];
      } else {
        this.azimuth = (this.azimuth - 0.5 * dx) % 360;
        this.elevation = Math.min(Math.max(this.elevation + 0.5 * dy, -89), 89);
      }
      last = event;
      this.panel.dataset.azimuth = this.azimuth.toFixed(1);
      this.redraw();
    });
    this.canvas.addEventListener("contextmenu", (event) => event.preventDefault());
    this.canvas.addEventListener("wheel", (event) => {
      event.preventDefault();
      this.zoom = Math.min(Math.max(this.zoom * Math.exp(-0.0015 * event.deltaY), 0.2), 30);
      this.redraw();
    }, { passive: false });
    this.canvas.addEventListener("dblclick", () => {
      [this.azimuth, this.elevation, this.zoom, this.pan] = [35, 20, 1, [0, 0]];
      this.redraw();
    });
    for (const id of ["scene_cut", "scene_cut_place", "scene_follow", "scene_image"]) {
      byId(id).addEventListener("input", (event) => {
        // The keys belong to the page again.
        if (event.target.type !== "range") event.target.blur();
        this.redraw();
      });
    }
    new ResizeObserver(() => this.redraw()).observe(this.canvas);
  }
}
