"""Rendered frames."""

from __future__ import annotations

import json
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from . import _insonify
from ._data import StrPath
from ._errors import InputError
from ._pose import Pose

_State = dict[str, Any]


class Frame:
    """A frame: its picture, its maps, and how it was made.

    Arrays own the renderer's memory; only the mask, which frames share, is copied. Rows run from the probe into the body.
    """

    def __init__(
        self,
        still: _insonify.Still,
        pose: Pose,
        needle: Pose | None,
        seed: int | None,
        time_s: float,
        tissues: tuple[str, ...],
    ) -> None:
        self.bmode: NDArray[np.uint8] = still.bmode
        """Grey levels [height, width]; 0 outside the sector."""
        self.mask: NDArray[np.uint8] = still.mask
        """255 inside the sector, 0 outside [height, width]."""
        self._segmentation = still.segmentation
        self._attenuation = still.attenuation
        self._lines = still.lines
        self.pose: Pose = pose
        """Pose that was asked for."""
        self.needle: Pose | None = needle
        """Pose of the needle; None for a frame without one."""
        self.time_s: float = time_s
        """Time of the scene's motion, s."""
        self.tissues: tuple[str, ...] = tissues
        """Name of each number of `segmentation`; number 0 is `outside`."""
        self.mm_per_pixel: float = still.mm_per_pixel
        """Side of a square pixel, mm."""
        self.corner_mm: tuple[float, float] = still.corner_mm
        """Upper left corner of the picture, x and z of the probe's frame, mm."""
        self.attenuation_p98: float = still.attenuation_p98
        """98th percentile that `attenuation` was divided by; 0 without maps."""
        self.overflows: int = still.overflows
        """Interactions that did not fit the buffers; 0 in a sound frame."""
        self.render_ms: float = still.total_ms
        """Time of rendering, ms."""
        self.chosen: str | None = still.chosen
        """Quality that the station's budget chose, and why; None if the quality was fixed."""
        self._face = still.face
        self._record: _insonify.Record | str = still.record

    @property
    def segmentation(self) -> NDArray[np.uint8]:
        """Tissue numbers [height, width], see `tissues`; 0 outside the sector."""
        return self._segmentation if self._segmentation is not None else _missing("segmentation", "maps")

    @property
    def attenuation(self) -> NDArray[np.float32]:
        """One-way attenuation over its 98th percentile, 0 to 1 [height, width]; 0 outside the sector."""
        return self._attenuation if self._attenuation is not None else _missing("attenuation", "maps")

    @property
    def lines(self) -> NDArray[np.complex64]:
        """Complex baseband before TGC and compression [scanlines, samples]."""
        return self._lines if self._lines is not None else _missing("lines", "lines")

    @property
    def has_maps(self) -> bool:
        """Whether the frame has `segmentation` and `attenuation`."""
        return self._segmentation is not None

    @property
    def has_lines(self) -> bool:
        """Whether the frame has `lines`."""
        return self._lines is not None

    @cached_property
    def record(self) -> dict[str, Any]:
        """What `frame.json` of `insonify render` holds: pose, settings, effects, times, adapter."""
        text = self._record if isinstance(self._record, str) else self._record.json()
        record: dict[str, Any] = json.loads(text)
        return record

    def tissue(self, name: str) -> NDArray[np.bool_]:
        """Pixels of a tissue [height, width]."""
        if name not in self.tissues:
            raise InputError(f"the station has no tissue `{name}`; its tissues are {', '.join(self.tissues)}")
        return np.equal(self.segmentation, self.tissues.index(name))

    def png(self) -> bytes:
        """The picture as a PNG file of grey levels."""
        return _insonify.png(self.bmode)

    def save_png(self, path: StrPath) -> Path:
        """Writes the picture as a PNG file."""
        file = Path(path)
        file.write_bytes(self.png())
        return file

    def _repr_png_(self) -> bytes:
        return self.png()

    def __repr__(self) -> str:
        height, width = self.bmode.shape
        parts = [f"{width} x {height} pixels of {self.mm_per_pixel:.3f} mm", f"{self.render_ms:.1f} ms"]
        parts += ["maps"] if self.has_maps else []
        parts += ["lines"] if self.has_lines else []
        return f"<insonify.Frame {', '.join(parts)}>"

    def __getstate__(self) -> _State:
        state = dict(self.__dict__)
        state.pop("record", None)
        if not isinstance(self._record, str):
            state["_record"] = self._record.json()
        return state

    def __setstate__(self, state: _State) -> None:
        self.__dict__.update(state)


def _missing(what: str, keyword: str) -> Any:
    raise InputError(f"the frame was rendered without {what}: render it with {keyword}=True")
