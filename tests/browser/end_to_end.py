#!/usr/bin/env python3
"""The live page in a headless Chromium, fed with rendered frames by examples/browser_demo.rs.

usage: end_to_end.py BROWSER_DEMO [--screenshot FILE]

Exit code 77: no chromium or chromedriver was found, nothing was tested.
"""

import argparse
import json
import pathlib
import re
import struct
import subprocess
import sys
import tempfile
import threading
import time

sys.path.insert(0, str(pathlib.Path(__file__).parent))
import webdriver  # noqa: E402

ROOT = pathlib.Path(__file__).resolve().parents[2]

# Grey statistics of the canvas: mean, a hash of the pixels, number of coloured ones.
LOOK = """
const canvas = document.getElementById("picture");
const pixels = canvas.getContext("2d").getImageData(0, 0, canvas.width, canvas.height).data;
let sum = 0, hash = 0, coloured = 0;
for (let i = 0; i < pixels.length; i += 4) {
  sum += pixels[i + 1];
  hash = (Math.imul(hash, 31) + pixels[i] + 7 * pixels[i + 1] + 13 * pixels[i + 2]) | 0;
  if (pixels[i] !== pixels[i + 1] || pixels[i + 1] !== pixels[i + 2]) coloured++;
}
return { mean: sum / (pixels.length / 4), hash, coloured, width: canvas.width,
         frame: Number(document.body.dataset.frame ?? -1) };
"""
SLIDE = """
const input = document.getElementById(arguments[0]);
input.value = arguments[1];
input.dispatchEvent(new Event("input", { bubbles: true }));
input.dispatchEvent(new Event("change", { bubbles: true }));
"""

# What the page shows, for a step that failed.
STATE = """
const text = (id) => document.getElementById(id)?.textContent;
return { run: text("run"), tracking: text("tracking"), notice: text("notice"), announced: text("announcer"),
         freeze: text("freeze"), tool: text("caliper"), focus: document.activeElement?.id, ...document.body.dataset,
         ...document.getElementById("stage")?.dataset };
"""

# As in a browser without MP4.
ONLY_WEBM = """
window.has_type ??= MediaRecorder.isTypeSupported;
MediaRecorder.isTypeSupported = (type) => type.includes("webm") && has_type.call(MediaRecorder, type);
"""

# Presses C, and says what the button of the freeze says then.
PRESS_C = """
document.body.dispatchEvent(new KeyboardEvent("keydown", { key: "c", code: "KeyC", bubbles: true, cancelable: true }));
return document.getElementById("freeze").getAttribute("aria-pressed");
"""

# Whether a mark is under a pointer at a pixel of the picture.
IS_GRABBED_AT = """
const b = picture.getBoundingClientRect();
const [x, y] = [b.x + (arguments[0] * b.width) / picture.width, b.y + (arguments[1] * b.height) / picture.height];
picture.dispatchEvent(new PointerEvent("pointermove", { clientX: x, clientY: y, bubbles: true }));
return stage.classList.contains("grabbing");
"""

# Keeps the page's connection: the next one that sends.
KEEP_SOCKET = """
const send = WebSocket.prototype.send;
WebSocket.prototype.send = function (data) {
  WebSocket.prototype.send = send;
  window.socket = this;
  return send.call(this, data);
};
"""

# Lets the picture move and freezes it again, as another watcher does, while the page gets no frame but the last one.
MOVE_UNSEEN = """
const freeze = (value) => socket.send(JSON.stringify({ type: "set", assignments: [{ key: "frozen", value }] }));
const receive = socket.onmessage;
let frames = 0, timer = 0;
socket.onmessage = ({ data }) => {
  if (typeof data === "string") return;
  socket.send(JSON.stringify({ type: "drawn", number: Number(new DataView(data).getBigUint64(8, true)) }));
  frames += 1;
  if (frames === 5) freeze(1);
  clearTimeout(timer);
  if (frames < 5) return;
  timer = setTimeout(() => {
    socket.onmessage = receive;
    receive({ data });
  }, 1000);
};
freeze(0);
"""

# The loop keeps no more live pictures; the frozen one, for which its bar is shown, is encoded once `encode()` is called.
ENCODE_LATER = """
const toBlob = HTMLCanvasElement.prototype.toBlob;
window.left_out = 0;
window.encode = null;
HTMLCanvasElement.prototype.toBlob = function (done, ...how) {
  if (document.getElementById("cine").hidden) {
    window.left_out += 1;
    done(null);
    return;
  }
  HTMLCanvasElement.prototype.toBlob = toBlob;
  toBlob.call(this, (blob) => { window.encode = () => done(blob); }, ...how);
};
"""

# Keeps the page's next recorder, and counts the bytes that it encodes.
WATCH_RECORDER = """
const start = MediaRecorder.prototype.start;
window.encoded_bytes = 0;
MediaRecorder.prototype.start = function (...given) {
  MediaRecorder.prototype.start = start;
  window.recorder = this;
  this.addEventListener("dataavailable", ({ data }) => { window.encoded_bytes += data.size; });
  return start.apply(this, given);
};
"""


class Station:
    """The demo as a child process."""

    def __init__(self, program, port=0):
        command = [program, str(ROOT / "configs/sphere.toml"), "--width", "480", "--port", str(port)]
        self.process = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
        first = self.process.stdout.readline().split()
        assert first[:1] == ["address"], f"the demo did not start: {first}"
        self.address = first[1]
        # Marks of the page, as a recording would have them: event and value.
        self.marks = []
        threading.Thread(target=self.listen, daemon=True).start()
        self.port = int(self.address.rsplit(":", 1)[1].strip("/"))

    def listen(self):
        for line in self.process.stdout:
            name, value = line.split(" ", 1)
            self.marks.append((name, json.loads(value)))

    def say(self, line):
        self.process.stdin.write(line + "\n")
        self.process.stdin.flush()

    def end(self):
        if self.process.poll() is None:
            self.say("quit")
        try:
            self.process.wait(20)
        finally:
            self.process.kill()
            self.process.stdin.close()


