"""Stations: a scene, a probe, and the settings of a scanner."""

from __future__ import annotations

import html
import json
import os
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeAlias, cast

import numpy as np

from . import _insonify
from ._data import StrPath, station_file
from ._errors import InputError
from ._exercise import Exercise
from ._frame import Frame
from ._needle import Needle, NeedleLike, as_needle, needle_argument, needle_of, shown_needle
from ._plan import EffectPlan
from ._planes import StandardPlanes
from ._pose import Pose, PoseLike, as_pose
from ._scene import Scene
from ._settings import nested, plain

Quality: TypeAlias = str | tuple[int, int]
"""A preset (fast, balanced, accurate, reference), rays x layers as `8x3`, or both numbers."""

# Frames that render_many makes ahead of its caller.
_AHEAD = 4


@dataclass(frozen=True)
class Job:
    """A pose of `Station.render_many` with settings of its own; None takes those of the call."""

    pose: PoseLike
    """Pose of the probe."""
    quality: Quality | None = None
    """Rays and layers."""
    seed: int | None = None
    """Seed of the paths and the noise."""
    time_s: float | None = None
    """Time of the scene's motion."""
    needle: NeedleLike | None = None
    """Pose of the needle, or False for a frame without it."""


class Station:
    """A station: scene, probe, image and quality, from a station file.

    The scene is loaded for the first frame, and stations of one scene share its memory. Threads may share a station.
    """

    def __init__(
        self,
        source: StrPath = "obstetric",
        /,
        *,
        scene: Scene | None = None,
        backend: str | None = None,
        **settings: Any,
    ) -> None:
        """Reads a station file, or a station that comes with the package by its name (`station_names`).

        `scene` replaces the file's scene, `backend` says where frames are made (auto, host or device), and all other
        keywords are settings as in `Station.set`.
        """
        self._core = _insonify.Station.load(station_file(source))
        self._planes: StandardPlanes | None = None
        self._exercise: Exercise | None = None
        self._tissues: tuple[str, ...] = ()
        if scene is not None or backend is not None:
            tables, path = self._core.tables(), self._core.path
            if scene is not None:
                tables.pop("scene", None)
            self._core = _core(tables, self._core.directory, path, scene, backend)
        self._scene = scene
        self._changed()
        if settings:
            self.set(**settings)

    @classmethod
    def from_dict(
        cls,
        tables: Mapping[str, Any],
        /,
        *,
        scene: Scene | None = None,
        backend: str | None = None,
        directory: StrPath | None = None,
    ) -> Station:
        """A station of tables and keys as in a station file, without the file.

        Relative paths start at `directory`, by default the working directory. `scene` takes the place of the table
        `scene`.

        >>> Station.from_dict({"scene": {"phantom": "obstetric"}, "image": {"gain_db": 24}}).settings["image"]["gain_db"]
        24.0
        """
        base = Path(os.getcwd() if directory is None else directory).absolute()
        own = {name: table for name, table in tables.items() if scene is None or name != "scene"}
        return cls._of(_core(plain(own), base, None, scene, backend), scene)

    @classmethod
    def obstetric(cls, **settings: Any) -> Station:
        """The fetus of 22 weeks of the first examples."""
        return cls("obstetric", **settings)

    @classmethod
    def _of(cls, core: _insonify.Station, scene: Scene | None) -> Station:
        station = cls.__new__(cls)
        station._core, station._scene = core, scene
        station._changed()
        return station

    def _changed(self) -> None:
        self._planes = None
        self._exercise = None
        self._tissues = ("outside", *self._core.tissue_names())

    def set(self, **settings: Any) -> None:
        """Changes settings by the keys of station files; None restores a default. After an error nothing has changed.

        A key that several tables have is given with its table:

        >>> station = Station("sphere")
        >>> station.set(gain_db=30, depth_mm=120, probe={"frequency_mhz": 5.0})
        >>> station.settings["image"]["gain_db"], station.settings["probe"]["depth_mm"]
        (30.0, 120.0)
        """
        self._core.set(nested(settings))
        self._changed()

    def copy(self, **settings: Any) -> Station:
        """Another station with the same scene, and changes as in `set`."""
        core = _core(self._core.tables(), self._core.directory, self._core.path, self._scene, self._core.backend)
        station = Station._of(core, self._scene)
        if settings:
            station.set(**settings)
        return station

    def to_dict(self) -> dict[str, Any]:
        """Tables and keys as a station file has them, with all changes."""
        return self._core.tables()

    @property
    def path(self) -> Path | None:
        """Station file; None for a station from a dict."""
        path = self._core.path
        return None if path is None else Path(path)

    @property
    def settings(self) -> dict[str, Any]:
        """Settings in force, by table: probe, image, quality, look, contact, receiver, needle."""
        settings: dict[str, Any] = json.loads(self._core.settings_json())
        return settings

    @property
    def pose(self) -> Pose | None:
        """Pose of the station's table `pose`."""
        components = self._core.pose
        return None if components is None else as_pose(components)

    @property
    def tissues(self) -> dict[str, dict[str, float]]:
        """Properties of every tissue, by name."""
        return self._core.tissues()

    @property
    def tissue_names(self) -> tuple[str, ...]:
        """Name of each number of a segmentation; number 0 is `outside`."""
        return self._tissues

    @property
    def adapter(self) -> str | None:
        """Device or processor that makes the frames; None before the first one."""
        return self._core.adapter

    @property
    def planes(self) -> StandardPlanes:
        """Standard planes of the scene, by name."""
        if self._planes is None:
            self._planes = StandardPlanes(self._core.planes())
        return self._planes

    @property
    def needle(self) -> Needle | None:
        """The needle of the station's table `needle`, None without one; `set(needle=pose)` moves it."""
        return needle_of(self._core)

    @property
    def exercise(self) -> Exercise | None:
        """The exercise of the station's table `exercise` in its scene, None without one."""
        if self._exercise is None:
            core = self._core.exercise()
            self._exercise = None if core is None else Exercise(core)
        return self._exercise

    def plan(self, *, quality: Quality | None = None) -> EffectPlan:
        """Effects that the scene calls for, and why."""
        return EffectPlan(*self._core.plan(_quality(quality)))

    def prepare(self) -> None:
        """Loads the scene and makes the renderer, which the first frame does otherwise."""
        self._core.prepare()

    def render(
        self,
        pose: PoseLike | None = None,
        *,
        needle: NeedleLike | None = None,
        quality: Quality | None = None,
        seed: int | None = None,
        time_s: float = 0.0,
        maps: bool = True,
        lines: bool = True,
    ) -> Frame:
        """Renders a frame, as `insonify render` does on the same device, bit for bit.

        Without a pose, needle, quality or seed the station's own is used. `needle` is the pose of the station's needle,
        or False for a frame without it. `maps` are segmentation and attenuation, `lines` the complex baseband.
        """
        placed, tool = self._placed(pose), as_needle(needle)
        seed = _seed(seed)
        still = self._core.render(
            placed.components, needle_argument(tool), _quality(quality), seed, float(time_s), bool(maps), bool(lines)
        )
        return Frame(still, placed, shown_needle(tool, self.needle), seed, float(time_s), self._tissues)

    def render_many(
        self,
        poses: Iterable[PoseLike | Job],
        *,
        needle: NeedleLike | None = None,
        quality: Quality | None = None,
        seed: int | None = None,
        time_s: float = 0.0,
        maps: bool = True,
        lines: bool = False,
        ahead: int = _AHEAD,
    ) -> Iterator[Frame]:
        """Renders frames of many poses in order, each as `render` does, on a thread that stays `ahead` frames ahead.

        Poses are taken from the iterable as they are needed, and settings are those of the first frame. A budget of the
        station chooses its quality once.
        """
        if ahead < 1:
            raise InputError(f"ahead is {ahead}; it must be at least 1")
        tissues, own_needle, stream = self._tissues, self.needle, self._core.stream()
        waiting: list[tuple[Pose, Pose | None, int | None, float]] = []
        try:
            for given in poses:
                job = given if isinstance(given, Job) else Job(given)
                placed, tool = as_pose(job.pose), as_needle(needle if job.needle is None else job.needle)
                own_seed = _seed(seed if job.seed is None else job.seed)
                own_time = float(time_s if job.time_s is None else job.time_s)
                own_quality = _quality(quality if job.quality is None else job.quality)
                stream.push(
                    placed.components, needle_argument(tool), own_quality, own_seed, own_time, bool(maps), bool(lines)
                )
                waiting.append((placed, shown_needle(tool, own_needle), own_seed, own_time))
                if len(waiting) > ahead:
                    yield Frame(stream.next(), *waiting.pop(0), tissues)
            while waiting:
                yield Frame(stream.next(), *waiting.pop(0), tissues)
        finally:
            stream.close()

    def _placed(self, pose: PoseLike | None) -> Pose:
        if pose is not None:
            return as_pose(pose)
        own = self.pose
        if own is None:
            raise InputError("the station has no pose of its own: give one")
        return own

    def __repr__(self) -> str:
        probe = self.settings["probe"]
        name = "a dict" if self.path is None else str(self.path)
        return f"<insonify.Station of {name}: {probe['kind']} probe, {probe['depth_mm']:g} mm deep>"

    def _repr_html_(self) -> str:
        rows: list[str] = []
        for table, values in self.settings.items():
            if not isinstance(values, dict):
                continue
            keys = cast("dict[str, Any]", values)
            cells = ", ".join(f"{html.escape(key)} = {html.escape(json.dumps(value))}" for key, value in keys.items())
            rows.append(f"<tr><th style='text-align:left'>{table}</th><td style='text-align:left'>{cells}</td></tr>")
        return f"<p>{html.escape(repr(self))}</p><table>{''.join(rows)}</table>"

    def __reduce__(self) -> tuple[Any, ...]:
        core = self._core
        return (_restored, (core.tables(), core.directory, core.path, self._scene, core.backend))

    def __copy__(self) -> Station:
        return self.copy()


def _core(
    tables: dict[str, Any], directory: StrPath, path: StrPath | None, scene: Scene | None, backend: str | None
) -> _insonify.Station:
    arrays = None if scene is None else scene._core
    return _insonify.Station.from_tables(tables, directory, path, arrays, backend)


def _restored(
    tables: dict[str, Any], directory: StrPath, path: StrPath | None, scene: Scene | None, backend: str | None
) -> Station:
    return Station._of(_core(tables, directory, path, scene, backend), scene)


def _quality(quality: Quality | None) -> str | None:
    if quality is None or isinstance(quality, str):
        return quality
    if not isinstance(quality, tuple) or len(quality) != 2:
        raise InputError(f"quality is {quality!r}; it must be a str or (rays, layers)")
    return f"{quality[0]}x{quality[1]}"


def _seed(seed: int | None) -> int | None:
    if seed is None:
        return None
    if not isinstance(seed, (int, np.integer)) or not 0 <= int(seed) < 2**32:
        raise InputError(f"seed is {seed!r}; it must be a whole number in 0..=4294967295")
    return int(seed)
