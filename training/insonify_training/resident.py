"""Tuples of a data set as bytes in the memory of the device that trains: batches cost no reading and no copy."""

import contextlib
import multiprocessing

import numpy as np
import torch

from .dataset import Dataset, DatasetError

# Pixels of outside around a tuple, above and below, left and right: crops begin anywhere in them.
BORDER = (32, 16)


def _bytes(task):
    """Planes and mask of a row as one array, uint8 [5, height, width]."""
    directory, grid, index = task
    data = Dataset(directory, grid)
    row = data.rows[index]
    return np.concatenate([data.planes(row), data.mask(row)[None]])


class Resident:
    """All tuples of one split, and crops of whole width drawn from them on the device.

    Tuples may differ in height: a crop of a shorter one is filled up with outside.
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
        with multiprocessing.get_context("fork").Pool(jobs) if jobs > 1 else contextlib.nullcontext() as pool:
            for at, one in enumerate(pool.imap(_bytes, rows, 4) if pool else map(_bytes, rows)):
                store[at, :, down : down + one.shape[1], across : across + one.shape[2]] = one
        for at, (_, _, index) in enumerate(rows):
            area[at, down : down + sizes[at, 0]] = cell_area(data, data.rows[index])
        self.store, self.area = torch.from_numpy(store), torch.from_numpy(area)
        # Crops of a tuple that is shorter than the crop begin at its border.
        self.reach = torch.from_numpy(np.maximum(sizes[:, 0] + 2 * down - self.crop[0], 0))
        self.across = int(room[1] - self.crop[1])

    @property
    def device(self):
        """Device that holds the tuples."""
        return self.store.device

    def to(self, device):
        """Moves the tuples to `device`. Made beforehand: processes that read them can't be forked once CUDA runs."""
        for name in ("store", "area", "reach"):
            setattr(self, name, getattr(self, name).to(device))
        return self

    def __len__(self):
        return len(self.store)

    def draw(self, batch, mirrored=True):
        """Planes [n, 4, h, w], mask [n, 1, h, w] and area [n, 1, h, 1] of `batch` random crops, by the device's own numbers."""
        on = {"device": self.device}
        tuples = torch.randint(len(self), (batch,), **on)
        top = (torch.rand(batch, **on) * (self.reach[tuples] + 1)).long()
        left = torch.randint(self.across + 1, (batch,), **on)
        rows = top[:, None] + torch.arange(self.crop[0], **on)
        columns = torch.arange(self.crop[1], **on).expand(batch, -1)
        if mirrored:
            # An equally valid frame of the mirrored body.
            columns = torch.where(torch.rand(batch, 1, **on) < 0.5, self.crop[1] - 1 - columns, columns)
        columns = columns + left[:, None]
        planes = torch.arange(5, **on)
        cut = self.store[tuples[:, None, None, None], planes[:, None, None], rows[:, None, :, None], columns[:, None, None, :]]
        return cut[:, :4], cut[:, 4:], self.area[tuples[:, None], rows][:, None, :, None]


def cell_area(data, row):
    """Pixels of the picture that a range cell stands for, by row of the tuple; their mean is 1. Of pictures it is 1 throughout."""
    if not data.grid:
        return 1.0
    scan = data.scans[data.pictures[row.index].station]
    depth_mm = (np.arange(row.size[1]) + 0.5) * data.grid.cell_mm
    arc_mm = 1.0 + 0.0 * depth_mm if scan.radius_mm is None else scan.radius_mm + depth_mm
    return (arc_mm / arc_mm.mean()).astype(np.float32)