def text(page, selector):
    return page.script("return document.querySelector(arguments[0]).textContent", selector)


def visible(page, selector):
    return page.script("return document.querySelector(arguments[0]).checkVisibility()", selector)


def is_pressed(page, selector):
    return page.script("return document.querySelector(arguments[0]).getAttribute('aria-pressed')", selector) == "true"


def wait_for_freeze(page):
    """Waits until the picture is frozen, and the button says so: else the next space bar would freeze it once more."""
    page.wait("a frozen picture", lambda: text(page, "#run") == "FROZEN")
    page.wait("a button that lets it move again", lambda: is_pressed(page, "#freeze"))


def wait_for_frames(page):
    page.wait("a moving picture", lambda: text(page, "#run") == "LIVE" and not is_pressed(page, "#freeze"))


def frames_arrive_and_change(page):
    first = page.wait("a picture", lambda: (look := page.script(LOOK))["mean"] > 5 and look)
    assert first["width"] == 480, first
    page.wait("another picture", lambda: (look := page.script(LOOK))["frame"] > first["frame"] and look["hash"] != first["hash"])
    wait_for_frames(page)
    # Without a frame for two seconds they are empty.
    page.wait("the badges", lambda: text(page, "#tracking") == "TRACKING" and text(page, "#source") == "RAW")
    page.wait("no banner", lambda: not visible(page, "#banner"))


def sliders_change_the_picture(page):
    before = page.script(LOOK)["mean"]
    page.script(SLIDE, "gain_db", 20)
    page.wait("a brighter picture", lambda: page.script(LOOK)["mean"] > before + 10)
    page.wait("the gain in the frame's settings", lambda: text(page, "label:has(#gain_db) .value") == "20 dB")
    page.script(SLIDE, "gain_db", 0)
    page.wait("the picture as before", lambda: abs(page.script(LOOK)["mean"] - before) < 5)

    page.script(SLIDE, "tgc_sliders_db_7", -24)
    page.wait("a darker picture", lambda: page.script(LOOK)["mean"] < before - 2)
    page.press("t")
    page.wait("the picture as before", lambda: abs(page.script(LOOK)["mean"] - before) < 2)

    pixel = float(page.script("return stage.dataset.pixelMm"))
    for _ in range(3):
        page.press("\ue00f")  # Page Down
    page.wait("a deeper picture", lambda: float(page.script("return stage.dataset.pixelMm")) > 1.1 * pixel)
    page.wait("the depth", lambda: text(page, "label:has(#depth_mm) .value") == "18.0 cm")
    page.script(SLIDE, "depth_mm", 150)
    page.wait("the depth as before", lambda: float(page.script("return stage.dataset.pixelMm")) == pixel)

    page.click("#quality button:nth-child(2)")
    chosen = "return document.querySelector('#quality [aria-pressed=true]')?.dataset.rays"
    page.wait("the middle quality", lambda: page.script(chosen) == "4")
    page.press("1")
    page.wait("low quality", lambda: page.script(chosen) == "1")


def freeze_freezes(page):
    page.click("#freeze")
    wait_for_freeze(page)
    frozen = page.script(LOOK)
    # Overlays, too, are of the frozen frame; nothing is rendered for them.
    page.click("label.switch:has(#attenuation)")
    page.wait("an overlay on the frozen picture", lambda: page.script(LOOK)["coloured"] > 1000)
    page.click("label.switch:has(#attenuation)")
    page.wait("the frozen picture", lambda: page.script(LOOK)["coloured"] == 0)
    for _ in range(10):
        look = page.script(LOOK)
        assert (look["hash"], look["frame"]) == (frozen["hash"], frozen["frame"]), (look, frozen)
    assert text(page, "#run") == "FROZEN" and not visible(page, "#banner")
    measure(page)
    page.press(" ")
    wait_for_frames(page)
    page.wait("another picture", lambda: page.script(LOOK)["hash"] != frozen["hash"])


