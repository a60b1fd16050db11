"""The tracked needle of a station."""

from __future__ import annotations

import json
from dataclasses import dataclass
from typing import Literal, TypeAlias

import numpy as np

from . import _insonify
from ._errors import InputError
from ._pose import Pose, PoseLike, as_pose

NeedleLike: TypeAlias = PoseLike | Literal[False]
"""A pose of the needle, or False for a frame without it."""


@dataclass(frozen=True)
class Needle:
    """Needle of a station, its table `[needle]`."""

    gauge: int
    """Gauge."""
    diameter_mm: float
    """Outer diameter by gauge, mm."""
    length_mm: float
    """Length from hub to tip, mm."""
    bevel_deg: float
    """Angle between the bevel's facet and the shaft, degrees; 90 is a blunt end."""
    kind: str
    """plain, etched, or pointer, which has no echo."""
    pose: Pose | None
    """Pose at which the needle stands, `scene_from_needle`; None if only a tracker says where it is.

    The origin is the tip, z runs along the shaft from hub to tip, x to the side that the bevel's facet faces.
    """


def needle_of(core: _insonify.Station) -> Needle | None:
    """The needle of a station, None without one."""
    text, pose = core.needle_json(), core.needle_pose
    return None if text is None else Needle(**json.loads(text), pose=None if pose is None else as_pose(pose))


def as_needle(value: NeedleLike | None) -> Pose | Literal[False] | None:
    """A checked pose, False or None."""
    if value is None or value is False:
        return value
    if isinstance(value, (bool, np.bool_)):
        raise InputError(f"needle is {value!r}; it must be a pose, False for a frame without the needle, or None")
    return as_pose(value)


def shown_needle(value: Pose | Literal[False] | None, own: Needle | None) -> Pose | None:
    """Pose of the needle in a frame of a station whose needle is `own`."""
    if value is None:
        return None if own is None else own.pose
    return None if value is False else value


def needle_argument(value: Pose | Literal[False] | None) -> tuple[float, ...] | Literal[False] | None:
    """The needle of a frame as the extension module takes it."""
    return value.components if isinstance(value, Pose) else value
