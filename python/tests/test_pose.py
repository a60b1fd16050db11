"""Poses: conventions, conversions, and what is refused."""

from __future__ import annotations

import copy
import pickle
from typing import Any

import insonify
import numpy as np
import pytest
from insonify._pose import as_pose


def test_numbers_come_back() -> None:
    pose = insonify.Pose((1, 2, 3), (0, 1, 0, 0))
    assert pose.position_mm == (1.0, 2.0, 3.0) and pose.quaternion_wxyz == (0.0, 1.0, 0.0, 0.0)
    assert as_pose([1, 2, 3, 0, 1, 0, 0]) == pose == as_pose(np.array(pose.components))
    assert hash(pose) == hash(as_pose(pose.components)) and pose != (1, 2, 3)
    assert eval(repr(pose), {"Pose": insonify.Pose}) == pose
    assert pickle.loads(pickle.dumps(pose)) == pose == copy.deepcopy(pose)


@pytest.mark.parametrize("seed", range(8))
def test_matrices_and_rotations_of_scipy_are_the_same_pose(seed: int) -> None:
    rotations = pytest.importorskip("scipy.spatial.transform")
    rotation = rotations.Rotation.random(random_state=seed)
    pose = insonify.Pose.from_rotation((10, -20, 30), rotation)
    matrix = pose.matrix
    assert np.allclose(matrix[:3, :3], rotation.as_matrix(), atol=1e-12)
    for given in (matrix, matrix[:3]):
        again = insonify.Pose.from_matrix(given)
        assert np.allclose(again.matrix, matrix, atol=1e-12)
    assert np.allclose(pose.rotation().as_matrix(), rotation.as_matrix(), atol=1e-12)
    assert np.allclose((pose @ pose.inverse()).matrix, np.eye(4), atol=1e-12)
    other = insonify.Pose.from_rotation((1, 2, 3), rotations.Rotation.random(random_state=seed + 100))
    assert np.allclose((pose @ other).matrix, matrix @ other.matrix, atol=1e-9)


def test_half_turns_keep_their_accuracy() -> None:
    for axis in np.eye(3):
        quaternion = (0.0, *axis)
        pose = insonify.Pose((0, 0, 0), quaternion)
        assert np.allclose(np.abs(insonify.Pose.from_matrix(pose.matrix).quaternion_wxyz), np.abs(quaternion))


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ((float("nan"), 0, 0, 1, 0, 0, 0), "`x` is NaN"),
        ((0, 0, float("inf"), 1, 0, 0, 0), "`z` is inf"),
        ((0, 0, 0, 1, 1, 0, 0), "norm 1.41"),
        ((1e6, 0, 0, 1, 0, 0, 0), "is the unit wrong"),
        ((0, 0, 0), r"shape \(3,\)"),
        ("abc", "not of numbers"),
        (np.eye(3), r"shape \(3, 3\)"),
        (np.zeros((4, 4)), "last row"),
        (2 * np.eye(4)[:3], "no rotation"),
        (np.diag([1, 1, -1, 1]), "no rotation"),
        (np.full((4, 4), np.nan), "not finite"),
        (None, "shape|not of numbers"),
    ],
)
def test_what_is_no_pose_is_refused(given: Any, words: str) -> None:
    with pytest.raises(insonify.PoseError, match=words):
        as_pose(given)