def measure(page):
    page.press("c")
    box = page.script("const b = document.getElementById('picture').getBoundingClientRect(); return [b.width, b.height]")
    page.click_at("#picture", int(0.5 * box[0]), int(0.3 * box[1]))
    page.click_at("#picture", int(0.5 * box[0]), int(0.6 * box[1]))
    pixel_mm = float(page.script("return stage.dataset.pixelMm"))
    expected = 0.3 * page.script("return picture.height") * pixel_mm
    found = float(page.wait("a length", lambda: page.script("return stage.dataset.lengthMm")))
    assert abs(found - expected) < 2, f"{found} mm, expected about {expected:.1f} mm"
    page.press("\ue017")  # Delete
    page.press("c")
    for place in [(0.3, 0.5), (0.6, 0.5), (0.45, 0.7)]:
        page.click_at("#picture", int(place[0] * box[0]), int(place[1] * box[1]))
    found = page.wait("an ellipse", lambda: page.script("return JSON.parse(stage.dataset.measured ?? '{}').axes_mm"))
    width_mm = 0.3 * page.script("return picture.width") * pixel_mm
    assert abs(found[0] - width_mm) < 2, (found, width_mm)
    page.press("c")
    for place in [(0.3, 0.3), (0.3, 0.6), (0.6, 0.6)]:
        page.click_at("#picture", int(place[0] * box[0]), int(place[1] * box[1]))
    found = page.wait("an angle", lambda: page.script("return JSON.parse(stage.dataset.measured ?? '{}').angle_deg"))
    assert abs(found - 90) < 2, found
    # A finger taps without moving there first.
    page.press("\ue017")  # Delete
    page.press("c")
    page.press("c")
    page.press("c")
    tap = """
const b = picture.getBoundingClientRect();
const at = { clientX: b.x + arguments[0] * b.width, clientY: b.y + arguments[1] * b.height, bubbles: true };
picture.dispatchEvent(new MouseEvent("click", at));"""
    for place in [(0.3, 0.5), (0.7, 0.5), (0.5, 0.7)]:
        page.script(tap, *place)
    found = page.script("return JSON.parse(stage.dataset.measured).axes_mm")
    expected = [0.4 * page.script("return picture.width") * pixel_mm, 0.4 * page.script("return picture.height") * pixel_mm]
    assert all(abs(a - b) < 2 for a, b in zip(found, expected)), (found, expected)
    # Without a pointer: the cross begins in the middle.
    page.press("\ue00c")  # Escape
    page.press("c")
    page.press("\ue007")  # Enter
    for _ in range(20):
        page.press("\ue014")  # right
    page.press("\ue007")
    found = page.script("return JSON.parse(stage.dataset.measured).length_mm")
    assert abs(found - 40 * pixel_mm) < 0.01, (found, pixel_mm)
    page.press("\ue017")  # Delete
    page.press("\ue00c")  # Escape
    assert page.script("return caliper.getAttribute('aria-pressed')") == "false"


def rows(page):
    return page.script("return [...document.querySelectorAll('#mark_list li span')].map((row) => row.textContent)")


def marks_belong_to_their_picture_and_are_recorded(page, station):
    station.marks.clear()
    page.script(KEEP_SOCKET)
    # A moving picture is frozen for a measurement. The button says so at once: the next space bar lets the picture move.
    assert page.script(PRESS_C) == "true"
    wait_for_freeze(page)
    page.wait("the loop's bar, which takes room", lambda: visible(page, "#cine"))
    width, height = page.script("const b = picture.getBoundingClientRect(); return [b.width, b.height]")
    pixel_mm = float(page.script("return stage.dataset.pixelMm"))
    mm = page.script("return picture.width") * pixel_mm / width
    ends = [(int(0.4 * width), int(0.4 * height)), (int(0.6 * width), int(0.4 * height))]
    for x, y in ends:
        page.click_at("#picture", x, y)
    page.wait("a row", lambda: len(rows(page)) == 1)
    length = lambda: float(page.script("return stage.dataset.lengthMm"))  # noqa: E731
    before = length()
    # The cross is dragged; no third point is set by it.
    page.drag("#picture", *ends[1], 50, 0)
    page.wait("a longer distance", lambda: abs(length() - before - 50 * mm) < 0.5)
    assert page.script("return document.querySelectorAll('#mark_list li').length") == 1
    page.script("const s = document.querySelector('#mark_list select'); s.value = 'BPD'; s.dispatchEvent(new Event('change'))")
    page.press("\ue00c")  # Escape
    page.press("x")
    page.click_at("#picture", int(0.5 * width), int(0.7 * height))
    page.script("note.value = 'four chambers'")
    page.press("\ue007")  # Enter
    page.press("\ue00c")
    page.press("b")
    page.wait("their events", lambda: len(station.marks) >= 5)
    assert [name for name, _ in station.marks] == ["caliper", "caliper", "caliper", "text", "body-mark"], station.marks
    set_first, dragged, named, written, turned = station.marks
    assert set_first[1]["id"] == dragged[1]["id"] == named[1]["id"] and written[1]["text"] == "four chambers"
    assert named[1]["measure"] == "BPD" and abs(named[1]["value"] - length()) < 0.01 and named[1]["unit"] == "mm", named
    (x1, z1), (x2, z2) = named[1]["points_mm"]
    assert abs(x2 - x1 - length()) < 0.1 and abs(z1 - z2) < 0.1 and 20 < z1 < 120 and x1 < 0 < x2, named
    assert len(named[1]["pose"]) == 7 and turned[1]["name"] == "abdomen"
    frames = {value["frame"] for _, value in station.marks}
    assert len(frames) == 1, frames
    # Deeper, the marks stay on the anatomy.
    listed = rows(page)
    assert len(listed) == 2 and abs(float(listed[0].split()[0]) - length()) < 0.06, listed
    page.script(SLIDE, "depth_mm", 170)
    page.wait("another depth", lambda: float(page.script("return stage.dataset.pixelMm")) != pixel_mm)
    assert rows(page) == listed, (rows(page), listed)
    # The end of the line lies at another pixel now: the picture's middle is half of 20 mm deeper.
    middle = page.script("return [picture.width / 2, picture.height / 2]")
    deeper_mm = float(page.script("return stage.dataset.pixelMm"))
    then = [middle[0] + x2 / pixel_mm, ends[1][1] * mm / pixel_mm]
    now = [middle[0] + x2 / deeper_mm, middle[1] + ((then[1] - middle[1]) * pixel_mm - 10) / deeper_mm]
    assert page.script(IS_GRABBED_AT, *now) and not page.script(IS_GRABBED_AT, *then), (then, now)
    page.script(SLIDE, "depth_mm", 150)
    page.wait("the depth as before", lambda: float(page.script("return stage.dataset.pixelMm")) == pixel_mm)
    # One of them is removed.
    page.click("#mark_list li:nth-child(2) button")
    page.wait("its removal", lambda: station.marks[-1] == ("mark-removed", {"id": written[1]["id"]}))
    assert len(rows(page)) == 1
    # Another watcher froze another picture: it has its own marks.
    page.script(MOVE_UNSEEN)
    page.wait("a picture without the first one's marks", lambda: rows(page) == [])
    assert text(page, "#run") == "FROZEN"
    page.press("c")
    page.press("\ue007")  # Enter
    page.press("\ue014")  # right
    page.press("\ue007")
    page.wait("a mark of its own", lambda: len(rows(page)) == 1 and station.marks[-1][1]["frame"] not in frames)
    # The picture moves again: its marks are hidden, and the tool is put away.
    assert is_pressed(page, "#caliper")
    page.press(" ")
    wait_for_frames(page)
    page.wait("a picture without marks", lambda: rows(page) == [])
    assert not is_pressed(page, "#caliper"), "the tool is put away"
    page.wait("some pictures", lambda: page.script("return Number(stage.dataset.kept)") > 3, 30)
    page.press("b")
    page.press("b")
    page.press("b")


