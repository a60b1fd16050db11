"""Scenes from arrays."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import Any, NamedTuple, Protocol, TypeAlias, runtime_checkable

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import _insonify
from ._data import StrPath
from ._errors import SceneError


@runtime_checkable
class MeshLike(Protocol):
    """Anything with `vertices` [n, 3] in mm and `faces` [m, 3], such as a mesh of trimesh."""

    @property
    def vertices(self) -> Any:
        """Corners, mm [n, 3]."""
        ...

    @property
    def faces(self) -> Any:
        """Indices of the corners of each triangle [m, 3]."""
        ...


class Surface(NamedTuple):
    """A closed surface filled with a tissue."""

    vertices_mm: ArrayLike
    """Corners, mm [n, 3]."""
    triangles: ArrayLike
    """Indices of the corners of each triangle [m, 3], counter-clockwise seen from outside."""
    tissue: str
    """Name of its tissue."""
    priority: int = 0
    """Where closed surfaces overlap, the highest is the medium."""
    name: str = ""
    """Name; empty: its tissue and place in the list."""


SurfaceLike: TypeAlias = (
    Surface
    | tuple[ArrayLike, ArrayLike, str]
    | tuple[ArrayLike, ArrayLike, str, int]
    | tuple[MeshLike, str]
    | tuple[MeshLike, str, int]
)
"""A surface, its parts (vertices in mm, faces, tissue, priority), or a mesh with its tissue and priority."""


class Scene:
    """Closed surfaces in a background tissue.

    Equal vertices are merged, triangles without area are dropped, and a surface that faces inward is turned over, as in
    files. The logger `insonify` says so.
    """

    def __init__(self, surfaces: Iterable[SurfaceLike], background: str = "gel") -> None:
        """Surfaces, and the tissue outside of them. Units are mm, as in the station's pose."""
        self._surfaces = [_surface(given, place) for place, given in enumerate(surfaces)]
        self._background = background
        self._core = _insonify.SceneArrays(self._surfaces, background)

    @property
    def background(self) -> str:
        """Tissue outside all surfaces."""
        return self._background

    @property
    def surfaces(self) -> list[tuple[str, str, int, int]]:
        """Name, tissue, priority and number of triangles of each surface."""
        return self._core.surfaces

    def save(self, path: StrPath) -> Path:
        """Writes a .glb file, which stations and the command `insonify` read."""
        file = Path(path)
        self._core.save(file)
        return file

    def __repr__(self) -> str:
        surfaces = ", ".join(f"{name} ({triangles} triangles)" for name, _, _, triangles in self.surfaces)
        return f"<insonify.Scene of {surfaces} in {self._background}>"

    def __reduce__(self) -> tuple[Any, ...]:
        parts = [Surface(v, t, tissue, priority, name) for name, tissue, priority, v, t in self._surfaces]
        return (Scene, (parts, self._background))


def _surface(given: SurfaceLike, place: int) -> tuple[str, str, int, NDArray[np.float32], NDArray[np.uint32]]:
    parts: tuple[Any, ...] = tuple(given)
    if parts and isinstance(parts[0], MeshLike):
        mesh = parts[0]
        parts = (mesh.vertices, mesh.faces, *parts[1:])
    if not 3 <= len(parts) <= 5:
        raise SceneError(f"surface {place} has {len(parts)} parts; it must be (vertices_mm, faces, tissue, priority)")
    vertices, faces, tissue = parts[:3]
    priority: Any = parts[3] if len(parts) > 3 else 0
    if not isinstance(tissue, str):
        raise SceneError(f"the tissue of surface {place} is {tissue!r}; it must be a name")
    if not isinstance(priority, (int, np.integer)) or not -(2**31) <= int(priority) < 2**31:
        raise SceneError(f"the priority of surface {place} is {priority!r}; it must be a whole number")
    name = parts[4] if len(parts) > 4 and parts[4] else f"{tissue}_{place}"
    return name, tissue, int(priority), _vertices(vertices, name), _triangles(faces, name)


def _vertices(given: object, name: str) -> NDArray[np.float32]:
    found = _array(given, name, "vertices")
    if not np.issubdtype(found.dtype, np.number) or np.issubdtype(found.dtype, np.complexfloating):
        raise SceneError(f"surface `{name}`: vertices are of {found.dtype}; they must be real numbers, in mm")
    with np.errstate(over="ignore"):
        return np.ascontiguousarray(found, dtype=np.float32)


def _triangles(given: object, name: str) -> NDArray[np.uint32]:
    found = _array(given, name, "faces")
    if not np.issubdtype(found.dtype, np.integer):
        raise SceneError(f"surface `{name}`: faces are of {found.dtype}; they must be whole numbers")
    if found.size and (int(found.min()) < 0 or int(found.max()) >= 2**32):
        wrong = int(found.min()) if int(found.min()) < 0 else int(found.max())
        raise SceneError(f"surface `{name}`: faces name vertex {wrong}; vertices are counted from 0")
    return np.ascontiguousarray(found, dtype=np.uint32)


def _array(given: object, name: str, what: str) -> NDArray[Any]:
    try:
        found: NDArray[Any] = np.asarray(given)
    except ValueError as error:
        raise SceneError(f"surface `{name}`: {what} are no array: {error}") from None
    if found.ndim != 2 or found.shape[1] != 3:
        raise SceneError(f"surface `{name}`: {what} have the shape {found.shape}; it must be (n, 3)")
    return found
