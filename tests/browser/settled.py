"""Waiting until the figures on a live page are those of a settled session."""

import time

# Frames of the page's curve of latencies: all of them come from the settled session.
FRAMES = 240

FIGURES = """
const number = (id) => parseFloat(document.getElementById(id).textContent);
return { frame: Number(document.body.dataset.frame ?? 0), rate: number("rate"), p95_ms: number("latency_p95"),
         skipped: number("dropped") };
"""


class Settled:
    """Decides from samples of the page's figures. A session has settled if its newest frames came at the station's rate."""

    def __init__(self, rate_hz, frames=FRAMES, skipped_part=0.02):
        self.rate_hz = rate_hz
        self.frames = frames
        self.skipped_part = skipped_part
        self.first = None

    def add(self, figures):
        """Whether the session has settled with this sample."""
        # The page counts the frames of the last second, one less at times.
        keeps_rate = (figures["rate"] or 0) >= 0.85 * self.rate_hz
        first = self.first
        skipped = first is not None and figures["skipped"] - first["skipped"] > self.frames * self.skipped_part
        restarted = first is not None and figures["frame"] < first["frame"]
        if not keeps_rate or skipped or restarted:
            self.first = None
            return False
        if first is None:
            self.first = dict(figures)
            return False
        is_steady = figures["p95_ms"] is not None and figures["p95_ms"] <= 2000 / self.rate_hz
        return figures["frame"] - first["frame"] >= self.frames and is_steady


def wait(page, rate_hz, seconds=240, **bounds):
    """Waits until the session that the page shows has settled within the bounds of `Settled`; the error says what the page
    showed at last."""
    settled, seen = Settled(rate_hz, **bounds), {}

    def sample():
        time.sleep(0.5)
        seen.update(page.script(FIGURES))
        return settled.add(seen)

    try:
        page.wait("a settled session", sample, seconds)
    except AssertionError as error:
        raise AssertionError(
            f"{error}: the page shows {seen.get('rate')} of {rate_hz} frames/s, p95 {seen.get('p95_ms')} ms, "
            f"{seen.get('skipped')} skipped; is the machine busy?"
        ) from None