def the_cine_loop_is_gone_through(page):
    page.wait("kept pictures", lambda: page.script("return Number(stage.dataset.kept)") > 8, 30)
    page.press("l")
    page.wait("a hint", lambda: "freeze the picture first" in text(page, "#notice"))
    assert page.script("return Number(stage.dataset.kept)") > 8
    page.script(ENCODE_LATER)
    page.wait("a picture that is not kept", lambda: page.script("return left_out") > 0)
    page.press(" ")
    wait_for_freeze(page)
    page.wait("the loop's bar", lambda: visible(page, "#cine"))
    page.wait("the frozen picture, encoded", lambda: page.script("return encode !== null"))
    before = page.script("return Number(stage.dataset.kept)")
    assert before > 5
    page.press("\ue012")  # left
    page.wait("an earlier picture", lambda: page.script("return stage.dataset.kept - stage.dataset.cine") == 2)
    # The frozen picture is the loop's last one, though the loop was gone through before it was encoded.
    page.script("encode()")
    page.press("\ue012")
    page.wait("one before it", lambda: page.script("return stage.dataset.kept - stage.dataset.cine") == 4)
    kept = page.script("return Number(stage.dataset.kept)")
    assert kept == before + 1, (kept, before)
    page.wait("the badge", lambda: text(page, "#run") == "CINE")
    before = page.script(LOOK)["hash"]
    page.press("\ue011")  # Home
    page.wait("the first one", lambda: page.script("return Number(stage.dataset.cine)") == 0)
    page.wait("another picture", lambda: page.script(LOOK)["hash"] != before)
    # Overlays are mixed into kept pictures already.
    page.press("s")
    assert page.script("return segmentation.disabled && !segmentation.checked")
    # What is gone through is recorded.
    # WebM gives its pictures as they are encoded, MP4 at the end.
    page.script(ONLY_WEBM)
    page.script(WATCH_RECORDER)
    page.press("r")
    recorded = "return Number(stage.dataset.recorded)"
    for _ in range(2):
        before = page.script(recorded)
        page.press("\ue014")  # right
        page.wait("the next picture in the clip", lambda before=before: page.script(recorded) > before)
    # Pictures that are not encoded yet are lost at the end.
    page.wait("encoded pictures", lambda: page.script("recorder.requestData(); return encoded_bytes") > 1000)
    page.press("r")
    clip = page.wait("a clip of it", lambda: page.script("return stage.dataset.clip"), 30).split()
    assert int(clip[1]) >= 3 and int(clip[2]) > 1000, clip
    page.script("delete stage.dataset.clip; MediaRecorder.isTypeSupported = has_type")
    # The loop lasts up to 20 s; its clip takes as long, and longer where the encoder is slower.
    page.press("l")
    clip = page.wait("the clip", lambda: page.script("return stage.dataset.clip"), 120).split()
    assert clip[0].endswith((".webm", ".mp4")) and int(clip[1]) == kept and int(clip[2]) > 1000, clip
    # A browser without MP4 makes WebM.
    page.script(ONLY_WEBM)
    page.script("delete stage.dataset.clip")
    page.press("l")
    clip = page.wait("the WebM", lambda: page.script("return stage.dataset.clip"), 120).split()
    assert clip[0].endswith(".webm") and int(clip[1]) == kept, clip
    page.press(" ")
    wait_for_frames(page)
    page.wait("no bar", lambda: not visible(page, "#cine"))


def the_picture_is_inverted(page):
    transform = "return getComputedStyle(picture).transform"
    page.press("i")
    page.wait("left and right", lambda: page.script(transform).startswith("matrix(-1, 0, 0, 1"))
    page.press("u")
    page.wait("up and down", lambda: page.script(transform).startswith("matrix(-1, 0, 0, -1"))
    page.press("i")
    page.press("u")
    page.wait("as before", lambda: page.script(transform) in ("none", "matrix(1, 0, 0, 1, 0, 0)"))


def looks_are_chosen(page):
    before = page.script(LOOK)["hash"]
    page.press("9")
    pressed = "return document.querySelector('[data-preset=detail]').getAttribute('aria-pressed')"
    page.wait("the look", lambda: page.script(pressed) == "true")
    page.wait("another picture", lambda: page.script(LOOK)["hash"] != before)
    page.press("7")
    page.wait("the lines as they are", lambda: text(page, "label:has(#grey_map) .value") == "linear")


def overlays_show_tissues(page):
    page.press("s")
    page.wait("colours", lambda: page.script(LOOK)["coloured"] > 10_000)
    page.wait("the legend", lambda: "amniotic fluid" in text(page, "#legend") and "liver" in text(page, "#legend"))


