#!/usr/bin/env python3
"""The native window under Xvfb, fed with rendered frames by examples/browser_demo.rs.

usage: window.py BROWSER_DEMO [--screenshot FILE.ppm]

Exit code 77: Xvfb or xdotool was not found, nothing was tested.
"""

import argparse
import os
import pathlib
import shutil
import struct
import subprocess
import sys
import tempfile
import time

ROOT = pathlib.Path(__file__).resolve().parents[2]
WARN, BAD = (245, 184, 61), (201, 48, 42)


class Display:
    """A virtual screen whose pixels lie in a file."""

    def __init__(self):
        self.folder = tempfile.TemporaryDirectory(prefix="insonify-xvfb-")
        read, write = os.pipe()
        command = ["Xvfb", "-displayfd", str(write), "-screen", "0", "1440x900x24", "-fbdir", self.folder.name, "-nolisten", "tcp"]
        self.process = subprocess.Popen(command, pass_fds=[write], stderr=subprocess.DEVNULL)
        os.close(write)
        with os.fdopen(read) as pipe:
            self.name = ":" + pipe.readline().strip()

    def pixels(self):
        """Width, height and BGRX rows (an XWD file, big-endian header)."""
        data = pathlib.Path(self.folder.name, "Xvfb_screen0").read_bytes()
        header = struct.unpack(">25I", data[:100])
        header_size, width, height, stride, colours = header[0], header[4], header[5], header[12], header[19]
        start = header_size + 12 * colours
        return width, height, [data[start + y * stride:start + y * stride + 4 * width] for y in range(height)]

    def colour(self, x, y):
        row = self.pixels()[2][y]
        return row[4 * x + 2], row[4 * x + 1], row[4 * x]

    def mean(self):
        """Mean green of the middle of the screen."""
        _, _, rows = self.pixels()
        values = [row[x] for row in rows[150:800:5] for x in range(4 * 400 + 1, 4 * 1000, 20)]
        return sum(values) / len(values)

    def save(self, path):
        width, height, rows = self.pixels()
        rgb = b"".join(bytes(value for x in range(0, 4 * width, 4) for value in (row[x + 2], row[x + 1], row[x])) for row in rows)
        pathlib.Path(path).write_bytes(b"P6\n%d %d\n255\n" % (width, height) + rgb)

    def key(self, name, ended=lambda: False):
        # Without a window manager nothing gives the window the focus.
        command = ["xdotool", "search", "--name", "^insonify$", "windowfocus", "key", name]
        # A window that xdotool found may be gone when it is sent to: one that was made anew, or of the search itself.
        for attempt in range(5):
            if subprocess.run(command, env={**os.environ, "DISPLAY": self.name}).returncode == 0:
                return
            # The key that ends the program: its window is gone before the key comes up.
            if ended():
                return
            time.sleep(0.2)
        raise AssertionError(f"xdotool could not send {name} to the window")

    def close(self):
        self.process.terminate()
        self.process.wait(10)
        self.folder.cleanup()


def wait(what, condition, seconds=30):
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        if condition():
            return
        time.sleep(0.1)
    raise AssertionError(f"waited {seconds} s in vain for: {what}")


def ended(program):
    try:
        program.wait(2)
    except subprocess.TimeoutExpired:
        return False
    return True


def without_display(program):
    environment = {k: v for k, v in os.environ.items() if k not in ("DISPLAY", "WAYLAND_DISPLAY", "WAYLAND_SOCKET")}
    command = [program, str(ROOT / "configs/sphere.toml"), "--port", "0", "--width", "320", "--window", "yes"]
    result = subprocess.run(command, env=environment, stdin=subprocess.DEVNULL, capture_output=True, text=True, timeout=60)
    assert result.returncode != 0 and "DISPLAY" in result.stderr and "panicked" not in result.stderr, result.stderr


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("program")
    parser.add_argument("--screenshot", type=pathlib.Path)
    arguments = parser.parse_args()
    if not (shutil.which("Xvfb") and shutil.which("xdotool")):
        print("skipped: Xvfb and xdotool are not installed (Debian: xvfb, xdotool)")
        return 77
    without_display(arguments.program)
    print("ok  without a display it says so", flush=True)
    display = Display()
    environment = {**os.environ, "DISPLAY": display.name}
    environment.pop("WAYLAND_DISPLAY", None)
    command = [arguments.program, str(ROOT / "configs/sphere.toml"), "--port", "0", "--width", "480", "--window", "yes"]
    demo = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.DEVNULL, text=True, env=environment)

    def say(line):
        demo.stdin.write(line + "\n")
        demo.stdin.flush()

    try:
        wait("a picture", lambda: display.mean() > 20)
        print("ok  frames arrive", flush=True)
        before = display.mean()
        for _ in range(15):
            display.key("Up")
        wait("a brighter picture", lambda: display.mean() > before + 10)
        print("ok  keys change the picture", flush=True)
        if arguments.screenshot:
            display.save(arguments.screenshot)
        for state in ("stuck", "stale"):
            say(f"tracking {state}")
            wait(f"the banner of {state}", lambda: display.colour(720, 227) == WARN)
            say("tracking good")
            wait("no banner", lambda: display.colour(720, 227) not in (WARN, BAD))
        say("tracking lost")
        wait("the banner", lambda: display.colour(720, 227) == BAD)
        say("tracking good")
        wait("no banner", lambda: display.colour(720, 227) not in (WARN, BAD))
        print("ok  states are unmistakable", flush=True)
        display.key("q", lambda: ended(demo))
        assert demo.wait(20) == 0
        print("ok  a key ends the session")
        return 0
    finally:
        demo.kill()
        demo.wait()
        demo.stdin.close()
        display.close()


if __name__ == "__main__":
    sys.exit(main())
