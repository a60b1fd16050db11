"""Reader of the data sets written by `insonify dataset`, and of seeded crops.

A tuple is a `.npy` of uint8 [4, height, width]: LQ grey level, HQ grey level, class number, attenuation x 255 (or
its power `attenuation_power` of dataset.json). It is read through a memory map, so that a crop reads only its own
pages.
"""

import hashlib
import json
import os
import threading
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path

import numpy as np

from .beam import Scan, sampling

LQ, HQ, SEGMENTATION, ATTENUATION = range(4)
# Crop origins are drawn from a grid of this step, px, and shifted by less than it.
GRID_PX = 8


class DatasetError(Exception):
    """Fault of a data set; names the file."""


@dataclass(frozen=True)
class Row:
    """A row of the manifest, for one tuple."""

    index: int
    split: str
    exam: str
    file: str
    mask: str
    sha256: str
    # Width and height, px, or scanlines and range cells.
    size: tuple
    station: str = ""


def _parse_rows(path):
    lines = path.read_text(encoding="utf-8").splitlines()
    for number, line in enumerate(lines, 1):
        if not line.strip():
            continue
        try:
            row = json.loads(line)
        except json.JSONDecodeError as error:
            # A killed run leaves an incomplete line at the end.
            if number == len(lines):
                return
            raise DatasetError(f"{path}:{number}: no JSON: {error}") from None
        try:
            keys = {key: row[key] for key in ("index", "split", "file", "mask", "sha256")}
            yield Row(**keys, exam=json.dumps(row.get("exam")), size=tuple(row["size"]), station=row.get("station", ""))
        except (KeyError, TypeError) as error:
            raise DatasetError(f"{path}:{number}: {error!r} is missing or wrong") from None


@dataclass(frozen=True)
class Quality:
    """Rendering of frames: rays, elevational layers and steering angles."""

    rays: int
    layers: int
    angles: int

    def __str__(self):
        return f"{self.rays}x{self.layers}" + (f" of {self.angles} angles" if self.angles > 1 else "")

    @classmethod
    def parse(cls, text):
        """Quality of `RAYSxLAYERS` or `RAYSxLAYERSxANGLES`."""
        try:
            rays, layers, *angles = map(int, text.split("x"))
            (angles,) = angles or (1,)
        except ValueError:
            raise ValueError(f"`{text}`; it must be RAYSxLAYERS or RAYSxLAYERSxANGLES") from None
        return cls(rays, layers, angles)

    @classmethod
    def parse_list(cls, text):
        """Qualities of a text with commas between."""
        return tuple(cls.parse(one) for one in text.split(","))