# Of the 3-D view: a hash, and how many pixels are lit, amber (the fan's outline) and grey (its image).
LOOK_3D = """
const from = document.getElementById("scene_canvas");
const canvas = document.createElement("canvas");
Object.assign(canvas, { width: from.width, height: from.height });
const context = canvas.getContext("2d");
context.drawImage(from, 0, 0);
const pixels = context.getImageData(0, 0, canvas.width, canvas.height).data;
let hash = 0, lit = 0, amber = 0, grey = 0;
for (let i = 0; i < pixels.length; i += 4) {
  const [r, g, b] = [pixels[i], pixels[i + 1], pixels[i + 2]];
  hash = (Math.imul(hash, 31) + r + 7 * g + 13 * b) | 0;
  if (r + g + b > 60) lit++;
  if (r > 220 && g > 170 && b < 120) amber++;
  if (r > 60 && Math.abs(r - g) < 4 && Math.abs(g - b) < 4) grey++;
}
return { hash, lit, amber, grey, drawn: Number(document.getElementById("scene").dataset.drawn ?? 0) };
"""


def the_layers_are_faded(page, before):
    """The view has the hash `before`, and has it again afterwards."""
    layer = "#scene_layer_list input[type={}]"
    page.click("#scene_layers summary")
    is_checked = "return document.querySelector(arguments[0]).checked"
    tissue = "#scene_tissues input"
    page.click(layer.format("checkbox"))
    page.wait("a layer less", lambda: page.script(LOOK_3D)["hash"] != before)
    # Boxes say what is seen. A tissue is shown with its layer.
    assert not page.script(is_checked, tissue)
    page.script("document.querySelector(arguments[0]).click()", tissue)
    page.wait("the layer again", lambda: page.script(LOOK_3D)["hash"] == before)
    assert page.script(is_checked, tissue) and page.script(is_checked, layer.format("checkbox"))
    opacity = page.script("return Number(document.querySelector(arguments[0]).value)", layer.format("range"))
    slide = """
const slider = document.querySelector(arguments[0]);
slider.value = arguments[1];
slider.dispatchEvent(new Event("input"));"""
    page.script(slide, layer.format("range"), 100 if opacity < 50 else 5)
    page.wait("another opacity", lambda: page.script(LOOK_3D)["hash"] != before)
    page.script(slide, layer.format("range"), opacity)
    page.wait("the opacity as before", lambda: page.script(LOOK_3D)["hash"] == before)
    # Keys turn the view that has the focus.
    page.script("document.getElementById('scene_canvas').focus()")
    gain = page.script("return gain_db.value")
    page.press("\ue014")  # right
    page.wait("another side", lambda: page.script("return scene.dataset.azimuth") == "30.0")
    page.press("\ue012")
    page.wait("the side as before", lambda: page.script(LOOK_3D)["hash"] == before)
    assert page.script("return gain_db.value") == gain
    page.script("document.activeElement.blur()")
    page.click("#scene_layers summary")


def the_scene_is_shown_beside_the_picture(page):
    assert not visible(page, "#scene")
    page.press("v")
    page.wait("the view", lambda: visible(page, "#scene") and page.script(LOOK_3D)["drawn"] > 0)
    assert not visible(page, "#scene_none") and page.script("return scene.dataset.surfaces") == "1"
    first = page.wait("surfaces and fan", lambda: (look := page.script(LOOK_3D))["amber"] > 200 and look)
    assert first["lit"] > 5000 and first["grey"] > 1000, first
    page.wait("the probe moves", lambda: page.script(LOOK_3D)["hash"] != first["hash"])
    page.press(" ")
    wait_for_freeze(page)
    still = page.script(LOOK_3D)
    # What a user changes is drawn at once, with the newest frame; so the view is still from here on.
    page.click("#scene_image")
    page.wait("a fan without image", lambda: page.script(LOOK_3D)["grey"] < 0.5 * still["grey"])
    page.click("#scene_list summary")
    before = page.script(LOOK_3D)["hash"]
    page.click("#scene_tissues input")
    page.wait("a tissue less", lambda: page.script(LOOK_3D)["hash"] != before)
    page.click("#scene_tissues input")
    page.wait("the tissue again", lambda: page.script(LOOK_3D)["hash"] == before)
    page.click("#scene_list summary")
    the_layers_are_faded(page, before)
    page.drag("#scene_canvas", 300, 300, 80, 30)
    page.wait("another side", lambda: page.script("return scene.dataset.azimuth") == "-5.0")
    # The view is drawn after its angle is known.
    before = page.wait("its picture", lambda: (look := page.script(LOOK_3D))["hash"] != before and look)["hash"]
    page.script("scene_cut.value = 'fan'; scene_cut.dispatchEvent(new Event('input'))")
    page.wait("the cut", lambda: page.script(LOOK_3D)["hash"] != before)
    page.script("scene_cut.value = 'none'; scene_cut.dispatchEvent(new Event('input'))")
    page.wait("the whole scene", lambda: page.script(LOOK_3D)["hash"] == before)
    page.click("#scene_follow")
    page.click("#scene_image")
    page.press(" ")
    wait_for_frames(page)
    page.press("v")
    page.wait("the picture alone", lambda: not visible(page, "#scene"))


# Inputs without a name, and sliders without a value in words.
INPUTS = """
const inputs = [...document.querySelectorAll("input, select, button, summary, [tabindex='0']")];
inputs.forEach((input, i) => { input.dataset.tested = String(i); });
return inputs.map(({ id, type, dataset }) => [dataset.tested, id, type ?? ""]);
"""
SPOKEN = re.compile(r"(minus )?\d+(\.\d+)? [a-z]+|linear|contrast|in the middle|[a-z ]+")


