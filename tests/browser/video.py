#!/usr/bin/env python3
"""A video in a headless Chromium: it plays, has its size and duration, and can be sought in.

usage: video.py FILE WIDTH HEIGHT SECONDS
"""

import pathlib
import sys
import tempfile

sys.path.insert(0, str(pathlib.Path(__file__).parent))
import webdriver  # noqa: E402


def main():
    file, width, height, seconds = pathlib.Path(sys.argv[1]).resolve(), int(sys.argv[2]), int(sys.argv[3]), float(sys.argv[4])
    if not webdriver.available():
        print("chromium and chromedriver are not installed (Debian: chromium, chromium-driver)")
        return 77
    with tempfile.TemporaryDirectory(prefix="insonify-video-") as folder:
        html = pathlib.Path(folder, "video.html")
        html.write_text(f'<video id="video" muted src="{file.as_uri()}"></video>')
        page = webdriver.Browser()
        try:
            page.open(html.as_uri())
            page.wait("the video's data", lambda: page.script("return video.readyState") >= 2)
            found = page.script("return [video.videoWidth, video.videoHeight, video.duration]")
            assert found[:2] == [width, height] and abs(found[2] - seconds) < 0.05, found
            page.script("video.play()")
            page.wait("the picture to move", lambda: page.script("return video.currentTime") > 0.2)
            page.script(f"video.currentTime = {0.75 * seconds}")
            page.wait("the later place", lambda: page.script("return !video.seeking && video.currentTime") >= 0.75 * seconds)
            page.wait("the end", lambda: page.script("return video.ended"))
            assert page.script("return video.error") is None
        finally:
            page.close()
    print("ok  the video plays")
    return 0


if __name__ == "__main__":
    sys.exit(main())