class Dataset:
    """Rows of a data set, and its pictures; on a `grid` of beam coordinates, if one is given."""

    def __init__(self, directory, grid=None):
        self.directory = Path(directory)
        header = self.directory / "dataset.json"
        manifests = sorted(self.directory.glob("manifest*.jsonl"))
        if not header.is_file() or not manifests:
            raise DatasetError(f"{self.directory}: no data set: dataset.json and manifest*.jsonl must be there")
        try:
            described = json.loads(header.read_text(encoding="utf-8"))
        except ValueError as error:
            raise DatasetError(f"{header}: no JSON: {error}") from None
        if not isinstance(described, dict) or described.get("format") != 1:
            found = described.get("format") if isinstance(described, dict) else "none"
            raise DatasetError(f"{header}: format is {found}; this reads 1")
        if not isinstance(described.get("classes"), list):
            raise DatasetError(f"{header}: names no classes")
        self.classes = list(described["classes"])
        if not self.classes or self.classes[0] != "outside" or len(self.classes) > 256:
            raise DatasetError(f"{header}: classes must be at most 256 names, the first `outside`")
        # The byte is 255 x a^power of the attenuation a.
        self.attenuation_power = float(described.get("attenuation_power", 1.0))
        look = described.get("look", {})
        try:
            # Tuples have the low qualities in turn.
            self.lq = tuple(
                Quality(*map(int, pair), int(look.get("lq_angles", 1))) for pair in (described["lq"], *described.get("lq_more", ()))
            )
            self.hq = Quality(*map(int, described["hq"]), int(look.get("hq_angles", 1)))
        except (KeyError, TypeError, ValueError) as error:
            raise DatasetError(f"{header}: lq, hq or look is missing or wrong: {error!r}") from None
        rows = {}
        for path in manifests:
            for row in _parse_rows(path):
                if row.index in rows:
                    raise DatasetError(f"{path}: tuple {row.index} is in the manifests twice")
                rows[row.index] = row
        self.pictures = {index: rows[index] for index in sorted(rows)}
        self.grid = grid
        self.scans = self._scans(described, header) if grid else {}
        self.rows = [self._on_grid(row) if grid else row for row in self.pictures.values()]
        shared = {row.exam for row in self.split("train")} & {row.exam for row in self.split("test")}
        if shared:
            raise DatasetError(f"{self.directory}: exams in both train and test: {sorted(shared)[:3]}")

    def unlike(self, config):
        """Name, found and wanted qualities of the first of `lq` and `hq` that isn't the configuration's; None if both are.

        A text of the configuration that is no quality is a ValueError, which begins with its name.
        """
        for name, found in (("lq", self.lq), ("hq", (self.hq,))):
            try:
                wanted = Quality.parse_list(getattr(config, name))
            except ValueError as error:
                raise ValueError(f"{name} {error}") from None
            if found != wanted:
                return name, found, wanted
        return None

    def _scans(self, described, header):
        """Scan of each station, by its file."""
        try:
            return {station["file"]: Scan.of(station["scan"]) for station in described["stations"]}
        except (KeyError, TypeError, ValueError) as error:
            raise DatasetError(f"{header}: the scan of a station is missing or wrong ({error!r}): render the data set anew") from None

    def sampling(self, row):
        """Resampling of a row's pictures."""
        picture = self.pictures[row.index]
        if picture.station not in self.scans:
            raise DatasetError(f"{self.directory}: tuple {row.index} is of the station `{picture.station}`, which dataset.json lacks")
        return sampling(self.grid, self.scans[picture.station], picture.size)

    def _on_grid(self, row):
        """The row of a tuple in beam coordinates. Resampled tuples are kept beside the others."""
        cells, lines = self.sampling(row).shape
        folder = f"beam_{self.grid}"
        mask = f"{folder}/mask_{hashlib.sha256(row.station.encode()).hexdigest()[:8]}_{row.size[0]}x{row.size[1]}.npy"
        return replace(row, file=f"{folder}/{row.index:07}.{row.sha256[:12]}.npy", mask=mask, size=(lines, cells))

    def _resample(self, row):
        """Writes a tuple and its mask in beam coordinates, unless they are there."""
        path, mask = self.directory / row.file, self.directory / row.mask
        if path.exists() and mask.exists():
            return
        of, picture = self.sampling(row), self.pictures[row.index]
        planes = _open(self.directory / picture.file, (4, picture.size[1], picture.size[0]))
        levels, maps = [of.levels(planes[at]) for at in (LQ, HQ)], [of.map(planes[at]) for at in (SEGMENTATION, ATTENUATION)]
        path.parent.mkdir(exist_ok=True)
        for at, array in ((path, np.stack([*levels, *maps])), (mask, np.where(of.inside, 255, 0).astype(np.uint8))):
            part = at.with_suffix(f".{os.getpid()}.{threading.get_ident()}.part.npy")
            np.save(part, array)
            os.replace(part, at)

    def split(self, name):
        """Rows of `train` or `test`."""
        return [row for row in self.rows if row.split == name]

    def sha256(self, split="train"):
        """SHA-256 of the `sha256` of one split's rows, sorted, one per line: identifies the training data of a model."""
        lines = "".join(f"{digest}\n" for digest in sorted(row.sha256 for row in self.split(split)))
        return hashlib.sha256(lines.encode()).hexdigest()

    def planes(self, row):
        """Planes of a tuple, memory-mapped: uint8 [4, height, width]."""
        if self.grid:
            self._resample(row)
        return _open(self.directory / row.file, (4, row.size[1], row.size[0]))

    def picture(self, row):
        """Planes and mask of a tuple's pictures, whatever the coordinates: uint8 [4, height, width], [height, width]."""
        of = self.pictures[row.index]
        shape = (of.size[1], of.size[0])
        return _open(self.directory / of.file, (4, *shape)), _mask(self.directory / of.mask, shape)

    def mask(self, row):
        """255 inside the sector, 0 outside: uint8 [height, width]."""
        if self.grid:
            self._resample(row)
        return _mask(self.directory / row.mask, (row.size[1], row.size[0]))


