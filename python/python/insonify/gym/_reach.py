"""Bringing a mark to the middle of the picture."""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .._errors import InputError
from .._pose import Pose
from .._scene import Scene
from .._station import Quality, Station
from ._base import Action, Measured, ProbeEnv, RewardWeights, Steps, moved_mm

_MARK_MM = (0.0, 0.0, 55.0)
_MARK_RADIUS_MM = 10.0
_VESSEL_DEPTH_MM = 30.0
_VESSEL_RADIUS_MM = 4.0
# Largest displacement of the probe along x and y.
_REACH_MM = 30.0
_SCALE_MM = 10.0


def _sphere(centre: tuple[float, float, float], radius: float) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    return _revolved(np.sin, np.cos, np.array(centre), np.eye(3), radius, radius)


def _revolved(
    width: Any, height: Any, centre: NDArray[np.float64], axes: NDArray[np.float64], radius: float, half_length: float
) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """A closed surface about its third axis, of rings between two poles."""
    rings, around = 12, 24
    polar = np.linspace(0, np.pi, rings + 1)[1:-1]
    turn = np.linspace(0, 2 * np.pi, around, endpoint=False)
    ring = np.stack([np.cos(turn), np.sin(turn)], axis=1)
    points = [
        np.concatenate([radius * width(p) * ring, np.full((around, 1), half_length * height(p))], 1) for p in polar
    ]
    poles = [[0, 0, half_length], [0, 0, -half_length]]
    vertices = np.concatenate([*points, np.array(poles)]) @ axes + centre
    first, last = len(vertices) - 2, len(vertices) - 1
    faces: list[list[int]] = []
    for n in range(around):
        m = (n + 1) % around
        faces.append([first, n, m])
        faces += [[r * around + n, (r + 1) * around + n, (r + 1) * around + m] for r in range(rings - 2)]
        faces += [[r * around + n, (r + 1) * around + m, r * around + m] for r in range(rings - 2)]
        faces.append([last, (rings - 2) * around + m, (rings - 2) * around + n])
    return vertices, np.array(faces)


def reach_scene() -> Scene:
    """A cyst in liver, and a vessel aslant above it, whose place in the picture says on which side of the cyst it is."""
    mark = _sphere(_MARK_MM, _MARK_RADIUS_MM)
    along = np.array([1.0, 1.0, 0.0]) / np.sqrt(2)
    across = np.array([1.0, -1.0, 0.0]) / np.sqrt(2)
    axes = np.stack([across, np.cross(along, across), along])
    middle = np.array([0.0, 0.0, _VESSEL_DEPTH_MM])

    def blunt(polar: float) -> float:
        return 1.0 if 0.3 < polar < np.pi - 0.3 else 0.6

    vessel = _revolved(blunt, np.cos, middle, axes, _VESSEL_RADIUS_MM, 2.5 * _REACH_MM)
    return Scene([(*mark, "amniotic_fluid", 2), (*vessel, "blood", 1)], background="liver")


@cache
def _shared() -> Station:
    """The phantom, whose scene stays loaded: environments, and processes that are forked, share its memory."""
    probe = {"kind": "linear", "width_mm": 60.0, "depth_mm": 80.0, "frequency_mhz": 5.0, "focus_mm": 50.0}
    image = {"gain_db": 30.0, "tgc_db_per_cm": 5.5}
    station = Station.from_dict({"probe": probe, "image": image}, scene=reach_scene())
    station.prepare()
    return station


class ReachEnv(ProbeEnv):
    """`insonify/Reach-v0`: a cyst must come to the middle of the picture.

    An action is a displacement of the probe along x and y, -1 to 1 of `step_mm`. The reward is the fall of the distance
    to the cyst, less the path. An episode ends within `near_mm` of it.
    """

    def __init__(
        self,
        *,
        maps: bool = False,
        quality: Quality = "fast",
        size: tuple[int, int] = (64, 64),
        step_mm: float = 4.0,
        near_mm: float = 2.0,
        weights: RewardWeights | None = None,
        render_mode: str | None = None,
    ) -> None:
        """`size` is the picture's height and width."""
        if not 0 < near_mm <= 10:
            raise InputError(f"near_mm is {near_mm}; it must be above 0 and at most 10")
        station = _shared().copy(width=size[1], height=size[0], scanlines=48, samples=384)
        super().__init__(station, 2, Steps(step_mm, 0.0), quality, maps, weights or RewardWeights(), render_mode)
        self._near_mm = near_mm

    def _start(self) -> Pose:
        while True:
            x, y = self.np_random.uniform(-_REACH_MM, _REACH_MM, 2)
            if np.hypot(x, y) > 3 * self._near_mm:
                return Pose((x, y, 0))

    def _move(self, action: Action) -> float:
        before = self._pose
        x, y, _ = before.position_mm
        way = np.array([x, y]) + self._steps.mm * action.astype(np.float64)
        x, y = np.clip(way, -_REACH_MM, _REACH_MM)
        self._pose = Pose((x, y, 0))
        return moved_mm(before, self._pose)

    def _measure(self) -> Measured:
        x, y, _ = self._pose.position_mm
        distance_mm = float(np.hypot(x - _MARK_MM[0], y - _MARK_MM[1]))
        return Measured(distance_mm / _SCALE_MM, distance_mm <= self._near_mm, {"distance_mm": distance_mm})
