// Tools that the page has itself: calipers, texts, body mark, inversion, cine loop, clips.

import { Annotations } from "./annotations.js";
import { Calipers, CALIPERS_MAX, measure, pairs, recordedPoints, TOOLS } from "./calipers.js";
import { Cine } from "./cine.js";
import { Clip, download, fileName } from "./clip.js";
import { letGo, letGoAfterPointer, spoken } from "./accessibility.js";
import { Dragging } from "./dragging.js";
import { MarkList } from "./mark_list.js";
import { Outbox } from "./marking.js";
import { drawMarks, FONT } from "./marks.js";
import { drawNeedle } from "./needle.js";
import { tipEvents } from "./status.js";
import { drawPicture, fileSize, fromStage, toStage, View } from "./view.js";

const byId = (id) => document.getElementById(id);
/** Distance that an arrow key moves the cross, pixels of the picture; with Shift ten times as far. */
const CROSS_STEP = 2;
/** Longest pause in a clip of the loop, ms. Longer pauses, while the station was frozen, are cut to it. */
const STILL_MAX_MS = 1000;

/**
 * Whether two frozen frames show the same picture. Another viewer may unfreeze the picture and freeze it again
 * while this page gets no frame.
 */
const isSame = (a, b) => a.session === b.session && String(a.pose) === String(b.pose);

export class Console {
  /**
   * `page`: { picture, shown(), shownDate(), captions(settings), greys(settings), say(text, bad), redraw(),
   * showKept(kept, bitmap), isOpen(), send(message), freeze() }.
   */
  constructor(page) {
    this.page = page;
    this.view = new View();
    this.calipers = new Calipers();
    this.annotations = new Annotations();
    this.cine = new Cine();
    this.outbox = new Outbox(page);
    this.list = new MarkList(byId("mark_list"), {
      name: (caliper, name) => this.changed(Object.assign(caliper, { name })),
      remove: (mark) => this.remove([mark]),
    });
    this.clip = null;
    this.frozen = false;
    /** The frozen picture, one object for all frames that show it; null while the picture moves. */
    this.picture = null;
    /** Position of the cross that arrow keys move; null without a cross. */
    this.cross = null;
    this.stage = byId("stage");
    this.bind();
  }