def _open(path, shape):
    try:
        array = np.load(path, mmap_mode="r")
    except (OSError, ValueError) as error:
        raise DatasetError(f"{path}: {error}") from None
    if array.dtype != np.uint8 or array.shape != shape:
        raise DatasetError(f"{path}: {array.dtype} {array.shape}; it must be uint8 {shape}")
    return array


@lru_cache(maxsize=64)
def _mask(path, shape):
    return np.ascontiguousarray(_open(path, shape))


@lru_cache(maxsize=64)
def _origins(path, shape, crop, min_inside, border):
    """Origins [n, 2] (row, column) of crops with enough of the sector inside, on the grid.

    The picture has `border` pixels of outside on every side.
    """
    inside = np.pad(_mask(path, shape) > 0, border).astype(np.float64)
    table = np.pad(inside.cumsum(0).cumsum(1), ((1, 0), (1, 0)))
    rows, columns = np.subtract(inside.shape, crop)
    y, x = np.mgrid[0 : rows + 1 : GRID_PX, 0 : columns + 1 : GRID_PX]
    area = table[y + crop, x + crop] - table[y, x + crop] - table[y + crop, x] + table[y, x]
    enough = area >= min(min_inside * crop * crop, area.max())
    return np.stack([y[enough], x[enough]], axis=1)


@dataclass(frozen=True)
class Batch:
    """Crops: planes uint8 [n, 4, crop, crop] and mask uint8 [n, 1, crop, crop]."""

    planes: np.ndarray
    mask: np.ndarray


def _cut(picture, y, x, side):
    """`side` x `side` pixels of `picture` [..., h, w] from (y, x), 0 beyond the picture."""
    out = np.zeros((*picture.shape[:-2], side, side), dtype=picture.dtype)
    top, left = max(y, 0), max(x, 0)
    part = picture[..., top : max(y + side, 0), left : max(x + side, 0)]
    out[..., top - y : top - y + part.shape[-2], left - x : left - x + part.shape[-1]] = part
    return out


class Crops:
    """Square crops of one split. Batch `step` depends only on seed and step.

    Crops may extend up to `border` pixels beyond the picture, into the outside by which the station pads a field of
    view.
    """

    def __init__(self, dataset, split, crop, batch, seed, flip=True, min_inside=0.25, border=0):
        self.dataset, self.crop, self.batch, self.seed = dataset, crop, batch, seed
        self.flip, self.min_inside, self.border = flip, min_inside, border
        self.rows = dataset.split(split)
        if not self.rows:
            raise DatasetError(f"{dataset.directory}: no rows of split `{split}`")
        smallest = min(min(row.size) for row in self.rows)
        if crop > smallest:
            raise DatasetError(f"{dataset.directory}: a crop of {crop} px doesn't fit {smallest} px")

    def at(self, step):
        """Batch number `step`."""
        random = np.random.default_rng([self.seed, step])
        planes = np.empty((self.batch, 4, self.crop, self.crop), dtype=np.uint8)
        mask = np.empty((self.batch, 1, self.crop, self.crop), dtype=np.uint8)
        for i in range(self.batch):
            row = self.rows[random.integers(len(self.rows))]
            size = (row.size[1], row.size[0])
            # Resampled now, if it is in beam coordinates.
            self.dataset.mask(row)
            origins = _origins(self.dataset.directory / row.mask, size, self.crop, self.min_inside, self.border)
            origin = origins[random.integers(len(origins))] + random.integers(GRID_PX, size=2)
            y, x = np.minimum(origin, np.subtract(size, self.crop) + 2 * self.border) - self.border
            # Mirroring left and right swaps the ends of the fan: an equally valid frame of the mirrored body.
            mirror = np.s_[..., ::-1] if self.flip and random.random() < 0.5 else np.s_[...]
            planes[i] = _cut(self.dataset.planes(row), y, x, self.crop)[mirror]
            mask[i, 0] = _cut(self.dataset.mask(row), y, x, self.crop)[mirror]
        return Batch(planes, mask)

    def stream(self, start, end, threads=1, ahead=4):
        """Batches of the steps `start` to `end`, in order, prepared by threads."""
        with ThreadPoolExecutor(threads) as pool:
            waiting = [pool.submit(self.at, step) for step in range(start, min(start + ahead, end))]
            for step in range(start, end):
                batch = waiting.pop(0).result()
                if step + ahead < end:
                    waiting.append(pool.submit(self.at, step + ahead))
                yield batch
