"""What the environments share: tools that move in small steps, and the picture."""

from __future__ import annotations

from abc import abstractmethod
from dataclasses import dataclass
from functools import cache
from typing import Any, NamedTuple

import gymnasium
import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from .._errors import InputError
from .._frame import Frame
from .._planes import Touch
from .._pose import Pose
from .._station import Quality, Station

Observation = NDArray[np.uint8]
Action = NDArray[np.float32]

# Depth of the face in the skin, mm, as at the poses of planes.
_PRESS_MM = 2.5

# Attenuation spans ten decades; its fourth root fits 8 bits, as in data sets.
_ATTENUATION_POWER = 0.25


@dataclass(frozen=True)
class RewardWeights:
    """Weights of the parts of a reward."""

    progress: float = 1.0
    """For each unit by which the error falls."""
    path_per_mm: float = 0.002
    """Taken for each mm of the face's path."""
    off_skin: float = 0.05
    """Taken for each step off the skin."""
    found: float = 10.0
    """Given once, at the end of an episode that reached its aim."""
    reached: float = 5.0
    """Given once, when the needle's tip first is in the target, seen or not."""
    forbidden: float = 10.0
    """Taken for a puncture of a surface that the exercise forbids, which ends the episode."""


@dataclass(frozen=True)
class Steps:
    """Limits of one step, for an action of ±1."""

    mm: float
    """Displacement along each axis."""
    deg: float
    """Rotation about each axis."""


class Measured(NamedTuple):
    """An episode after a step."""

    error: float
    """Error whose fall is rewarded."""
    found: bool
    """Whether the aim is reached, which ends the episode."""
    measures: dict[str, Any]
    """Measures for `info`."""
    extra: float = 0.0
    """Further reward."""
    failed: bool = False
    """Whether a failure ends the episode."""


@cache
def shared_station(name: str) -> Station:
    """A station whose scene stays loaded: environments, and processes that are forked, share its memory."""
    station = Station(name)
    station.prepare()
    return station


