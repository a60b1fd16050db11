"""Trained generators, which translate frames to high quality."""

from __future__ import annotations

import importlib.util
import os
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from . import _insonify
from ._data import StrPath, model_file
from ._errors import GeneratorError
from ._frame import Frame

if TYPE_CHECKING:
    from ._station import Station

# Variable with ONNX Runtime's library, which the library reads.
VARIABLE = "ORT_DYLIB_PATH"

_PATTERNS = ("libonnxruntime.so.*", "libonnxruntime.*.dylib", "onnxruntime.dll")


def onnxruntime_library() -> Path | None:
    """Library of the installed package `onnxruntime`; None without it. The package is not imported."""
    spec = importlib.util.find_spec("onnxruntime")
    for folder in (spec.submodule_search_locations or []) if spec else []:
        for pattern in _PATTERNS:
            found = sorted((Path(folder) / "capi").glob(pattern))
            if found:
                return found[-1]
    return None


def use_onnxruntime() -> bool:
    """Names the package's library to the loader unless the user has named one; False if there is none."""
    if os.environ.get(VARIABLE):
        return True
    library = onnxruntime_library()
    if library is not None:
        os.environ[VARIABLE] = str(library)
    return library is not None


class Generator:
    """A trained model in ONNX's format, checked by its parity pair when it is loaded."""

    def __init__(self, model: StrPath, /, *, station: Station, threads: int = 0, precision: str = "auto") -> None:
        """Loads a model file, or one that comes with the package by its name (`model_names`).

        `station` says which tissues its frames have. `threads` of a run; 0 takes one for each processor.
        """
        self._path = model_file(model)
        found = use_onnxruntime()
        try:
            tissues = list(station.tissue_names[1:])
            self._core = _insonify.Generator(self._path, tissues, threads, precision)
        except GeneratorError as error:
            if not found:
                text = "generators need ONNX Runtime: pip install 'insonify[generator]'"
            elif "cannot be used as ONNX Runtime's library" in str(error):
                text = "pip install --upgrade 'insonify[generator]', with Python 3.11 or later"
            else:
                raise
            raise GeneratorError(f"{text} ({error})") from None

    @property
    def name(self) -> str:
        """Name in its manifest."""
        return self._core.name

    @property
    def path(self) -> Path:
        """The model's file."""
        return self._path

    @property
    def precision(self) -> str:
        """Precision that was chosen: float32, int8 or float16."""
        return self._core.precision

    def run(self, frame: Frame) -> NDArray[np.uint8]:
        """Translates a frame with maps: grey levels [height, width], 0 outside the sector."""
        return self._core.run(
            frame.bmode,
            frame.segmentation,
            frame.attenuation,
            frame.mask,
            frame._face,
            frame.mm_per_pixel,
            frame.corner_mm,
        )

    def __repr__(self) -> str:
        return f"<insonify.Generator {self.name}, {self.precision}>"
