"""Data sets of paired frames."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Sequence
from functools import cached_property
from pathlib import Path
from typing import Any, Generic, Literal, NamedTuple, TypedDict, TypeVar, cast, overload

import numpy as np
from numpy.typing import NDArray

from . import _insonify
from ._data import StrPath, station_file
from ._errors import InputError

Split = Literal["train", "test"]


class Tuple(TypedDict):
    """Arrays of a row, each [height, width]."""

    lq: NDArray[np.uint8]
    """Grey levels of the low quality."""
    hq: NDArray[np.uint8]
    """Grey levels of the high quality."""
    segmentation: NDArray[np.uint8]
    """Classes, see `Dataset.classes`."""
    attenuation: NDArray[np.float32]
    """Attenuation map, 0 to 1."""
    mask: NDArray[np.uint8]
    """255 inside the sector, 0 outside."""


_Item = TypeVar("_Item")


class Dataset(Generic[_Item]):
    """A data set of `insonify dataset`, read as it is needed.

    It has the interface of PyTorch's map-style data sets, and may be given to a `DataLoader`, with workers, too.
    """

    @overload
    def __init__(self: Dataset[Tuple], path: StrPath, split: Split | None = None, transform: None = None) -> None: ...
    @overload
    def __init__(self, path: StrPath, split: Split | None = None, *, transform: Callable[[Tuple], _Item]) -> None: ...
    def __init__(
        self, path: StrPath, split: Split | None = None, transform: Callable[[Tuple], _Item] | None = None
    ) -> None:
        """Opens the directory `path`, for all tuples or those of a split. `transform` makes items of tuples."""
        self.path = Path(path)
        self.split: Split | None = split
        self.transform = transform
        self._open()

    def _open(self) -> None:
        self._core = _insonify.Dataset(self.path)
        self._rows = self._core.rows(self.split)

    @cached_property
    def header(self) -> dict[str, Any]:
        """`dataset.json`."""
        header: dict[str, Any] = json.loads(self._core.header_json())
        return header

    @property
    def classes(self) -> list[str]:
        """Tissue of each class of the segmentation; class 0 is `outside`."""
        classes: list[str] = self.header["classes"]
        return classes

    def row(self, index: int) -> dict[str, Any]:
        """Row of the manifest: pose, settings, seed and files of a tuple."""
        row: dict[str, Any] = json.loads(self._core.row_json(self._rows[index]))
        return row

    def tuple(self, index: int) -> Tuple:
        """Arrays of a tuple."""
        return cast("Tuple", self._core.tuple(self._rows[index]))

    def __len__(self) -> int:
        return len(self._rows)

    def __getitem__(self, index: int) -> _Item:
        found = self.tuple(index)
        return cast("_Item", found) if self.transform is None else self.transform(found)

    def __iter__(self) -> Iterator[_Item]:
        return (self[index] for index in range(len(self)))

    def __repr__(self) -> str:
        of = "" if self.split is None else f" to {self.split}"
        return f"<insonify.Dataset {self.path}: {len(self)} tuples{of}>"

    def __getstate__(self) -> dict[str, Any]:
        return {"path": self.path, "split": self.split, "transform": self.transform}

    def __setstate__(self, state: dict[str, Any]) -> None:
        self.__dict__.update(state)
        self._open()


class Made(NamedTuple):
    """Result of `make_dataset`."""

    made: int
    """Tuples that this call rendered."""
    kept: int
    """Tuples that were there."""
    manifest: Path
    """Manifest of the shard."""
    indices: range
    """Numbers of the shard's tuples in the plan, whoever rendered them."""


def make_dataset(
    stations: StrPath | Sequence[StrPath],
    directory: StrPath,
    *,
    frames: int = 600,
    seed: int = 1,
    phantoms: int | None = None,
    frames_per_exam: int = 8,
    test_share: float = 0.1,
    lq: str | Sequence[str] = "lq",
    hq: str = "hq",
    lq_angles: int = 1,
    hq_angles: int = 1,
    shard: str = "1/1",
    backend: str | None = None,
    progress: Callable[[int, int], object] | None = None,
) -> Made:
    """Renders a data set of paired frames, as `insonify dataset` does on the same device, bit for bit.

    `stations` are station files. A call that was stopped, by Ctrl-C, too, goes on where it was. `shard` as `3/8` makes a
    part; all parts may share a directory. `progress` is called with the numbers of tuples done and in all.
    """
    several = [stations] if isinstance(stations, str) or not isinstance(stations, Sequence) else stations
    files: list[StrPath] = [station_file(station) for station in several]
    lows = [lq] if isinstance(lq, str) else list(lq)
    angles = (lq_angles, hq_angles)
    for name, number in (("frames", frames), ("seed", seed), ("frames_per_exam", frames_per_exam)):
        if number < 0:
            raise InputError(f"{name} is {number}; it must be a whole number from 0")
    made, kept, manifest, first, end = _insonify.make_dataset(
        files,
        directory,
        frames,
        seed,
        phantoms,
        frames_per_exam,
        test_share,
        lows,
        hq,
        angles,
        shard,
        backend,
        progress,
    )
    return Made(made, kept, Path(manifest), range(first, end))
