"""Standard planes of a scene."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

from . import _insonify
from ._errors import InputError
from ._pose import Pose, PoseLike, as_pose

_Point = tuple[float, float, float]


@dataclass(frozen=True)
class Tolerances:
    """Limits within which a plane counts as found."""

    angle_deg: float
    """Largest angle between image plane and standard plane."""
    distance_mm: float
    """Largest distance of the plane's centre from the image plane."""
    in_plane_deg: float | None
    """Largest angle in the image to the horizontal; None accepts any."""
    centring_mm: float
    """Largest distance of the centre from the image's middle line."""
    depth_mm: tuple[float, float]
    """Smallest and largest depth of the centre below the probe's face."""


@dataclass(frozen=True)
class View:
    """A view of a plane."""

    name: str
    """Name, such as `left`; empty if there is only one."""
    centre_mm: _Point
    """Centre of the target, in the plane."""
    normal: _Point
    """Normal of the plane; its sign is irrelevant."""
    pose: Pose | None
    """Pose of a probe on the skin that shows the view; None if the way to the probe does not meet the skin."""


@dataclass(frozen=True)
class Offset:
    """Offset of an image from a plane's nearest view, by the measures of `insonify score`."""

    view: int
    """Index of the nearest view."""
    angle_deg: float
    """Angle between the planes, 0 to 90."""
    distance_mm: float
    """Distance of the view's centre from the image plane."""
    in_plane_deg: float
    """Angle in the image between the view's lateral direction and the horizontal."""
    centring_mm: float
    """Distance of the view's centre from the image's middle line."""
    depth_mm: float
    """Depth of the view's centre below the probe's face."""
    landmarks_seen: int
    """Landmarks of the view in the image."""
    cost: float
    """Largest ratio of a deviation to its tolerance: at most 1 if the view is shown."""

    @property
    def shown(self) -> bool:
        """Whether the image shows the plane."""
        return self.cost <= 1.0


@dataclass(frozen=True)
class Touch:
    """Contact of the probe with the skin."""

    part: float
    """Part of the face that is coupled to the body, 0 to 1."""
    press_mm: float | None
    """Depth of the face's centre below the skin; negative for a gap; None if the skin is more than 30 mm away."""
    on_skin: bool
    """Whether a score counts the probe as on the skin."""


class StandardPlane:
    """A standard plane, one of a trainee's targets."""

    def __init__(self, core: _insonify.Planes, entry: dict[str, Any]) -> None:
        """A plane of the file beside a scene."""
        self._core = core
        self.name: str = entry["name"]
        self.title: str = entry["title"]
        limits = entry["tolerances"]
        self.tolerances = Tolerances(
            limits["angle_deg"],
            limits["distance_mm"],
            limits.get("in_plane_deg"),
            limits["centring_mm"],
            (limits["depth_mm"][0], limits["depth_mm"][1]),
        )
        self.views: tuple[View, ...] = tuple(_view(view) for view in entry["views"])

    @property
    def pose(self) -> Pose:
        """Pose of a probe on the skin that shows the plane: that of its first view with one."""
        for view in self.views:
            if view.pose is not None:
                return view.pose
        raise InputError(f"the plane {self.name} has no pose: the way to the probe does not meet the skin")

    def offset(self, pose: PoseLike) -> Offset:
        """Offset of the image at `pose` from the nearest view."""
        view, text = self._core.offset(self.name, as_pose(pose).components)
        return Offset(view=view, **json.loads(text))

    def __repr__(self) -> str:
        return f"<insonify.StandardPlane {self.name}: {self.title}>"


class StandardPlanes(Mapping[str, StandardPlane]):
    """Standard planes of a station's scene by name, in the order of an examination."""

    HOLD_S: float = _insonify.Planes.hold_s
    """Time for which a plane must be held to be found, s."""

    def __init__(self, core: _insonify.Planes) -> None:
        """Planes of the extension module."""
        self._core = core
        self._planes = {entry["name"]: StandardPlane(core, entry) for entry in json.loads(core.json())["planes"]}

    def touch(self, pose: PoseLike) -> Touch:
        """Contact of the station's probe with the skin at `pose`."""
        return Touch(*self._core.touch(as_pose(pose).components))

    def __getitem__(self, name: str) -> StandardPlane:
        try:
            return self._planes[name]
        except KeyError:
            raise KeyError(f"no plane `{name}`; the planes are {', '.join(self._planes)}") from None

    def __iter__(self) -> Iterator[str]:
        return iter(self._planes)

    def __len__(self) -> int:
        return len(self._planes)

    def __repr__(self) -> str:
        return f"<insonify.StandardPlanes: {', '.join(self._planes)}>"


def _view(entry: dict[str, Any]) -> View:
    pose = entry.get("pose")
    centre, normal = entry["centre_mm"], entry["normal"]
    return View(
        entry.get("name", ""),
        (centre[0], centre[1], centre[2]),
        (normal[0], normal[1], normal[2]),
        None if pose is None else as_pose(pose),
    )
