"""Tuples of a data set as bytes in the memory of the device that trains: batches cost no reading and no copy."""

import contextlib
import multiprocessing
from dataclasses import dataclass

import numpy as np
import torch
import torch.nn.functional as F

from .dataset import HQ, LQ, Dataset, DatasetError

# Pixels of outside around a tuple, above and below, left and right: crops begin anywhere in them.
BORDER = (32, 16)
# Side of the window of the picture, px.
WINDOW = 512


def _bytes(task):
    """Planes and mask of a row as one array, uint8 [5, height, width], and of its picture LQ and HQ [2, height, width]."""
    directory, grid, index = task
    data = Dataset(directory, grid)
    row = data.rows[index]
    picture = np.ascontiguousarray(data.picture(row)[0][[LQ, HQ]]) if grid else None
    return np.concatenate([data.planes(row), data.mask(row)[None]]), picture


@dataclass(frozen=True)
class View:
    """A window of the picture that the station would show of each crop; levels within 0..=1."""

    # Place of each pixel in the crop [n, h, w, 2] (column, row), within -1..=1.
    place: torch.Tensor
    # Input and target [n, 1, h, w], 0 outside, and where it is inside both sector and crop.
    lq: torch.Tensor
    hq: torch.Tensor
    inside: torch.Tensor

    def of(self, output, image, kept):
        """The picture [n, 1, h, w] that a network's `output` for the crops' `image` gives, as `Sampling.corrected` makes it."""
        change = F.grid_sample(output - kept * image, self.place, mode="bilinear", padding_mode="border", align_corners=True)
        return (kept * self.lq + change) * self.inside


@dataclass(frozen=True)
class Drawn:
    """Random crops: planes [n, 4, h, w], mask [n, 1, h, w], the picture's pixels by row [n, 1, h, 1], and a window of each picture."""

    planes: torch.Tensor
    mask: torch.Tensor
    area: torch.Tensor
    view: View | None