def screen_readers_are_told(page):
    """Names and roles are the browser's own, computed for assistive technology."""
    page.press("v")
    page.wait("the layers", lambda: page.script("return document.querySelectorAll('#scene_layer_list input').length") > 0)
    page.click("#scene_layers summary")
    page.press(" ")
    wait_for_freeze(page)
    page.wait("the loop's bar", lambda: visible(page, "#cine"))
    names = {}
    for number, name, kind in page.script(INPUTS):
        selector = f"[data-tested='{number}']"
        if not visible(page, selector):
            continue
        label, role = page.computed(selector, "label"), page.computed(selector, "role")
        assert label and role not in ("generic", "none"), (name, label, role)
        if kind == "range":
            assert not re.search(r"\d", label) or re.search(r" \d of 8$", label), (name, label)
            value = page.script("return document.querySelector(arguments[0]).getAttribute('aria-valuetext')", selector)
            assert value and SPOKEN.match(value) and not re.search(r"dB|cm|mm|%|·|\+", value), (name, value)
            assert label not in names, f"two sliders are called {label}"
            names[label] = value
    assert names["Depth"] == "15.0 centimetres" and names["Gain"] == "0 decibels", names
    assert names["TGC slider 8 of 8"] == "0 decibels at 15.0 centimetres", names
    assert names["Opacity of liver" if "Opacity of liver" in names else "Opacity of amniotic fluid"].endswith(" percent"), names
    # The shortcut isn't read as a part of the name.
    names = [page.computed(f"#{control}", "label").strip() for control in ("freeze", "segmentation")]
    assert names == ["Unfreeze", "Tissues"], names
    live = "return [...document.querySelectorAll('[aria-live], [role=status], [role=alert], [role=log], output')].map((e) => e.id)"
    assert page.script(live) == ["announcer"], page.script(live)
    page.wait("an announcement", lambda: "frozen" in text(page, "#announcer"))
    page.press(" ")
    wait_for_frames(page)
    # One of an earlier change, too, may have waited for its turn.
    page.wait("another announcement", lambda: (said := text(page, "#announcer")).endswith("live") and "frozen" not in said)
    page.click("#scene_layers summary")
    page.press("v")
    page.wait("the picture alone", lambda: not visible(page, "#scene"))


def keys_act_on_what_has_the_focus(page):
    value = "return Number(document.getElementById(arguments[0]).value)"
    focused = "return document.activeElement.id"
    page.script("document.getElementById('tgc_sliders_db_0').focus()")
    page.press("\ue004")  # Tab, as a keyboard's user comes to it
    assert page.script(focused) == "tgc_sliders_db_1"
    gain = page.script(value, "gain_db")
    for _ in range(3):
        page.press("\ue013")  # up
    assert page.script(value, "tgc_sliders_db_1") == 3 and page.script(focused) == "tgc_sliders_db_1"
    assert page.script(value, "gain_db") == gain, "the picture's gain stays"
    page.wait("the value in words", lambda: page.script("return document.activeElement.ariaValueText").startswith("3 decibels"))
    # Of a scanner's console, other keys work from everywhere.
    page.press("t")
    page.wait("the slider", lambda: page.script(value, "tgc_sliders_db_1") == 0)
    # A pointer leaves the arrows to the picture.
    page.script("document.activeElement.blur()")
    page.click("#tgc_sliders_db_3")
    page.press("t")
    page.press("\ue013")
    page.wait("gain", lambda: page.script(value, "gain_db") == gain + 1)
    page.press("\ue015")
    # A button that has the focus keeps it, and takes Enter.
    page.script("document.getElementById('save').focus()")
    page.press("\ue004")
    assert page.script(focused) == "annotate"
    page.press("\ue007")
    page.wait("the tool", lambda: is_pressed(page, "#annotate"))
    assert page.script(focused) == "stage"
    # A text freezes the picture.
    wait_for_freeze(page)
    page.press("\ue00c")  # Escape
    page.script("document.activeElement.blur()")
    page.press(" ")
    wait_for_frames(page)


# What a French keyboard sends for a key of the digit row, and a Russian one for a letter.
OTHER_KEYBOARD = """
const event = new KeyboardEvent("keydown", { key: arguments[0], code: arguments[1], bubbles: true, cancelable: true });
return !document.body.dispatchEvent(event);
"""


def other_keyboards_work(page):
    chosen = "return document.querySelector('#quality [aria-pressed=true]')?.dataset.rays"
    for key, code, rays in [("é", "Digit2", "4"), ("&", "Digit1", "1"), ("ě", "Digit2", "4"), ("1", "Numpad1", "1")]:
        assert page.script(OTHER_KEYBOARD, key, code), (key, code)
        page.wait(f"the quality of {code}", lambda rays=rays: page.script(chosen) == rays)
    # "-" and "_" lie on 6 and 8 of AZERTY.
    assert page.script(OTHER_KEYBOARD, "è", "Digit7")
    page.wait("the raw look", lambda: page.script("return document.querySelector('[data-preset=raw]').ariaPressed") == "true")
    harmonics = page.script("return harmonics.checked")
    assert page.script(OTHER_KEYBOARD, "т", "KeyN")
    page.wait("harmonics", lambda: page.script("return harmonics.checked") != harmonics)
    assert page.script(OTHER_KEYBOARD, "т", "KeyN")
    page.wait("as before", lambda: page.script("return harmonics.checked") == harmonics)


