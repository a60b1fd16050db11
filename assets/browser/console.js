// The console's own tools on the page: calipers, texts, body mark, inversion, cine loop, clips.

import { Annotations } from "./annotations.js";
import { Calipers, measure, TOOLS } from "./calipers.js";
import { Cine } from "./cine.js";
import { Clip, download } from "./clip.js";
import { drawMarks, FONT } from "./marks.js";
import { drawPicture, fromStage, View } from "./view.js";

const byId = (id) => document.getElementById(id);

export class Console {
  /** `page`: { picture, shown(), captions(settings), greys(settings), say(text, bad), redraw() }. */
  constructor(page) {
    this.page = page;
    this.view = new View();
    this.calipers = new Calipers();
    this.annotations = new Annotations();
    this.cine = new Cine();
    this.clip = null;
    this.stage = byId("stage");
    this.bind();
  }

  bind() {
    const { stage } = this;
    stage.addEventListener("click", (event) => this.clicked(event));
    stage.addEventListener("pointermove", (event) => {
      if (!this.calipers.pending) return;
      this.calipers.move(this.pointAt(event));
      this.page.redraw();
    });
    byId("cine_place").addEventListener("input", (event) => this.goTo(Number(event.target.value)));
    byId("note").addEventListener("keydown", (event) => {
      if (event.key === "Enter") this.endNote(true);
      if (event.key === "Escape") this.endNote(false);
      event.stopPropagation();
    });
    byId("note").addEventListener("blur", () => this.endNote(true));
    const buttons = {
      caliper: () => this.nextTool(),
      annotate: () => this.annotate(),
      body_mark: () => this.nextBodyMark(),
      invert_x: () => this.invert("flipX"),
      invert_y: () => this.invert("flipY"),
      record: () => this.record(),
      cine_first: () => this.goTo(0),
      cine_back: () => this.step(-1),
      cine_next: () => this.step(1),
      cine_last: () => this.goTo(Infinity),
      cine_save: () => this.saveLoop(),
    };
    for (const [id, action] of Object.entries(buttons)) {
      byId(id).addEventListener("click", (event) => {
        event.currentTarget.blur();
        action();
      });
    }
  }

  rect(width = this.stage.clientWidth, height = this.stage.clientHeight) {
    const frame = this.page.shown();
    return this.view.fit(frame.width, frame.height, width, height);
  }

  /** Draws everything over the picture. */
  drawOver(context, rect, frame) {
    drawMarks(context, frame, rect, this.page.captions(frame.settings), this.page.greys(frame.settings));
    this.annotations.draw(context, rect, FONT);
    this.calipers.draw(context, frame, rect, FONT);
  }

  /** The pixel of the picture under a pointer. */
  pointAt(event) {
    const box = this.stage.getBoundingClientRect();
    const frame = this.page.shown();
    const at = fromStage(this.rect(), { x: event.clientX - box.left, y: event.clientY - box.top });
    return { x: Math.min(Math.max(at.x, 0), frame.width), y: Math.min(Math.max(at.y, 0), frame.height) };
  }

  clicked(event) {
    if (!this.page.shown() || event.target.closest("#cine, #note")) return;
    const at = this.pointAt(event);
    if (this.stage.classList.contains("annotating")) {
      this.beginNote(event, at);
      return;
    }
    if (!this.calipers.tool) return;
    const done = this.calipers.point(at);
    if (done) {
      const found = measure(this.page.shown(), done);
      if (found.length_mm !== undefined) this.stage.dataset.lengthMm = found.length_mm.toFixed(2);
      this.stage.dataset.measured = JSON.stringify(found);
    }
    this.page.redraw();
  }

  nextTool() {
    this.stage.classList.remove("annotating");
    this.calipers.next();
    this.showTool();
  }

  putAway() {
    this.stage.classList.remove("annotating");
    this.calipers.pick(null);
    this.showTool();
  }

  showTool() {
    const { tool } = this.calipers;
    const button = byId("caliper");
    button.firstChild.textContent = tool ? `${TOOLS[tool].label} ` : "Measure ";
    button.setAttribute("aria-pressed", String(Boolean(tool)));
    byId("annotate").setAttribute("aria-pressed", String(this.stage.classList.contains("annotating")));
    this.stage.classList.toggle("measuring", Boolean(tool));
    this.page.redraw();
  }

  clear() {
    this.calipers.clear();
    this.annotations.clear();
    this.page.redraw();
  }

  annotate() {
    this.calipers.pick(null);
    this.stage.classList.toggle("annotating");
    this.showTool();
  }

  beginNote(event, at) {
    const note = byId("note");
    const box = this.stage.getBoundingClientRect();
    note.hidden = false;
    note.value = "";
    Object.assign(note.style, { left: `${event.clientX - box.left}px`, top: `${event.clientY - box.top}px` });
    this.noteAt = at;
    note.focus();
  }

  endNote(keep) {
    const note = byId("note");
    if (note.hidden) return;
    note.hidden = true;
    if (keep) this.annotations.add(this.noteAt, note.value);
    this.page.redraw();
  }

