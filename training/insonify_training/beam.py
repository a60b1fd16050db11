"""Beam coordinates: resampling of pictures to scanlines x range cells, and back, as the station does it.

src/generator/beam_sampling.rs is its counterpart; tests/data/beam_grid.json holds both to the same values.
"""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

# Parts into which weights are divided.
PARTS = 256


@dataclass(frozen=True)
class BeamGrid:
    """Grid of a network in beam coordinates: rows are range cells, the first at the face; columns are scanlines."""

    scanlines: int
    # Length of a range cell.
    cell_mm: float

    @classmethod
    def parse(cls, text):
        """Grid of `SCANLINESxCELL_MM`; none of an empty text."""
        if not text:
            return None
        try:
            scanlines, cell_mm = text.split("x")
            return cls(int(scanlines), float(cell_mm))
        except ValueError:
            raise ValueError(f"`{text}`; it must be SCANLINESxCELL_MM, as 256x0.2") from None

    def __str__(self):
        return f"{self.scanlines}x{self.cell_mm:g}"

    def cells(self, depth_mm):
        """Range cells that cover a depth."""
        return max(1, int(np.ceil(depth_mm / self.cell_mm - 1e-6)))


@dataclass(frozen=True)
class Scan:
    """Place of the scanlines in pictures of a station; `scan` of dataset.json."""

    # Radius of the face; None if it is flat.
    radius_mm: float | None
    # Half of the lateral extent: radians, or mm of a flat face.
    half_extent: float
    depth_mm: float
    pixel_mm: float
    # (x, z) of the picture's upper left corner.
    corner_mm: tuple

    @classmethod
    def of(cls, values):
        """The scan of a dictionary from JSON."""
        keys = ("half_extent", "depth_mm", "pixel_mm")
        return cls(values.get("radius_mm"), *(float(values[key]) for key in keys), tuple(values["corner_mm"]))

    def pixel_at(self, fraction, depth_mm):
        """Fractional pixel (column, row) of places in the sector; the first pixel's centre is (0, 0)."""
        lateral = (2 * fraction - 1) * self.half_extent
        if self.radius_mm is None:
            x, z = lateral + 0 * depth_mm, depth_mm + 0 * lateral
        else:
            sag = -2 * self.radius_mm * np.sin(0.5 * lateral) ** 2
            x = self.radius_mm * np.sin(lateral) + depth_mm * np.sin(lateral)
            z = sag + depth_mm * np.cos(lateral)
        return [(at - corner) / self.pixel_mm - 0.5 for at, corner in zip((x, z), self.corner_mm)]

    def beam_at(self, column, row):
        """Fraction of the lateral extent and depth of pixels' centres, and whether they are in the sector."""
        x, z = (corner + (at + 0.5) * self.pixel_mm for at, corner in zip((column, row), self.corner_mm))
        if self.radius_mm is None:
            lateral, depth_mm = x, z
        else:
            lateral = np.arctan2(x, z + self.radius_mm)
            depth_mm = np.hypot(x, z + self.radius_mm) - self.radius_mm
        fraction = 0.5 * (lateral / self.half_extent + 1)
        inside = (fraction >= 0) & (fraction < 1) & (depth_mm >= 0) & (depth_mm < self.depth_mm)
        return fraction, depth_mm, inside


class Sampling:
    """Resampling of pictures of one geometry; `size` is their width and height."""

    def __init__(self, grid, scan, size):
        self.width, self.height = size
        self.shape = (grid.cells(scan.depth_mm), grid.scanlines)
        fraction = (np.arange(grid.scanlines) + 0.5) / grid.scanlines
        depth_mm = ((np.arange(self.shape[0]) + 0.5) * grid.cell_mm)[:, None]
        x, y = np.broadcast_arrays(*scan.pixel_at(fraction, depth_mm))
        left, top = (np.clip(np.floor(at), 0, side - 2).astype(np.int64) for at, side in ((x, self.width), (y, self.height)))
        x, y = np.clip(x - left, 0, 1), np.clip(y - top, 0, 1)
        shares = np.stack([(1 - x) * (1 - y), x * (1 - y), (1 - x) * y, x * y])
        offsets = [(0, 0), (1, 0), (0, 1), (1, 1)]
        inside = np.stack([scan.beam_at(left + right, top + below)[2] for right, below in offsets])
        shown = (shares * inside).sum(0)
        self.inside = (shown > 0) & (depth_mm < scan.depth_mm)
        weights = np.floor(PARTS * shares * inside / np.where(shown > 0, shown, 1) + 0.5).astype(np.int64)
        # The last of equals, as in the station.
        heaviest = 3 - np.argmax(weights[::-1], 0)
        np.put_along_axis(weights, heaviest[None], 0, 0)
        np.put_along_axis(weights, heaviest[None], (PARTS - weights.sum(0))[None], 0)
        self.weights = weights * self.inside
        first = top * self.width + left
        self.corners = np.stack([first + below * self.width + right for right, below in offsets])
        self.nearest = np.take_along_axis(self.corners, heaviest[None], 0)[0]
        row, column = np.mgrid[0 : self.height, 0 : self.width]
        fraction, depth_mm, self.mask = scan.beam_at(column, row)
        self.line, self.cell = fraction * grid.scanlines - 0.5, depth_mm / grid.cell_mm - 0.5

    def levels(self, picture):
        """Grey levels of a picture [height, width] on the grid, interpolated."""
        sum_ = sum(weight * picture.reshape(-1)[corner].astype(np.int64) for weight, corner in zip(self.weights, self.corners))
        return ((sum_ + PARTS // 2) // PARTS).astype(np.uint8)

    def map(self, picture):
        """A map [height, width] on the grid: the nearest pixel, 0 outside."""
        return np.where(self.inside, picture.reshape(-1)[self.nearest], 0).astype(picture.dtype)

    def picture(self, values):
        """Values [..., cells, scanlines] at the picture's pixels [..., height, width], interpolated; 0 outside the sector."""
        cells, lines = self.shape
        parts = [(np.clip(at, 0, count - 1) * PARTS + 0.5).astype(np.int64) for at, count in ((self.line, lines), (self.cell, cells))]
        (line, x), (cell, y) = ((part // PARTS, (part % PARTS / PARTS).astype(np.float32)) for part in parts)
        right, below = np.minimum(line + 1, lines - 1), np.minimum(cell + 1, cells - 1)
        upper = values[..., cell, line] * (1 - x) + values[..., cell, right] * x
        lower = values[..., below, line] * (1 - x) + values[..., below, right] * x
        return np.where(self.mask, upper * (1 - y) + lower * y, 0)

    def corrected(self, values, picture, kept):
        """`values` [cells, scanlines], grey levels, at the pixels of `picture` [height, width], of whose detail finer than the grid a share
        is kept. With the share 1, nothing is lost where a network changes nothing.
        """
        change = self.picture(values - kept * self.levels(picture).astype(np.float32))
        return np.where(self.mask, np.clip(kept * picture + change, 0, 255), 0)


@lru_cache(maxsize=16)
def sampling(grid, scan, size):
    """The sampling of a geometry, kept."""
    return Sampling(grid, scan, size)