# Elements of the page that are wider than it, or outside, except in lists that scroll.
OUTSIDE = """
const width = document.documentElement.clientWidth;
const outside = [...document.body.querySelectorAll("*")].filter((element) => {
  const box = element.getBoundingClientRect();
  return element.checkVisibility() && !element.closest(".unseen") && box.width > 0 && (box.left < -0.5 || box.right > width + 0.5);
});
return [document.documentElement.scrollWidth, width, outside.map(({ tagName, id, className }) => `${tagName} ${id} ${className}`)];
"""
# Texts that are drawn on the stage: [text, left, right].
DRAWN = """
const drawn = [];
const fillText = CanvasRenderingContext2D.prototype.fillText;
CanvasRenderingContext2D.prototype.fillText = function (text, x, y) {
  const box = this.measureText(text);
  if (this.canvas.id === "marks") drawn.push([text, x - box.actualBoundingBoxLeft, x + box.actualBoundingBoxRight]);
  return fillText.call(this, text, x, y);
};
window.drawn_texts = drawn;
"""


def a_phone_shows_all_of_it(page, station):
    page.size(390, 844)
    page.wait("the narrow page", lambda: page.script("return stage.clientWidth") == 390)
    page.wait("the picture in it", lambda: page.script("return picture.getBoundingClientRect().right") < 390)
    wait_for_frames(page)
    page.script(DRAWN)
    drawn = page.wait("the caption", lambda: page.script("return drawn_texts.filter(([text]) => text.includes('Gain')).slice(-1)[0]"))
    texts = page.script("return drawn_texts.slice(-40)")
    width = page.script("return document.documentElement.clientWidth")
    assert width == 390, width
    assert all(left >= -0.5 and right <= width + 0.5 for _, left, right in texts), texts
    lines = {line for line, _, _ in texts if "·" in line}
    assert len(lines) >= 2 and drawn[0] in lines, lines
    station.say("tracking lost")
    page.wait("the banner", lambda: visible(page, "#banner") and "TRACKING LOST" in text(page, "#banner"))
    station.say("notice a text of the station that is longer than the screen of a phone is wide, and must not leave it")
    # The page's own texts come first.
    page.wait("the notice", lambda: visible(page, "#notice") and "a text of the station" in text(page, "#notice"))
    page.press("v")
    page.wait("the 3-D view", lambda: visible(page, "#scene"))
    scroll, width, outside = page.script(OUTSIDE)
    assert scroll <= width and not outside, (scroll, width, outside)
    station.say("tracking good")
    station.say("notice ")
    page.press("h")
    page.wait("the help", lambda: visible(page, "#shortcuts"))
    scroll, width, outside = page.script(OUTSIDE)
    assert scroll <= width and not outside, (scroll, width, outside)
    page.press("\ue00c")
    page.wait("no help", lambda: not visible(page, "#shortcuts"))
    page.press("v")
    page.wait("the picture alone", lambda: not visible(page, "#scene"))
    page.press(" ")
    wait_for_freeze(page)
    page.wait("the loop's bar", lambda: visible(page, "#cine"))
    scroll, width, outside = page.script(OUTSIDE)
    assert scroll <= width and not outside, (scroll, width, outside)
    page.press(" ")
    wait_for_frames(page)
    page.size(1600, 950)
    page.wait("the wide page", lambda: page.script("return stage.clientWidth") > 1000)
    page.wait("the picture in it", lambda: page.script("return picture.getBoundingClientRect().width") > 600)


def states_are_unmistakable(page, station):
    # Fractions of the picture's middle that a banner may not cover.
    covered = """
const [a, b] = ["picture", "banner"].map((id) => document.getElementById(id).getBoundingClientRect());
return b.bottom > a.top + 0.15 * a.height && b.top < a.bottom - 0.15 * a.height;"""
    for state, title in [("stuck", "STUCK"), ("stale", "STALE"), ("lost", "TRACKING LOST")]:
        station.say(f"tracking {state}")
        page.wait(title, lambda title=title: visible(page, "#banner") and title in text(page, "#banner"))
        assert not page.script(covered), state
        page.wait("its announcement", lambda title=title: title.lower() in text(page, "#announcer"))
    station.say("tracking good")
    page.wait("no banner", lambda: not visible(page, "#banner"))
    station.say("source held")
    page.wait("the source", lambda: text(page, "#source") == "HELD GENERATED")
    station.say("notice <b>one</b> thing")
    page.wait("the notice as text", lambda: text(page, "#notice") == "<b>one</b> thing")
    station.say("notice ")
    station.say("source raw")


def clips_have_a_duration(page, downloads):
    """Opens the saved clips; leaves the station's page."""
    clips = sorted(downloads.glob("insonify_*.webm")) + sorted(downloads.glob("insonify_*.mp4"))
    assert any(clip.suffix == ".webm" for clip in clips), clips
    for clip in clips:
        page.open(clip.as_uri())
        seconds = page.wait("its length", lambda: page.script("return String(document.querySelector('video')?.duration)") not in ("undefined", "NaN")
                            and page.script("return String(document.querySelector('video').duration)"))
        assert seconds != "Infinity" and 0 < float(seconds) < 60, (clip, seconds)