  bind() {
    const { stage } = this;
    stage.addEventListener("click", (event) => this.clicked(event));
    stage.addEventListener("pointermove", (event) => {
      this.cross = null;
      if (!this.calipers.pending) return;
      this.calipers.move(this.pointAt(event), this.page.shown());
      this.page.redraw();
    });
    letGoAfterPointer(byId("cine_place"));
    this.dragging = new Dragging(this);
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
      body_mark_turn: () => this.turnBodyMark(15),
      marks_clear: () => this.clear(),
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
        letGo(event.currentTarget);
        action();
        // The keyboard then acts on the picture.
        if (["caliper", "annotate"].includes(id) && (this.calipers.tool || this.annotating)) stage.focus({ preventScroll: true });
      });
    }
    byId("needle_shown").addEventListener("change", (event) => {
      letGo(event.currentTarget);
      this.page.redraw();
    });
    byId("tip_shown").addEventListener("change", (event) => {
      letGo(event.currentTarget);
      tipEvents(this.page.shown());
    });
    // A switch with the focus would take the space bar, which freezes the picture.
    byId("clip_overlays").addEventListener("change", (event) => letGo(event.currentTarget));
  }

  rect(width = this.stage.clientWidth, height = this.stage.clientHeight) {
    const frame = this.page.shown();
    this.view.captions = this.page.captions(frame.settings);
    return this.view.fit(frame.width, frame.height, width, height);
  }

  /** Draws all marks over the picture. */
  drawOver(context, rect, frame) {
    if (byId("needle_shown").checked) drawNeedle(context, frame, rect);
    drawMarks(context, frame, rect, this.page.greys(frame.settings));
    this.annotations.draw(context, frame, rect, FONT);
    this.calipers.draw(context, frame, rect, FONT);
  }

  /** Draws the cross of the arrow keys, and updates the list of marks. */
  drawCross(context, rect) {
    const frame = this.page.shown();
    const marked = [this.calipers.on(frame), this.annotations.on(frame)];
    this.list.show(...marked);
    // A finger drags marks; on a picture without marks it scrolls.
    this.stage.classList.toggle("marked", marked.flat().length > 0);
    if (!this.cross) return;
    const { x, y } = toStage(rect, this.cross);
    const size = 14 * rect.marks;
    context.strokeStyle = "#ffffff";
    context.lineWidth = rect.marks;
    context.strokeRect(x - size / 2, y - size / 2, size, size);
    context.beginPath();
    context.moveTo(x - size, y);
    context.lineTo(x + size, y);
    context.moveTo(x, y - size);
    context.lineTo(x, y + size);
    context.stroke();
  }

  get annotating() {
    return this.stage.classList.contains("annotating");
  }

  /** While a tool is selected, arrow keys move a cross and Enter sets a point there. Returns whether the key was used. */
  pointByKey(key, far) {
    const frame = this.page.shown();
    if (!frame || !(this.calipers.tool || this.annotating)) return false;
    const middle = { x: frame.width / 2, y: frame.height / 2 };
    const ways = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] };
    if (key === "Enter") {
      this.set(this.cross ?? middle);
      return true;
    }
    if (!ways[key]) return false;
    const [x, y] = ways[key].map((way) => way * CROSS_STEP * (far ? 10 : 1));
    const from = this.cross ?? middle;
    this.cross = {
      x: Math.min(Math.max(from.x + (this.view.flipX ? -x : x), 0), frame.width),
      y: Math.min(Math.max(from.y + (this.view.flipY ? -y : y), 0), frame.height),
    };
    this.calipers.move(this.cross, frame);
    this.page.redraw();
    return true;
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
    if (!this.dragging.tookClick()) this.set(this.pointAt(event));
  }

  /** Whether marks can be set, because the picture is frozen. A moving picture is frozen first. */
  standsStill() {
    // Without the station, the picture does not move.
    if (this.frozen || this.cine.isShown || !this.page.isOpen()) return true;
    this.page.freeze();
    this.page.say("the picture is frozen for the marks: they belong to it");
    return false;
  }

  /** Sets a point with the selected tool. */
  set(at) {
    const frame = this.page.shown();
    if (!(this.annotating || this.calipers.tool) || !this.standsStill()) return;
    if (this.annotating) {
      this.beginNote(at);
      return;
    }
    if (!this.calipers.pending && this.calipers.on(frame).length >= CALIPERS_MAX) {
      this.page.say(`a picture has at most ${CALIPERS_MAX} measurements: remove one first`, true);
      return;
    }
    const done = this.calipers.point(at, frame);
    if (done) this.changed(done);
    this.page.redraw();
  }

  /** Sends the state of a caliper or a text to the station. */
  changed(mark) {
    mark.id ??= this.outbox.newId();
    if (mark.tool) {
      const found = measure(mark);
      if (found.length_mm !== undefined) this.stage.dataset.lengthMm = found.length_mm.toFixed(2);
      this.stage.dataset.measured = JSON.stringify(found);
      const points_mm = pairs(recordedPoints(mark));
      this.outbox.set(mark.id, mark.picture, { kind: mark.tool, measure: mark.name, points_mm });
    } else {
      this.outbox.set(mark.id, mark.picture, { kind: "text", text: mark.text, at_mm: [mark.at.x, mark.at.z] });
    }
    this.page.redraw();
  }

  /** Removes calipers and texts. */
  remove(marks) {
    this.outbox.remove(marks);
    this.calipers.all = this.calipers.all.filter((caliper) => !marks.includes(caliper));
    this.annotations.texts = this.annotations.texts.filter((text) => !marks.includes(text));
    this.page.redraw();
  }

  /** Marks on the shown picture, in the order in which they were set. */
  marksShown() {
    const frame = this.page.shown();
    return frame ? [...this.calipers.on(frame), ...this.annotations.on(frame)] : [];
  }

  /** Discards an incomplete measurement, or else removes the last mark on the picture. */
  undo() {
    if (this.calipers.pending) {
      this.calipers.pending = null;
      this.page.redraw();
      return;
    }
    const number = ({ id }) => Number(id?.split("-")[1] ?? 0);
    const last = this.marksShown().sort((a, b) => number(a) - number(b)).at(-1);
    if (last) this.remove([last]);
  }

  nextTool() {
    this.stage.classList.remove("annotating");
    this.calipers.next();
    this.showTool();
    if (this.calipers.tool) this.standsStill();
  }

  putAway() {
    this.stage.classList.remove("annotating");
    this.calipers.pick(null);
    this.cross = null;
    this.showTool();
  }

  showTool() {
    const { tool } = this.calipers;
    const button = byId("caliper");
    button.firstChild.textContent = tool ? `${TOOLS[tool].label} ` : "Measure ";
    button.setAttribute("aria-pressed", String(Boolean(tool)));
    byId("annotate").setAttribute("aria-pressed", String(this.annotating));
    this.stage.classList.toggle("measuring", Boolean(tool));
    this.page.redraw();
  }

  /** Removes all marks on the shown picture. */
  clear() {
    this.calipers.pending = null;
    this.remove(this.marksShown());
  }

  annotate() {
    this.calipers.pick(null);
    this.stage.classList.toggle("annotating");
    this.showTool();
    if (this.annotating) this.standsStill();
  }

  beginNote(at) {
    const note = byId("note");
    const point = toStage(this.rect(), at);
    note.hidden = false;
    note.value = "";
    Object.assign(note.style, { left: `${point.x}px`, top: `${point.y}px` });
    // The text belongs to the picture on which it was begun.
    this.noteAt = at;
    this.noteOn = this.page.shown();
    note.focus();
  }

  endNote(keep) {
    const note = byId("note");
    if (note.hidden) return;
    note.hidden = true;
    const text = keep && this.noteOn ? this.annotations.add(this.noteAt, note.value, this.noteOn) : null;
    if (text) this.changed(text);
    this.page.redraw();
  }

  nextBodyMark() {
    this.annotations.nextMark();
    this.tellBodyMark();
  }

  turnBodyMark(degrees) {
    this.annotations.turnMark(degrees);
    this.tellBodyMark();
  }

  /**
   * Sends the body mark to the station. It stays while the picture moves. In the recording, each frozen picture has its own
   * body mark, and a moving picture the one that was chosen last.
   */
  tellBodyMark() {
    const { mark, turn } = this.annotations;
    const picture = this.page.shown()?.picture;
    this.page.redraw();
    if (!picture) return;
    const isLive = !this.frozen;
    const told = this.bodyMark?.picture;
    const stays = told && (told.key === picture.key || (isLive && this.bodyMark.isLive && told.session === picture.session));
    if (!stays) this.bodyMark = null;
    if (mark !== "none") {
      this.bodyMark = { id: this.bodyMark?.id ?? this.outbox.newId(), picture, isLive };
      this.outbox.set(this.bodyMark.id, picture, { kind: "body_mark", name: mark, turn_deg: turn });
    } else if (this.bodyMark) {
      this.outbox.remove([this.bodyMark]);
      this.bodyMark = null;
    }
  }

  invert(axis) {
    this.view[axis] = !this.view[axis];
    byId(axis === "flipX" ? "invert_x" : "invert_y").setAttribute("aria-pressed", String(this.view[axis]));
    this.page.redraw();
  }

  /** Adds a live picture that was just drawn to the cine loop, including its overlays. */
  keep(frame) {
    const frozen = Boolean(frame.settings.frozen);
    // A frozen picture is added once, as the last of the loop: marks are on this picture.
    const keeps = !frozen || !this.keptFrozen;
    const kept = keeps && this.cine.keep(this.page.picture.canvas, frame, performance.now());
    this.keptFrozen = frozen && (this.keptFrozen || kept);
    this.stage.dataset.kept = String(this.cine.kept.length);
  }

  /** The station's first message. */
  begin({ session, measures }) {
    this.outbox.begin(session);
    this.list.offer(measures);
  }

  /** Determines which picture a new frame shows, and shows or hides the bar of the cine loop. */
  follow(frame) {
    const bar = byId("cine");
    const frozen = Boolean(frame.settings.frozen);
    const { session } = this.outbox;
    const { number, pose } = frame;
    const own = { key: `${session} ${number}`, session, number, pose, sampledMs: frame.times.sampled };
    const stays = this.picture && isSame(this.picture, own);
    if (!stays) this.keptFrozen = false;
    this.picture = frozen ? (stays ? this.picture : own) : null;
    frame.picture = this.picture ?? own;
    // A tool is put away with the picture on which it measured.
    if (this.frozen && !frozen) this.putAway();
    this.frozen = frozen;
    if (!frozen) this.cine.live();
    const available = Boolean(frozen) && this.cine.kept.length > 1;
    if (bar.hidden === available) {
      bar.hidden = !available;
      this.view.foot = available ? bar.offsetHeight : 0;
      this.page.redraw();
    }
    if (!available) return;
    const slider = byId("cine_place");
    slider.max = this.cine.kept.length - 1;
    if (!this.cine.isShown) slider.value = slider.max;
    this.showPlace();
  }

  showPlace() {
    const { kept, at } = this.cine;
    const index = at ?? kept.length - 1;
    const before = (kept.at(-1).time - kept[index].time) / 1000;
    byId("cine_time").textContent = `−${before.toFixed(1)} s  ${index + 1}/${kept.length}`;
    const valueText = `picture ${index + 1} of ${kept.length}, ${spoken(before.toFixed(1), "s")} before the last`;
    byId("cine_place").setAttribute("aria-valuetext", valueText);
    this.stage.dataset.cine = String(index);
    this.stage.dataset.kept = String(kept.length);
  }

  step(by) {
    if (!this.saving) this.show(this.cine.step(by));
  }

  goTo(index) {
    if (!this.saving) this.show(this.cine.goTo(index));
  }

  async show(kept) {
    if (!kept) return;
    byId("cine_place").value = this.cine.at;
    this.showPlace();
    try {
      const bitmap = await Cine.pixels(kept);
      // If the user has stepped on meanwhile, the newest step is shown.
      if (this.cine.kept[this.cine.at] === kept) this.page.showKept(kept, bitmap);
      bitmap.close();
    } catch (error) {
      this.page.say(`the picture can't be shown: ${error.message}`, true);
    }
  }

  /** Size of a saved picture of `frame`. */
  fileSize({ width, height, settings }) {
    return fileSize(width, height, this.page.captions(settings));
  }

  /** Draws the picture at its own size, and its marks if `over`, into a canvas of `fileSize`. Returns the picture's rectangle. */
  compose(context, over) {
    const frame = this.page.shown();
    this.view.captions = this.page.captions(frame.settings);
    const rect = this.view.inFile(frame.width, frame.height);
    drawPicture(context, this.page.picture.canvas, rect);
    if (over) this.drawOver(context, rect, frame);
    return rect;
  }

  get withOverlays() {
    return byId("clip_overlays").checked;
  }

  /** Starts or ends a recording of the screen. */
  async record() {
    const frame = this.page.shown();
    if (!frame) return;
    const { clip } = this;
    try {
      this.clip = clip ? null : new Clip(...this.fileSize(frame));
      byId("record").setAttribute("aria-pressed", String(Boolean(this.clip)));
      if (clip) this.saveClip(await clip.end(), clip);
      else this.recordFrame();
    } catch (error) {
      this.page.say(`the clip can't be recorded: ${error.message}`, true);
    }
  }

  /** Adds the shown picture to the clip that is being recorded. */
  recordFrame() {
    if (!this.clip) return;
    this.clip.show((context) => this.compose(context, this.withOverlays));
    this.stage.dataset.recorded = String(this.clip.frames);
  }

  saveClip(blob, clip) {
    const name = fileName(this.page.shownDate(), this.page.shown().number, clip.extension);
    download(blob, name);
    this.stage.dataset.clip = `${name} ${clip.frames} ${blob.size}`;
    this.page.say(`${name}: ${clip.frames} pictures`);
  }

  /** Saves the cine loop as a clip, at the pace at which it was shown. */
  async saveLoop() {
    if (this.saving) return;
    const kept = [...this.cine.kept];
    if (!this.frozen || kept.length < 2) {
      this.page.say("freeze the picture first: the loop is saved from there");
      return;
    }
    this.saving = true;
    let clip = null;
    try {
      clip = new Clip(...this.fileSize(kept[0].frame));
      let due = performance.now();
      for (const [i, picture] of kept.entries()) {
        const bitmap = await Cine.pixels(picture);
        if (i > 0) due += Math.min(picture.time - kept[i - 1].time, STILL_MAX_MS);
        await new Promise((resolve) => setTimeout(resolve, Math.max(due - performance.now(), 0)));
        if (!this.frozen) throw new Error("the picture is live again");
        this.cine.goTo(i);
        this.showPlace();
        byId("cine_place").value = i;
        this.page.showKept(picture, bitmap);
        bitmap.close();
        clip.show((context) => this.compose(context, this.withOverlays));
        this.page.say(`saving the loop: ${i + 1} of ${kept.length}`);
      }
      this.saveClip(await clip.end(), clip);
    } catch (error) {
      clip?.end().catch(() => {});
      this.page.say(`the loop is not saved: ${error.message}`, true);
    } finally {
      this.saving = false;
    }
  }

  /** Data that is saved with a picture. */
  values(frame) {
    return { measurements: this.calipers.values(frame), ...this.annotations.values(frame) };
  }
}
