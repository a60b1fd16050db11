"""Poses of the tools."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, SupportsFloat, TypeAlias, cast

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import _insonify
from ._errors import PoseError

if TYPE_CHECKING:
    from scipy.spatial.transform import Rotation

# Largest error of a rotation matrix's columns.
_ORTHONORMAL = 1e-4


class Pose:
    """Pose of a tool in the scene, `scene_from_probe` or `scene_from_needle`.

    The probe's origin is the centre of its face. Its z axis looks into the body, x runs along the scanlines' fan, y
    across the image plane. The needle's origin is its tip. Its z axis runs along the shaft from hub to tip, x to the
    side that the bevel's facet faces.

    >>> Pose((0, -58, 77), (0, 1, 0, 0))
    Pose(position_mm=(0.0, -58.0, 77.0), quaternion_wxyz=(0.0, 1.0, 0.0, 0.0))
    """

    __slots__ = ("_components",)
    _components: tuple[float, float, float, float, float, float, float]

    def __init__(
        self,
        position_mm: Sequence[SupportsFloat] | NDArray[Any] = (0.0, 0.0, 0.0),
        quaternion_wxyz: Sequence[SupportsFloat] | NDArray[Any] = (1.0, 0.0, 0.0, 0.0),
    ) -> None:
        """Origin of the tool in mm, and the unit quaternion w, x, y, z that turns the tool's axes into scene axes."""
        numbers = _numbers(position_mm, 3, "position_mm") + _numbers(quaternion_wxyz, 4, "quaternion_wxyz")
        self._components = _insonify.checked_pose(numbers)

    @property
    def position_mm(self) -> tuple[float, float, float]:
        """Origin of the tool in the scene, mm."""
        return self._components[:3]

    @property
    def quaternion_wxyz(self) -> tuple[float, float, float, float]:
        """Unit quaternion that turns the tool's axes into scene axes."""
        return self._components[3:]

    @property
    def components(self) -> tuple[float, float, float, float, float, float, float]:
        """x, y, z, qw, qx, qy, qz, as `insonify render --pose` takes them."""
        return self._components

    @property
    def matrix(self) -> NDArray[np.float64]:
        """4 × 4 matrix that takes points of the tool's frame to the scene, both in mm."""
        w, x, y, z = self.quaternion_wxyz
        matrix = np.eye(4)
        matrix[:3, :3] = [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
        matrix[:3, 3] = self.position_mm
        return matrix

    @classmethod
    def from_matrix(cls, matrix: ArrayLike) -> Pose:
        """Pose of a 4 × 4 matrix (or its upper three rows) of a rotation and a position in mm."""
        found = _array(matrix, "the matrix")
        if found.shape not in ((4, 4), (3, 4)):
            raise PoseError(f"the matrix has the shape {found.shape}; it must be (4, 4) or (3, 4)")
        if not np.isfinite(found).all():
            raise PoseError("the matrix holds a number that is not finite")
        if found.shape == (4, 4) and not np.allclose(found[3], (0, 0, 0, 1), atol=1e-9):
            raise PoseError(f"the last row of the matrix is {found[3].tolist()}; it must be [0, 0, 0, 1]")
        rotation = found[:3, :3]
        error = float(np.abs(rotation.T @ rotation - np.eye(3)).max())
        if error > _ORTHONORMAL or np.linalg.det(rotation) < 0:
            raise PoseError(f"the matrix is no rotation: its axes are off by {error:.2g}, or left-handed")
        return cls(found[:3, 3], _quaternion(rotation))

    @classmethod
    def from_rotation(cls, position_mm: Sequence[SupportsFloat] | NDArray[Any], rotation: Rotation) -> Pose:
        """Pose of a position in mm and a rotation of SciPy, which turns the tool's axes into scene axes."""
        quaternion = np.asarray(rotation.as_quat(), dtype=np.float64)
        if quaternion.shape != (4,):
            raise PoseError(f"the rotation has the shape {quaternion.shape[:-1]}; it must be a single rotation")
        x, y, z, w = quaternion.tolist()
        return cls(position_mm, (w, x, y, z))

    @classmethod
    def looking(
        cls,
        position_mm: Sequence[SupportsFloat] | NDArray[Any],
        direction: Sequence[SupportsFloat] | NDArray[Any],
        lateral: Sequence[SupportsFloat] | NDArray[Any] = (1.0, 0.0, 0.0),
    ) -> Pose:
        """Pose whose z axis points along `direction`: into the body for a probe, from hub to tip for a needle.

        The x axis is as close as possible to `lateral`.

        >>> Pose.looking((0, 0, 30), (0, 0, 2)) == Pose((0, 0, 30))
        True
        """
        position, along = _numbers(position_mm, 3, "position_mm"), _numbers(direction, 3, "direction")
        return _of(_insonify.looking_pose(position, along, _numbers(lateral, 3, "lateral")))

    def rotation(self) -> Rotation:
        """The rotation as one of SciPy, which must be installed."""
        from scipy.spatial.transform import Rotation

        w, x, y, z = self.quaternion_wxyz
        return Rotation.from_quat((x, y, z, w))

    def inverse(self) -> Pose:
        """The pose `probe_from_scene`."""
        return _of(_insonify.inverse_pose(self._components))

    def __matmul__(self, other: Pose) -> Pose:
        """`a_from_c` of `a_from_b @ b_from_c`: a pose moved in the tool's own frame."""
        if not isinstance(other, Pose):
            return NotImplemented
        return _of(_insonify.pose_product(self._components, other._components))

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Pose) and self._components == other._components

    def __hash__(self) -> int:
        return hash(self._components)

    def __repr__(self) -> str:
        return f"Pose(position_mm={self.position_mm}, quaternion_wxyz={self.quaternion_wxyz})"

    def __reduce__(self) -> tuple[Any, ...]:
        return (_of, (self._components,))