class Resident:
    """All tuples of one split, and crops of whole width drawn from them on the device.

    Tuples may differ in height: a crop of a shorter one is filled up with outside. In beam coordinates the pictures are there, too.
    """

    def __init__(self, data, split, multiple, jobs=1):
        rows = [(data.directory, data.grid, at) for at, row in enumerate(data.rows) if row.split == split]
        if not rows:
            raise DatasetError(f"{data.directory}: no rows of split `{split}`")
        sizes = np.array([data.rows[at].size[::-1] for _, _, at in rows])
        height, width = sizes.max(0)
        self.crop = tuple(int(-(-side // multiple) * multiple) for side in (height, width))
        down, across = BORDER
        room = (max(self.crop[0], height + 2 * down), max(self.crop[1], width + 2 * across))
        store = np.zeros((len(rows), 5, *room), np.uint8)
        area = np.ones((len(rows), room[0]), np.float32)
        pictures = []
        with multiprocessing.get_context("fork").Pool(jobs) if jobs > 1 else contextlib.nullcontext() as pool:
            for at, (one, picture) in enumerate(pool.imap(_bytes, rows, 4) if pool else map(_bytes, rows)):
                store[at, :, down : down + one.shape[1], across : across + one.shape[2]] = one
                pictures.append(picture)
        for at, (_, _, index) in enumerate(rows):
            area[at, down : down + sizes[at, 0]] = cell_area(data, data.rows[index])
        self.store, self.area = torch.from_numpy(store), torch.from_numpy(area)
        # Crops of a tuple that is shorter than the crop begin at its border.
        self.reach = torch.from_numpy(np.maximum(sizes[:, 0] + 2 * down - self.crop[0], 0))
        self.across = int(room[1] - self.crop[1])
        self.pictures = None
        if data.grid:
            self._keep_pictures(data, rows, pictures)

    def _keep_pictures(self, data, rows, pictures):
        samplings = {data.sampling(data.rows[index]): None for _, _, index in rows}
        stations = {sampling: at for at, sampling in enumerate(samplings)}
        sides = np.max([picture.shape[1:] for picture in pictures], 0)
        kept = np.zeros((len(pictures), 2, *sides), np.uint8)
        for at, picture in enumerate(pictures):
            kept[at, :, : picture.shape[1], : picture.shape[2]] = picture
        # Column and row in the store, and whether the pixel is in the sector.
        places = np.zeros((len(stations), 3, *sides), np.float32)
        for sampling, at in stations.items():
            parts = [np.clip(of, 0, count - 1) + border for of, count, border in zip((sampling.line, sampling.cell), sampling.shape[::-1], BORDER[::-1])]
            places[at, :, : sampling.height, : sampling.width] = np.stack([*parts, sampling.mask])
        self.pictures, self.places = torch.from_numpy(kept), torch.from_numpy(places)
        self.station = torch.tensor([stations[data.sampling(data.rows[index])] for _, _, index in rows])

    @property
    def device(self):
        """Device that holds the tuples."""
        return self.store.device

    def to(self, device):
        """Moves the tuples to `device`. Made beforehand: processes that read them can't be forked once CUDA runs."""
        for name in ("store", "area", "reach", *(("pictures", "places", "station") if self.pictures is not None else ())):
            setattr(self, name, getattr(self, name).to(device))
        return self

    def __len__(self):
        return len(self.store)

    def draw(self, batch, mirrored=True, window=WINDOW):
        """`batch` random crops, by the device's own numbers."""
        on = {"device": self.device}
        tuples = torch.randint(len(self), (batch,), **on)
        top = (torch.rand(batch, **on) * (self.reach[tuples] + 1)).long()
        left = torch.randint(self.across + 1, (batch,), **on)
        rows = top[:, None] + torch.arange(self.crop[0], **on)
        columns = torch.arange(self.crop[1], **on).expand(batch, -1)
        # An equally valid frame of the mirrored body.
        turned = torch.rand(batch, 1, **on) < (0.5 if mirrored else 0.0)
        columns = torch.where(turned, self.crop[1] - 1 - columns, columns) + left[:, None]
        planes = torch.arange(5, **on)
        cut = self.store[tuples[:, None, None, None], planes[:, None, None], rows[:, None, :, None], columns[:, None, None, :]]
        area = self.area[tuples[:, None], rows][:, None, :, None]
        view = None if self.pictures is None else self._view(tuples, top, left, turned, window)
        return Drawn(cut[:, :4], cut[:, 4:], area, view)

    def _view(self, tuples, top, left, turned, window):
        on = {"device": self.device}
        rows, columns = (
            torch.randint(max(1, side - window + 1), (len(tuples), 1), **on) + torch.arange(min(window, side), **on)
            for side in self.pictures.shape[2:]
        )
        at = (rows[:, None, :, None], columns[:, None, None, :])
        levels = self.pictures[(tuples[:, None, None, None], torch.arange(2, **on)[:, None, None], *at)].float() / 255
        column, row, inside = self.places[(self.station[tuples][:, None, None, None], torch.arange(3, **on)[:, None, None], *at)].unbind(1)
        height, width = self.crop
        column, row = column - left[:, None, None], row - top[:, None, None]
        column = torch.where(turned[:, :, None], width - 1 - column, column)
        inside = (inside > 0) & (row >= 0) & (row <= height - 1) & (column >= 0) & (column <= width - 1)
        inside = inside[:, None].float()
        place = torch.stack([2 * column / (width - 1) - 1, 2 * row / (height - 1) - 1], -1)
        return View(place, levels[:, :1] * inside, levels[:, 1:] * inside, inside)


def cell_area(data, row):
    """Pixels of the picture that a range cell stands for, by row of the tuple; their mean is 1. Of pictures it is 1 throughout."""
    if not data.grid:
        return 1.0
    scan = data.scans[data.pictures[row.index].station]
    depth_mm = (np.arange(row.size[1]) + 0.5) * data.grid.cell_mm
    arc_mm = 1.0 + 0.0 * depth_mm if scan.radius_mm is None else scan.radius_mm + depth_mm
    return (arc_mm / arc_mm.mean()).astype(np.float32)
