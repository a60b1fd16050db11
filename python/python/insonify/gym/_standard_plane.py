"""Finding a standard plane."""

from __future__ import annotations

import numpy as np

from .._errors import InputError
from .._planes import Offset, StandardPlanes, Touch
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
    rotation_vector,
    shared_station,
    within,
)

# An error beyond so many tolerances is no worse.
_ERROR_MAX = 20.0


class StandardPlaneEnv(ProbeEnv):
    """`insonify/StandardPlane-v0`: the probe must show a standard plane and hold it for a second.

    An action is a twist in the probe's frame: displacements along x, y, z and rotations about them, or with
    `action="pose"` a pose within the limits about the start, to which the probe moves by at most a step. The hand keeps
    the face on the skin. The reward is the fall of the error (angle, distance, angle in the picture and centring, each
    over its tolerance, their mean), less the path and time off the skin. An episode ends when the plane is found as
    `insonify score` finds it.
    """

    def __init__(
        self,
        plane: str = "head",
        *,
        station: Station | str = "obstetric",
        action: str = "twist",
        maps: bool = False,
        quality: Quality = "fast",
        size: tuple[int, int] = (84, 84),
        steps_per_s: float = 10.0,
        step_mm: float = 4.0,
        step_deg: float = 4.0,
        start_mm: float = 40.0,
        start_deg: float = 30.0,
        reach_mm: float = 120.0,
        reach_deg: float = 75.0,
        on_skin: bool = True,
        weights: RewardWeights | None = None,
        render_mode: str | None = None,
    ) -> None:
        """`size` is the picture's height and width, `start_*` how far from the plane episodes begin, `reach_*` how far
        from it the probe may go. Without `on_skin` the agent must keep contact itself."""
        if action not in ("twist", "pose"):
            raise InputError(f"action is {action!r}; it must be 'twist' or 'pose'")
        if not steps_per_s > 0:
            raise InputError(f"steps_per_s is {steps_per_s}; it must be above 0")
        base = shared_station(station) if isinstance(station, str) else station
        small = base.copy(width=size[1], height=size[0], scanlines=64, samples=640)
        super().__init__(small, 6, Steps(step_mm, step_deg), quality, maps, weights or RewardWeights(), render_mode)
        self._planes: StandardPlanes = small.planes
        if plane not in self._planes:
            raise InputError(f"the scene has no plane `{plane}`; its planes are {', '.join(self._planes)}")
        self._plane = self._planes[plane]
        self._home = self._plane.pose
        self._absolute, self._on_skin = action == "pose", on_skin
        self._start_limits, self._reach = (start_mm, start_deg), (reach_mm, reach_deg)
        self._hold_steps = max(1, int(np.ceil(StandardPlanes.HOLD_S * steps_per_s)))
        self._held = 0
        self._start_pose = self._home

    def _start(self) -> Pose:
        self._held = 0
        # A way that meets no skin is drawn again; the plane itself is on it.
        for _ in range(100):
            mm, deg = self._start_limits
            direction = self.np_random.uniform(-1, 1, 2)
            turn = np.deg2rad(deg) * self.np_random.uniform(-1, 1, 3)
            moved = self._home @ Pose((mm * direction[0], mm * direction[1], 0), quaternion(turn))
            pose = self._pressed(moved)
            if self._touch(pose).on_skin:
                break
        else:
            pose = self._home
        self._start_pose = pose
        return pose

    def _move(self, action: Action) -> float:
        before = self._pose
        if self._absolute:
            mm, deg = self._reach
            target = self._start_pose @ Pose(mm * action[:3], quaternion(np.deg2rad(deg) * action[3:]))
            way = self._pose.inverse() @ target
            steps = np.array([self._steps.mm] * 3 + [np.deg2rad(self._steps.deg)] * 3)
            twist = np.concatenate([way.position_mm, rotation_vector(way)]) / steps
            # The whole way is scaled, so that the probe goes straight.
            twist = twist / max(1.0, float(np.abs(twist).max()))
        else:
            twist = action.astype(np.float64)
        pose = self._twisted(before, twist)
        pose = self._pressed(pose) if self._on_skin else pose
        if within(pose, self._home, *self._reach):
            self._pose = pose
        return moved_mm(before, self._pose)

    def _touch(self, pose: Pose) -> Touch:
        return self._planes.touch(pose)

    def _measure(self) -> Measured:
        offset = self._plane.offset(self._pose)
        self._held = self._held + 1 if offset.shown and self._touch(self._pose).on_skin else 0
        measures = {
            "angle_deg": offset.angle_deg,
            "distance_mm": offset.distance_mm,
            "cost": offset.cost,
            "held": self._held,
        }
        # The start counts as a moment, a second has one more of them than steps.
        return Measured(self._tolerances_off(offset), self._held > self._hold_steps, measures)

    def _tolerances_off(self, offset: Offset) -> float:
        limits = self._plane.tolerances
        parts = [
            offset.angle_deg / limits.angle_deg,
            offset.distance_mm / limits.distance_mm,
            offset.centring_mm / limits.centring_mm,
        ]
        if limits.in_plane_deg is not None:
            parts.append(offset.in_plane_deg / limits.in_plane_deg)
        return float(np.mean(np.minimum(parts, _ERROR_MAX)))
