"""Exercises with a needle, and scores of their sessions."""

from __future__ import annotations

import json
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any, NamedTuple, cast

import numpy as np

from . import _insonify
from ._errors import InputError
from ._planes import Touch
from ._pose import Pose, PoseLike, as_pose

_Point = tuple[float, float, float]
_Components = tuple[float, float, float, float, float, float, float]
_Row = tuple[float, "_Components | None", "_Components | None"]


@dataclass(frozen=True)
class Ball:
    """A ball in the scene."""

    centre_mm: _Point
    """Centre."""
    radius_mm: float
    """Radius."""


class NeedleSample(NamedTuple):
    """Poses of both tools at one moment of a session."""

    time_s: float
    """Time since the session's start, which is also the time of a moving scene."""
    probe: PoseLike | None
    """Pose of the probe; None while it is not tracked."""
    needle: PoseLike | None
    """Pose of the needle; None while it is not tracked."""


@dataclass(frozen=True)
class Moment:
    """A moment on the tip's way."""

    time_s: float
    """Time since the session's start."""
    position_mm: _Point
    """Position of the tip in the scene."""


@dataclass(frozen=True)
class NeedleEvent:
    """An event of the tip; docs/needle.md defines the kinds."""

    time_s: float
    """Time since the session's start."""
    kind: str
    """entered, re-entered, left, target-reached, out-of-slice or in-slice."""
    position_mm: _Point
    """Place of the tip in the scene."""
    forbidden: bool
    """Whether the exercise forbids the surface."""
    surface: str | None = None
    """Name of the surface that was crossed; None for other events."""
    tissue: str | None = None
    """Name of its tissue."""
    punctures: int | None = None
    """Punctures of the surface so far."""

    @property
    def is_forbidden_puncture(self) -> bool:
        """Whether the tip entered a surface that the exercise forbids."""
        return self.forbidden and self.kind != "left"


@dataclass(frozen=True)
class NeedleStep:
    """The needle after a sample of a session."""

    events: tuple[NeedleEvent, ...]
    """Events since the last sample, in order."""
    distance_mm: float | None
    """Distance of the tip from the target at rest, 0 inside; None without a needle."""
    in_tissue: bool
    """Whether the tip is inside a surface of the scene."""
    visible: bool
    """Whether the picture shows the tip: it is in the sector, and near enough to the image plane."""
    offset_mm: float | None
    """Distance of the tip from the image plane; None without both tools."""
    angle_deg: float | None
    """Angle between shaft and image plane; None without both tools."""
    reached: Moment | None
    """Moment at which the target was first reached; None if it was not yet."""


@dataclass(frozen=True)
class Deduction:
    """Points lost by one criterion."""

    criterion: str
    """Name of the criterion, such as `forbidden`."""
    points: float
    """Points lost."""
    reason: str
    """Value that lost them, in words."""


@dataclass(frozen=True)
class NeedleScore:
    """Score of a session, with the numbers of `insonify score`; docs/needle.md defines them. Its text is the command's."""

    points: float | None
    """Points, 0 to 100; None if nothing could be judged."""
    not_judged: str | None
    """Reason why nothing could be judged."""
    deductions: tuple[Deduction, ...]
    """Points lost."""
    entry: Moment | None
    """Entry into the first surface."""
    entry_surface: str | None
    """Name of that surface, if its crossing was seen."""
    right_entry: bool | None
    """Whether the entry was where the exercise wants it; None without an entry or such a wish."""
    reached: Moment | None
    """Moment at which the target was first reached."""
    time_to_target_s: float | None
    """Time from the entry to the target."""
    tissue_s: float
    """Time of the tip in tissue."""
    path_mm: float
    """Path of the tip in tissue in the attempt."""
    straightness: float
    """Distance between the ends of that path over its length, 0 to 1."""
    angle_deg: float | None
    """Mean angle between shaft and image plane in the attempt."""
    offset_mm: float | None
    """Mean distance of the tip from the image plane in the attempt."""
    visible: float
    """Share of the attempt with the tip visible, 0 to 1."""
    visible_at_end: bool
    """Whether the tip was visible near the deepest position of the last pass."""
    passes: int
    """Number of passes."""
    sideways_mm: float
    """Largest distance of the tip from the line through entry and target."""
    final_mm: float
    """Distance between the target and the deepest position of the last pass; 0 in the target."""
    events: tuple[NeedleEvent, ...]
    """Events of the whole session, in order."""
    record: dict[str, Any]
    """What `insonify score --json` has under `needle`."""
    text: str
    """What `insonify score` prints."""

    @property
    def forbidden(self) -> tuple[NeedleEvent, ...]:
        """Punctures of surfaces that the exercise forbids."""
        return tuple(event for event in self.events if event.is_forbidden_puncture)

    def __str__(self) -> str:
        return self.text

    def __repr__(self) -> str:
        points = "not judged" if self.points is None else f"{self.points:.0f} of 100 points"
        return f"<insonify.NeedleScore of {self.record['exercise']}: {points}>"


@dataclass(frozen=True)
class ExercisePlan:
    """How a simulated hand does an exercise."""

    aim_mm: _Point
    """Point of the target at which the needle aims."""
    entry_mm: _Point
    """Point of the skin at which the needle enters."""
    probe: Pose
    """Pose of the probe on the skin that shows the aim, and with the approach in-plane the whole way."""

    @property
    def needle(self) -> Pose:
        """Pose of the needle with its tip at the entry."""
        way = np.array(self.aim_mm) - np.array(self.entry_mm)
        return Pose.looking(self.entry_mm, way, self.probe.matrix[:3, 0])