class ProbeEnv(gymnasium.Env[Observation, Action]):
    """A probe over a station's scene. Observations are pictures [height, width, channels]."""

    metadata: dict[str, Any] = {"render_modes": ["rgb_array"], "render_fps": 10}

    def __init__(
        self, station: Station, actions: int, steps: Steps, quality: Quality, maps: bool, weights: RewardWeights,
        render_mode: str | None,
    ) -> None:  # fmt: skip
        """A station of small pictures; `actions` is the number of values of an action."""
        if render_mode not in (None, "rgb_array"):
            raise InputError(f"render_mode is {render_mode!r}; it must be None or 'rgb_array'")
        self.station = station
        self.render_mode = render_mode
        self.weights = weights
        self._steps, self._quality, self._maps = steps, quality, maps
        image = station.settings["image"]
        shape = (int(image["height"]), int(image["width"]), 3 if maps else 1)
        self.observation_space = spaces.Box(0, 255, shape, np.uint8)
        self.action_space = spaces.Box(-1.0, 1.0, (actions,), np.float32)
        self._pose = Pose()
        self._frame: Frame | None = None
        self._path_mm = 0.0
        self._error = 0.0

    @property
    def pose(self) -> Pose:
        """Pose of the probe."""
        return self._pose

    @abstractmethod
    def _start(self) -> Pose:
        """Pose at the beginning of an episode, drawn from `np_random`."""

    @abstractmethod
    def _move(self, action: Action) -> float:
        """Does an action; returns the path, mm."""

    @abstractmethod
    def _measure(self) -> Measured:
        """The episode as it is now."""

    def _touch(self, pose: Pose) -> Touch | None:
        """Contact of a probe with the skin; None if it doesn't count."""
        return None

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Observation, dict[str, Any]]:
        """Begins an episode. Episodes of one seed and the same actions are the same, bit for bit on one device."""
        super().reset(seed=seed)
        self._pose = self._start()
        self._path_mm = 0.0
        measured = self._measure()
        self._error = measured.error
        return self._observe(), self._info(measured.measures)

    def step(self, action: Action) -> tuple[Observation, float, bool, bool, dict[str, Any]]:
        """Does an action and renders."""
        wanted = np.asarray(action, dtype=np.float32)
        if wanted.shape != self.action_space.shape or not np.isfinite(wanted).all():
            raise InputError(f"the action is {action!r}; it must be {self.action_space.shape} finite numbers")
        way_mm = self._move(np.clip(wanted, -1.0, 1.0))
        self._path_mm += way_mm
        error, found, measures, extra, failed = self._measure()
        touch = self._touch(self._pose)
        reward = self.weights.progress * (self._error - error) - self.weights.path_per_mm * way_mm + extra
        if touch is not None and not touch.on_skin:
            reward -= self.weights.off_skin
        if found:
            reward += self.weights.found
        self._error = error
        return self._observe(), reward, found or failed, False, self._info(measures)

    def render(self) -> NDArray[np.uint8] | None:
        """The last picture, grey levels as colours [height, width, 3]."""
        if self.render_mode is None or self._frame is None:
            return None
        return np.repeat(self._frame.bmode[:, :, None], 3, axis=2)

    def _twisted(self, pose: Pose, twist: NDArray[np.floating[Any]]) -> Pose:
        """`pose` moved in the tool's own frame: three displacements and three rotations, -1 to 1."""
        turn = np.deg2rad(self._steps.deg) * twist[3:]
        return pose @ Pose(self._steps.mm * twist[:3], quaternion(turn))

    def _pressed(self, pose: Pose) -> Pose:
        """The pose along its axis on the skin."""
        touch = self._touch(pose)
        press_mm = None if touch is None else touch.press_mm
        return pose if press_mm is None else pose @ Pose((0, 0, _PRESS_MM - press_mm))

    def _rendered(self, seed: int) -> Frame:
        """The frame that an observation shows."""
        return self.station.render(self._pose, quality=self._quality, seed=seed, maps=self._maps, lines=False)

    def _observe(self) -> Observation:
        frame = self._rendered(int(self.np_random.integers(0, 2**32)))
        self._frame = frame
        if not self._maps:
            return frame.bmode[:, :, None]
        attenuation = np.round(255 * frame.attenuation**_ATTENUATION_POWER).astype(np.uint8)
        return np.stack([frame.bmode, frame.segmentation, attenuation], axis=2)

    def _info(self, measures: dict[str, Any]) -> dict[str, Any]:
        touch = self._touch(self._pose)
        contact = {} if touch is None else {"on_skin": touch.on_skin, "contact": touch.part}
        return {**measures, **contact, "path_mm": self._path_mm, "pose": np.array(self._pose.components)}


def moved_mm(before: Pose, after: Pose) -> float:
    """Distance between the origins of two poses."""
    return float(np.linalg.norm(np.array(after.position_mm) - np.array(before.position_mm)))


def within(pose: Pose, home: Pose, reach_mm: float, reach_deg: float) -> bool:
    """Whether a pose is at most so far from another, and turned by at most so much."""
    way = home.inverse() @ pose
    turn = float(np.linalg.norm(rotation_vector(way)))
    return moved_mm(home, pose) <= reach_mm and turn <= np.deg2rad(reach_deg)


def quaternion(rotation: NDArray[np.floating[Any]]) -> tuple[float, float, float, float]:
    """Quaternion w, x, y, z of a rotation vector, rad."""
    angle = float(np.linalg.norm(rotation))
    # The limit of sin(a/2)/a.
    scale = 0.5 if angle < 1e-9 else np.sin(angle / 2) / angle
    x, y, z = (float(part * scale) for part in rotation)
    return float(np.cos(angle / 2)), x, y, z


def rotation_vector(pose: Pose) -> NDArray[np.float64]:
    """Rotation vector of a pose, rad, on the shorter arc."""
    w, *vector = pose.quaternion_wxyz
    xyz = np.array(vector) * (1.0 if w >= 0 else -1.0)
    sine = float(np.linalg.norm(xyz))
    return 2 * xyz if sine < 1e-12 else xyz * (2 * np.arctan2(sine, abs(w)) / sine)