PoseLike: TypeAlias = Pose | Sequence[SupportsFloat] | NDArray[Any]
"""A pose, its seven numbers x, y, z, qw, qx, qy, qz, or a 4 × 4 matrix."""


def _of(components: tuple[float, float, float, float, float, float, float]) -> Pose:
    pose = Pose.__new__(Pose)
    pose._components = components
    return pose


def as_pose(value: PoseLike) -> Pose:
    """The pose of seven numbers or of a matrix; a pose stays as it is."""
    if isinstance(value, Pose):
        return value
    numbers = _array(value, "a pose")
    if numbers.ndim == 2:
        return Pose.from_matrix(numbers)
    if numbers.shape != (7,):
        what = "a Pose, its seven numbers x, y, z, qw, qx, qy, qz, or a 4 x 4 matrix"
        raise PoseError(f"a pose of the shape {numbers.shape}; it must be {what}")
    return Pose(numbers[:3], numbers[3:])


def _array(value: object, what: str) -> NDArray[np.float64]:
    try:
        return np.asarray(value, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise PoseError(f"{what} is not of numbers: {error}") from None


def _numbers(value: object, count: int, what: str) -> tuple[float, ...]:
    found = _array(value, what)
    if found.shape != (count,):
        raise PoseError(f"{what} has the shape {found.shape}; it must be {count} numbers")
    return cast("tuple[float, ...]", tuple(found.tolist()))


def _quaternion(rotation: NDArray[np.float64]) -> NDArray[np.float64]:
    """Quaternion w, x, y, z of a rotation matrix: that of its largest component, for accuracy."""
    m = rotation
    squares = np.array(
        [
            1 + m[0, 0] + m[1, 1] + m[2, 2],
            1 + m[0, 0] - m[1, 1] - m[2, 2],
            1 - m[0, 0] + m[1, 1] - m[2, 2],
            1 - m[0, 0] - m[1, 1] + m[2, 2],
        ]
    )
    products = np.array(
        [
            [squares[0], m[2, 1] - m[1, 2], m[0, 2] - m[2, 0], m[1, 0] - m[0, 1]],
            [m[2, 1] - m[1, 2], squares[1], m[1, 0] + m[0, 1], m[0, 2] + m[2, 0]],
            [m[0, 2] - m[2, 0], m[1, 0] + m[0, 1], squares[2], m[2, 1] + m[1, 2]],
            [m[1, 0] - m[0, 1], m[0, 2] + m[2, 0], m[2, 1] + m[1, 2], squares[3]],
        ]
    )
    quaternion: NDArray[np.float64] = products[int(squares.argmax())]
    return quaternion / np.linalg.norm(quaternion)