class NeedleSession:
    """A session that goes on: samples come one by one, and each tells what the tip did."""

    def __init__(self, core: _insonify.NeedleSession) -> None:
        """A session of the extension module; `Exercise.session` begins one."""
        self._core = core

    def add(self, time_s: float, probe: PoseLike | None, needle: PoseLike | None) -> NeedleStep:
        """Adds a sample. Times must not fall. After a gap of 0.25 s the tip is placed anew, without events."""
        step = json.loads(self._core.add(*_row(NeedleSample(time_s, probe, needle))))
        in_slice: dict[str, Any] = step["slice"] or {}
        return NeedleStep(
            tuple(_event(event) for event in step["events"]),
            step["distance_mm"],
            step["in_tissue"],
            in_slice.get("visible", False),
            in_slice.get("offset_mm"),
            in_slice.get("angle_deg"),
            _moment(step["reached"]),
        )

    def score(self) -> NeedleScore:
        """Score of the samples so far."""
        return _score(*self._core.score())


class Exercise:
    """Exercise of a station, its table `[exercise]`, in the station's scene."""

    def __init__(self, core: _insonify.Exercise) -> None:
        """An exercise of the extension module; `Station.exercise` has it."""
        self._core = core
        entry = json.loads(core.json())
        self.name: str = entry["name"]
        """Display name."""
        self.target: str | Ball = cast("str | Ball", _region(entry["target"]))
        """Surface that the tip is to reach, or a ball."""
        self.entry: str | Ball | None = _region(entry["entry"])
        """Surface that must be entered first, or a ball in which the tip must enter; None: anywhere."""
        self.forbidden: tuple[str, ...] = tuple(entry["forbidden"])
        """Surfaces that must be spared; a * at the end matches any suffix."""
        self.approach: str = entry["approach"]
        """in-plane, out-of-plane or any."""
        self.time_s: float = entry["time_s"]
        """Time from the entry to the target that earns all points."""
        self._plan: ExercisePlan | None = None

    @property
    def plan(self) -> ExercisePlan:
        """How a simulated hand would do it. The station needs a pose of its own, on the body near the target."""
        if self._plan is None:
            aim, entry, probe = self._core.plan()
            self._plan = ExercisePlan(_point(aim), _point(entry), as_pose(probe))
        return self._plan

    def score(self, samples: Iterable[NeedleSample | tuple[float, PoseLike | None, PoseLike | None]]) -> NeedleScore:
        """Score of a session: samples (time_s, pose of the probe, pose of the needle) in ascending time.

        It has the numbers that `insonify score` gives for a recording with these poses.
        """
        return _score(*self._core.score([_row(sample) for sample in samples]))

    def session(self) -> NeedleSession:
        """Begins a session whose samples come one by one."""
        return NeedleSession(self._core.session())

    def hand(self, skill: str = "expert", *, seed: int = 0) -> list[NeedleSample]:
        """Samples at 60 Hz of simulated hands that do the exercise: expert, trained or novice; the same for a seed."""
        if not isinstance(seed, (int, np.integer)) or not 0 <= int(seed) < 2**64:
            raise InputError(f"seed is {seed!r}; it must be a whole number of 64 bits")
        found: list[NeedleSample] = []
        for time_s, probe, needle in self._core.hand(str(skill), int(seed)):
            placed = [None if pose is None else as_pose(pose) for pose in (probe, needle)]
            found.append(NeedleSample(time_s, *placed))
        return found

    def touch(self, pose: PoseLike) -> Touch:
        """Contact of the station's probe with the skin at `pose`."""
        return Touch(*self._core.touch(as_pose(pose).components))

    def __repr__(self) -> str:
        return f"<insonify.Exercise {self.name}: {self.target}, {self.approach}>"


def _row(sample: NeedleSample | tuple[float, PoseLike | None, PoseLike | None]) -> _Row:
    if not isinstance(sample, (tuple, list)) or len(sample) != 3:
        raise InputError(f"a sample is {sample!r}; it must be (time_s, pose of the probe, pose of the needle)")
    time_s, probe, needle = sample
    try:
        time_s = float(time_s)
    except (TypeError, ValueError):
        raise InputError(f"time_s of a sample is {time_s!r}; it must be a number of seconds") from None
    placed = [None if pose is None else as_pose(pose).components for pose in (probe, needle)]
    return time_s, placed[0], placed[1]


def _point(numbers: Iterable[float]) -> _Point:
    x, y, z = numbers
    return x, y, z


def _region(region: dict[str, Any] | None) -> str | Ball | None:
    if region is None:
        return None
    if "surface" in region:
        return str(region["surface"])
    return Ball(_point(region["ball"]["centre_mm"]), region["ball"]["radius_mm"])


def _moment(moment: dict[str, Any] | None) -> Moment | None:
    return None if moment is None else Moment(moment["time_s"], _point(moment["position_mm"]))


def _event(event: dict[str, Any]) -> NeedleEvent:
    values = dict(event)
    values["position_mm"] = _point(event["position_mm"])
    return NeedleEvent(**values)


def _score(record: str, text: str) -> NeedleScore:
    found: dict[str, Any] = json.loads(record)
    values = {key: value for key, value in found.items() if key != "exercise"}
    values["not_judged"] = found.get("not_judged")
    values["deductions"] = tuple(Deduction(**deduction) for deduction in found["deductions"])
    values["events"] = tuple(_event(event) for event in found["events"])
    for moment in ("entry", "reached"):
        values[moment] = _moment(found[moment])
    return NeedleScore(**values, record=found, text=text)
