"""Files that come with the package: stations, scenes, recordings, models."""

from __future__ import annotations

import os
from pathlib import Path

from ._errors import MissingFileError

StrPath = str | os.PathLike[str]

_PACKAGE = Path(__file__).resolve().parent


def data_directory() -> Path:
    """Directory of the files that come with the package; it has the folders `configs` and `assets`."""
    inside = _PACKAGE / "data"
    if (inside / "configs").is_dir():
        return inside
    # An editable installation uses the repository's own files.
    for folder in _PACKAGE.parents:
        if (folder / "configs" / "obstetric.toml").is_file():
            return folder
    raise MissingFileError(f"the package's files are not in {inside}: install the wheel again")


def station_names() -> list[str]:
    """Names of the stations that come with the package."""
    return sorted(path.stem for path in (data_directory() / "configs").glob("*.toml"))


def station_file(source: StrPath) -> Path:
    """Path of a station: a file, or the name of a station that comes with the package."""
    path = Path(source)
    # A folder may have a station's name.
    if path.is_file():
        return path
    shipped = data_directory()
    candidates = [shipped / path, shipped / "configs" / f"{path}.toml"] if not path.is_absolute() else []
    found = next((candidate for candidate in candidates if candidate.is_file()), None)
    if found is None and not path.suffix and len(path.parts) == 1:
        names = ", ".join(station_names())
        raise MissingFileError(f"no station of the package is called {path}, and no file; they are {names}")
    return found or path


def model_names() -> list[str]:
    """Names of the generators that come with the package."""
    return sorted(path.stem for path in (data_directory() / "assets" / "generators").glob("*/*.toml"))


def model_file(source: StrPath) -> Path:
    """Path of a model: a file, or the name of a generator that comes with the package."""
    path = Path(source)
    if path.is_file():
        return path
    shipped = data_directory() / "assets" / "generators" / path / f"{path}.onnx"
    return shipped if shipped.is_file() else path
