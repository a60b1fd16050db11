"""A headless Chromium through ChromeDriver's WebDriver protocol, with nothing but Python's standard library."""

import base64
import json
import pathlib
import shutil
import subprocess
import tempfile
import time
import urllib.error
import urllib.request

ELEMENT = "element-6066-11e4-a52e-4f735466cecf"


def find(names):
    return next((path for path in map(shutil.which, names) if path), None)


def available():
    """Paths of browser and driver, or None."""
    browser = find(["chromium", "chromium-browser", "google-chrome"])
    driver = find(["chromedriver"])
    return (browser, driver) if browser and driver else None


class Browser:
    """One browser with one page."""

    def __init__(self, width=1600, height=950, downloads=None):
        browser, driver = available()
        self.profile = tempfile.TemporaryDirectory(prefix="insonify-chromium-", ignore_cleanup_errors=True)
        log = pathlib.Path(self.profile.name, "chromedriver.log").open("wb")
        self.driver = subprocess.Popen([driver, "--port=0"], stdout=subprocess.PIPE, stderr=log, text=True)
        port = None
        for line in self.driver.stdout:
            if "started successfully on port" in line:
                port = int(line.rsplit("port", 1)[1].strip(" .\n"))
                break
        if port is None:
            raise RuntimeError("chromedriver did not start")
        self.base = f"http://127.0.0.1:{port}"
        # WebGL in software, and the page composed as Chromium does without a GPU. With --use-angle=swiftshader the page is composed in
        # software OpenGL, too: a frame of 1600 x 950 takes 170 ms of processor time in place of 45.
        arguments = [
            "--headless", "--no-sandbox", "--enable-unsafe-swiftshader", "--disable-quic", "--no-first-run",
            "--disable-background-networking", "--disable-component-update", "--disable-sync",
            "--hide-scrollbars", f"--user-data-dir={self.profile.name}/profile", f"--window-size={width},{height}",
        ]
        # A picture and its measurements are two files.
        allowed = {"profile.default_content_setting_values.automatic_downloads": 1}
        preferences = {"download.default_directory": str(downloads), **allowed} if downloads else {}
        options = {"binary": browser, "args": arguments, "prefs": preferences}
        capabilities = {"alwaysMatch": {"goog:chromeOptions": options, "goog:loggingPrefs": {"browser": "ALL"}}}
        answer = self.call("POST", "/session", {"capabilities": capabilities})
        self.session = f"/session/{answer['sessionId']}"
        self.capabilities = answer["capabilities"]

    def call(self, method, path, body=None):
        data = json.dumps(body).encode() if body is not None else None
        request = urllib.request.Request(self.base + path, data, {"Content-Type": "application/json"}, method=method)
        try:
            with urllib.request.urlopen(request, timeout=60) as answer:
                return json.load(answer)["value"]
        except urllib.error.HTTPError as error:
            raise RuntimeError(f"{method} {path}: {error.read().decode()[:600]}") from None

    def post(self, path, body):
        return self.call("POST", self.session + path, body)

    def open(self, url):
        self.post("/url", {"url": url})

    def script(self, text, *arguments):
        return self.post("/execute/sync", {"script": text, "args": list(arguments)})

    def element(self, selector):
        return self.post("/element", {"using": "css selector", "value": selector})[ELEMENT]

    def click(self, selector):
        self.post(f"/element/{self.element(selector)}/click", {})

    def click_at(self, selector, x, y):
        """Clicks at (x, y) of the viewport's CSS pixels, relative to the element's upper left corner."""
        left, top = self.script("const b = document.querySelector(arguments[0]).getBoundingClientRect(); return [b.left, b.top]", selector)
        move = {"type": "pointerMove", "duration": 0, "x": int(left + x), "y": int(top + y)}
        steps = [move, {"type": "pointerDown", "button": 0}, {"type": "pointerUp", "button": 0}]
        self.post("/actions", {"actions": [{"type": "pointer", "id": "mouse", "parameters": {"pointerType": "mouse"}, "actions": steps}]})

    def drag(self, selector, x, y, dx, dy):
        """Drags from (x, y), relative to the element's upper left corner, by (dx, dy) CSS pixels."""
        left, top = self.script("const b = document.querySelector(arguments[0]).getBoundingClientRect(); return [b.left, b.top]", selector)
        move = lambda x, y: {"type": "pointerMove", "duration": 0, "x": int(left + x), "y": int(top + y)}  # noqa: E731
        steps = [move(x, y), {"type": "pointerDown", "button": 0}, move(x + dx, y + dy), {"type": "pointerUp", "button": 0}]
        self.post("/actions", {"actions": [{"type": "pointer", "id": "mouse", "parameters": {"pointerType": "mouse"}, "actions": steps}]})

    def computed(self, selector, what):
        """The role or label that the browser gives an element for assistive technology."""
        return self.call("GET", f"{self.session}/element/{self.element(selector)}/computed{what}")

    def size(self, width, height):
        """Sets the size of the page itself; windows may have a least one."""
        metrics = {"width": width, "height": height, "deviceScaleFactor": 1, "mobile": False}
        self.post("/goog/cdp/execute", {"cmd": "Emulation.setDeviceMetricsOverride", "params": metrics})

    def press(self, key):
        steps = [{"type": "keyDown", "value": key}, {"type": "keyUp", "value": key}]
        self.post("/actions", {"actions": [{"type": "key", "id": "keyboard", "actions": steps}]})

    def screenshot(self, path):
        png = base64.b64decode(self.call("GET", self.session + "/screenshot"))
        pathlib.Path(path).write_bytes(png)

    def log(self):
        """What the page wrote to its console since the last call, errors included."""
        return self.post("/se/log", {"type": "browser"})

    def wait(self, what, condition, seconds=60):
        """Waits until condition() is true, and returns it."""
        end = time.monotonic() + seconds
        while time.monotonic() < end:
            value = condition()
            if value:
                return value
            time.sleep(0.05)
        raise AssertionError(f"waited {seconds} s in vain for: {what}")

    def close(self):
        try:
            self.call("DELETE", self.session)
        finally:
            self.driver.terminate()
            self.driver.wait(10)
            self.driver.stdout.close()
            self.profile.cleanup()
