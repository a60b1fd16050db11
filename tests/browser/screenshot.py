#!/usr/bin/env python3
"""A picture of the live page with its tissue overlay, as in docs/images/browser.png.

usage: INSONIFY_CACHE=DIR screenshot.py BROWSER_DEMO STATION.toml OUT.png
"""

import subprocess
import sys
import time

import webdriver


def main():
    program, station, out = sys.argv[1:]
    demo = subprocess.Popen([program, station, "--port", "0"], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
    page = webdriver.Browser(1600, 1093)
    try:
        page.open(demo.stdout.readline().split()[1])
        page.wait("frames", lambda: int(page.script("return document.body.dataset.frame ?? 0")) > 3, 120)
        page.press("s")
        # So long that the curve of latencies shows the station at work.
        time.sleep(15)
        page.wait("a live picture", lambda: page.script("return document.getElementById('banner').hidden"))
        page.screenshot(out)
    finally:
        page.close()
        demo.stdin.write("quit\n")
        demo.stdin.flush()
        demo.wait(20)


if __name__ == "__main__":
    main()