  nextBodyMark() {
    this.annotations.nextMark();
    this.page.redraw();
  }

  turnBodyMark(degrees) {
    this.annotations.turnMark(degrees);
    this.page.redraw();
  }

  invert(axis) {
    this.view[axis] = !this.view[axis];
    byId(axis === "flipX" ? "invert_x" : "invert_y").setAttribute("aria-pressed", String(this.view[axis]));
    this.page.redraw();
  }

  /** Keeps a live picture that was just drawn, with the tissues or attenuation that are mixed in. */
  keep(frame) {
    if (!frame.settings.frozen) this.cine.keep(this.page.picture.canvas, frame, performance.now());
    this.stage.dataset.kept = String(this.cine.kept.length);
    if (this.clip) this.recordFrame();
  }

  /** Shows or hides the bar of the cine loop. */
  follow(frozen) {
    const bar = byId("cine");
    if (!frozen && this.cine.isShown) {
      this.cine.live();
      this.cine.clear();
    }
    const available = Boolean(frozen) && this.cine.kept.length > 1;
    if (bar.hidden === available) {
      bar.hidden = !available;
      this.view.foot = available ? bar.offsetHeight : 0;
      this.page.redraw();
    }
    if (!available) return;
    const place = byId("cine_place");
    place.max = this.cine.kept.length - 1;
    if (!this.cine.isShown) place.value = place.max;
    this.showPlace();
  }

  showPlace() {
    const { kept, at } = this.cine;
    const index = at ?? kept.length - 1;
    const before = (kept.at(-1).time - kept[index].time) / 1000;
    byId("cine_time").textContent = `−${before.toFixed(1)} s  ${index + 1}/${kept.length}`;
    this.stage.dataset.cine = String(index);
    this.stage.dataset.kept = String(kept.length);
  }

  step(by) {
    return this.show(this.cine.step(by));
  }

  goTo(index) {
    return this.show(this.cine.goTo(index));
  }

  async show(kept) {
    if (!kept) return false;
    byId("cine_place").value = this.cine.at;
    this.showPlace();
    const wanted = this.cine.at;
    const bitmap = await Cine.pixels(kept);
    // The newest step wins.
    if (this.cine.at === wanted) this.page.showKept(kept.frame, bitmap);
    return true;
  }

  /** Draws the picture, and what lies over it if `over`, into a canvas of any size. */
  compose(context, canvas, over) {
    const frame = this.page.shown();
    const { foot } = this.view;
    this.view.foot = 0;
    const rect = this.rect(canvas.width, canvas.height);
    this.view.foot = foot;
    drawPicture(context, this.page.picture.canvas, rect);
    if (over) this.drawOver(context, rect, frame);
    return rect;
  }

  get withOverlays() {
    return byId("clip_overlays").checked;
  }

  /** Begins or ends a recording of the screen. */
  async record() {
    if (this.clip) {
      const { clip } = this;
      this.clip = null;
      byId("record").setAttribute("aria-pressed", "false");
      const blob = await clip.end();
      this.saveClip(blob, clip);
      return;
    }
    try {
      const frame = this.page.shown();
      this.clip = new Clip(frame.width + 108, frame.height + 74);
      byId("record").setAttribute("aria-pressed", "true");
    } catch (error) {
      this.page.say(error.message, true);
    }
  }

  recordFrame() {
    this.clip.show((context, canvas) => this.compose(context, canvas, this.withOverlays));
  }

  saveClip(blob, clip) {
    const name = `insonify_${String(this.page.shown().number).padStart(6, "0")}.${clip.extension}`;
    download(blob, name);
    this.stage.dataset.clip = `${name} ${clip.frames} ${blob.size}`;
    this.page.say(`${name}: ${clip.frames} pictures`);
  }

  /** Saves the cine loop as a clip, at the pace at which it was seen. */
  async saveLoop() {
    const { kept } = this.cine;
    if (kept.length < 2 || this.saving) return;
    this.saving = true;
    try {
      const first = kept[0];
      const clip = new Clip(first.frame.width + 108, first.frame.height + 74);
      const begun = performance.now();
      for (const [i, picture] of kept.entries()) {
        const bitmap = await Cine.pixels(picture);
        const due = begun + picture.time - first.time;
        await new Promise((resolve) => setTimeout(resolve, Math.max(due - performance.now(), 0)));
        this.cine.at = i;
        this.showPlace();
        byId("cine_place").value = i;
        this.page.showKept(picture.frame, bitmap);
        clip.show((context, canvas) => this.compose(context, canvas, this.withOverlays));
        this.page.say(`saving the loop: ${i + 1} of ${kept.length}`);
      }
      this.saveClip(await clip.end(), clip);
    } catch (error) {
      this.page.say(error.message, true);
    } finally {
      this.saving = false;
    }
  }

  /** What is written beside a saved picture. */
  values(frame) {
    return { measurements: this.calipers.values(frame), ...this.annotations.values() };
  }
}