def pages_are_saved(page, downloads):
    page.press("c")
    wait_for_freeze(page)
    page.press("\ue007")  # Enter
    for _ in range(20):
        page.press("\ue014")  # right
    page.press("\ue007")
    page.press("c")  # an ellipse
    page.press("\ue007")
    for _ in range(20):
        page.press("\ue014")
    page.press("\ue007")
    for _ in range(5):
        page.press("\ue015")  # down
    page.press("\ue007")
    page.press("p")
    record = page.wait("the measurements", lambda: next(downloads.glob("insonify_*.json"), None))
    saved = json.loads(page.wait("their text", record.read_text))
    assert saved["pixel_mm"] > 0
    assert saved["state"] == "frozen", saved["state"]
    measured, ellipse = saved["measurements"]
    (x1, z1), (x2, z2) = measured["points_mm"]
    assert abs(measured["length_mm"] - (x2 - x1)) < 1e-6 and z1 == z2, measured
    assert abs(measured["points_px"][1][0] - measured["points_px"][0][0] - 40) < 1e-6, measured
    # Of an ellipse, both have the ends of both axes.
    left, right, below, above = ellipse["points_px"]
    assert len(ellipse["points_mm"]) == 4 and abs(right[0] - left[0] - 40) < 1e-6 and abs(below[1] - above[1] - 20) < 1e-6, ellipse
    size = page.script("return [picture.width, picture.height]")
    assert [saved["picture"]["width_px"], saved["picture"]["height_px"]] == size, (saved["picture"], size)
    file = page.wait("the file", lambda: next(downloads.glob("insonify_*.png"), None))
    content = page.wait("its bytes", lambda: file.read_bytes())
    assert content[:8] == b"\x89PNG\r\n\x1a\n"
    width, height = struct.unpack(">II", content[16:24])
    # The caption takes two lines at this width.
    assert (width, height) == (480 + 108, 346 + 74 + 16), (width, height)
    page.press(" ")
    wait_for_frames(page)


def comes_back_after_a_restart(page, station, program):
    page.log()
    port = station.port
    station.end()
    page.wait("the banner", lambda: visible(page, "#banner") and "NO CONNECTION" in text(page, "#banner"))
    assert text(page, "#run") == "OFFLINE"
    lit = "return [...document.querySelectorAll('.badge')].filter((b) => b.checkVisibility() && b.classList.length > 1).map((b) => b.id)"
    assert page.script(lit) == ["run"], page.script(lit)
    assert text(page, "#tracking") == "–" and text(page, "#source") == "–"
    page.wait("no figures", lambda: text(page, "#rate") == "–" and text(page, "#latency") == "–")
    old = page.script(LOOK)["hash"]
    station = Station(program, port)
    try:
        page.wait("frames of the new server", lambda: text(page, "#run") == "LIVE" and page.script(LOOK)["hash"] != old, 40)
        page.wait("the overlay, asked for again", lambda: page.script(LOOK)["coloured"] > 10_000)
        page.wait("no banner", lambda: not visible(page, "#banner"))
        page.wait("the badge", lambda: text(page, "#tracking") == "TRACKING")
    except BaseException:
        station.end()
        raise
    return station


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("program")
    parser.add_argument("--screenshot", type=pathlib.Path)
    arguments = parser.parse_args()
    if not webdriver.available():
        print("skipped: chromium and chromedriver are not installed (Debian: chromium, chromium-driver)")
        return 77
    downloads = tempfile.TemporaryDirectory(prefix="insonify-downloads-")
    station = Station(arguments.program)
    page, name = None, "the browser starts"
    began = time.monotonic()
    try:
        page = webdriver.Browser(downloads=downloads.name)
        page.open(station.address)
        steps = [
            ("frames arrive and change", lambda: frames_arrive_and_change(page)),
            ("sliders change the picture", lambda: sliders_change_the_picture(page)),
            ("freeze freezes", lambda: freeze_freezes(page)),
            ("marks belong to their picture and are recorded", lambda: marks_belong_to_their_picture_and_are_recorded(page, station)),
            ("the cine loop is gone through", lambda: the_cine_loop_is_gone_through(page)),
            ("the picture is inverted", lambda: the_picture_is_inverted(page)),
            ("looks are chosen", lambda: looks_are_chosen(page)),
            ("overlays show tissues", lambda: overlays_show_tissues(page)),
            ("the scene is shown beside the picture", lambda: the_scene_is_shown_beside_the_picture(page)),
            ("screen readers are told", lambda: screen_readers_are_told(page)),
            ("keys act on what has the focus", lambda: keys_act_on_what_has_the_focus(page)),
            ("other keyboards work", lambda: other_keyboards_work(page)),
            ("a phone shows all of it", lambda: a_phone_shows_all_of_it(page, station)),
            ("states are unmistakable", lambda: states_are_unmistakable(page, station)),
            ("the picture is saved", lambda: pages_are_saved(page, pathlib.Path(downloads.name))),
        ]
        for name, step in steps:
            step()
            print(f"ok  {name}, {time.monotonic() - began:.0f} s", flush=True)
        name = "no error of a script"
        errors = [entry for entry in page.log() if entry["level"] == "SEVERE"]
        assert not errors, errors
        name = "it comes back after a restart"
        station = comes_back_after_a_restart(page, station, arguments.program)
        print(f"ok  {name}", flush=True)
        if arguments.screenshot:
            page.screenshot(arguments.screenshot)
            print(f"ok  screenshot in {arguments.screenshot}")
        name = "clips have a duration"
        clips_have_a_duration(page, pathlib.Path(downloads.name))
        print(f"ok  {name}")
        return 0
    except Exception:
        print(f"failed after {time.monotonic() - began:.0f} s: {name}", file=sys.stderr)
        if page:
            page.screenshot("/tmp/insonify_browser_failure.png")
            print("the page when it failed: /tmp/insonify_browser_failure.png", file=sys.stderr)
            print(json.dumps(page.script(STATE)), file=sys.stderr)
        raise
    finally:
        if page:
            page.close()
        station.end()
        downloads.cleanup()


if __name__ == "__main__":
    sys.exit(main())
