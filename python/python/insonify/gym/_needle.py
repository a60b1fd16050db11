"""Bringing the tip of a needle to the target of an exercise."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from .._errors import InputError
from .._exercise import NeedleScore, NeedleSession, NeedleStep
from .._frame import Frame
from .._planes import Touch
from .._pose import Pose
from .._station import Quality, Station
from ._base import (
    Action,
    Measured,
    ProbeEnv,
    RewardWeights,
    Steps,
    moved_mm,
    quaternion,
    shared_station,
    within,
)

# Distance of the tip from the skin at the start.
_START_MM = 5.0

# Distance that counts as an error of 1.
_SCALE_MM = 10.0

# Fewest steps in a second: after a longer gap than 0.25 s a session loses the tip.
_STEPS_PER_S_MIN = 4.0

# Largest displacement and turn of the probe from where it begins.
_PROBE_REACH = (40.0, 45.0)


class NeedleEnv(ProbeEnv):
    """`insonify/Needle-v0`: the tip of the needle must reach the target of a station's exercise, seen in the picture.

    The probe rests on the skin and shows the target; the needle begins above the skin, near the way that a simulated
    hand would take. An action is a twist in the needle's own frame: displacements along x, y and z (z is the shaft) and
    rotations about them through the tip. With `move_probe` six more values are a twist of the probe, which the hand
    keeps on the skin. The reward is the fall of the tip's distance from the target in units of 10 mm, less the path,
    and a part is given when the tip first is in the target. An episode ends when it is there and the picture shows it,
    or with the puncture of a surface that the exercise forbids. Nothing resists the needle.
    """

    def __init__(
        self,
        *,
        station: Station | str = "needle_cyst",
        move_probe: bool = False,
        maps: bool = False,
        quality: Quality = "fast",
        size: tuple[int, int] = (84, 84),
        steps_per_s: float = 10.0,
        step_mm: float = 2.0,
        step_deg: float = 3.0,
        start_mm: float = 4.0,
        start_deg: float = 6.0,
        reach_mm: float = 100.0,
        reach_deg: float = 60.0,
        weights: RewardWeights | None = None,
        render_mode: str | None = None,
    ) -> None:
        """`size` is the picture's height and width, `start_*` how far from the planned way the needle begins (and the
        probe, if it moves), `reach_*` how far from it the needle may go; a step beyond does nothing."""
        if not _STEPS_PER_S_MIN <= steps_per_s <= 1000:
            raise InputError(f"steps_per_s is {steps_per_s}; it must be from {_STEPS_PER_S_MIN:g} to 1000")
        base = shared_station(station) if isinstance(station, str) else station
        if base.needle is None or base.needle.kind == "pointer":
            what = "no needle" if base.needle is None else "a pointer, which pictures do not show"
            raise InputError(f"the station has {what}: give its table `needle` a plain or an etched one")
        small = base.copy(width=size[1], height=size[0], scanlines=64)
        exercise = small.exercise
        if exercise is None:
            raise InputError("the station has no exercise: give its table `exercise` a target")
        plan = exercise.plan
        values = 12 if move_probe else 6
        super().__init__(
            small, values, Steps(step_mm, step_deg), quality, maps, weights or RewardWeights(), render_mode
        )
        self._exercise, self._move_probe = exercise, move_probe
        self._step_s = 1.0 / steps_per_s
        self._start_limits, self._reach = (start_mm, start_deg), (reach_mm, reach_deg)
        self._probe_home = plan.probe
        self._needle_home = plan.needle
        self._session: NeedleSession = exercise.session()
        self._needle = self._needle_home
        self._moments = 0
        self._forbidden = 0
        self._reached = False
        self._last: NeedleStep | None = None

    @property
    def needle(self) -> Pose:
        """Pose of the needle."""
        return self._needle

    def score(self) -> NeedleScore:
        """Score of the episode so far, as `insonify score` judges a session."""
        return self._session.score()

    def _start(self) -> Pose:
        above = self._needle_home @ Pose((0, 0, -_START_MM))
        # A start inside a surface is drawn again; the planned one is outside of all.
        for _ in range(100):
            needle = self._near(above)
            if not self._exercise.session().add(0.0, None, needle).in_tissue:
                break
        else:
            needle = above
        self._needle = needle
        probe = self._pressed(self._near(self._probe_home)) if self._move_probe else self._probe_home
        self._session = self._exercise.session()
        self._moments = self._forbidden = 0
        self._reached = False
        self._follow(probe)
        return probe

    def _near(self, pose: Pose) -> Pose:
        """A pose drawn near another one."""
        mm, deg = self._start_limits
        shift, turn = mm * self.np_random.uniform(-1, 1, 2), np.deg2rad(deg) * self.np_random.uniform(-1, 1, 3)
        return pose @ Pose((shift[0], shift[1], 0), quaternion(turn))

    def _move(self, action: Action) -> float:
        twist: NDArray[np.float64] = action.astype(np.float64)
        before = self._needle
        needle = self._twisted(before, twist[:6])
        if within(needle, self._needle_home, *self._reach):
            self._needle = needle
        path_mm = moved_mm(before, self._needle)
        if self._move_probe:
            held = self._pose
            probe = self._pressed(self._twisted(held, twist[6:]))
            if within(probe, self._probe_home, *_PROBE_REACH):
                self._pose = probe
            path_mm += moved_mm(held, self._pose)
        self._moments += 1
        self._follow(self._pose)
        return path_mm

    @property
    def _time_s(self) -> float:
        return self._moments * self._step_s

    def _follow(self, probe: Pose) -> None:
        self._last = self._session.add(self._time_s, probe, self._needle)

    def _touch(self, pose: Pose) -> Touch | None:
        return self._exercise.touch(pose) if self._move_probe else None

    def _measure(self) -> Measured:
        last = self._last
        assert last is not None and last.distance_mm is not None
        punctures = sum(event.is_forbidden_puncture for event in last.events)
        self._forbidden += punctures
        first = last.reached is not None and not self._reached
        self._reached = self._reached or first
        found = self._reached and last.distance_mm == 0 and last.visible and punctures == 0
        measures = {
            "distance_mm": last.distance_mm,
            "reached": self._reached,
            "visible": last.visible,
            "offset_mm": last.offset_mm,
            "angle_deg": last.angle_deg,
            "in_tissue": last.in_tissue,
            "forbidden": self._forbidden,
            "needle": np.array(self._needle.components),
        }
        extra = self.weights.reached * first - self.weights.forbidden * punctures
        return Measured(last.distance_mm / _SCALE_MM, found, measures, extra, punctures > 0)

    def _rendered(self, seed: int) -> Frame:
        return self.station.render(
            self._pose,
            needle=self._needle,
            quality=self._quality,
            seed=seed,
            time_s=self._time_s,
            maps=self._maps,
            lines=False,
        )
