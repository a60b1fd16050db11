"""Scenes from arrays."""

from __future__ import annotations

import pickle
from pathlib import Path
from typing import Any

import insonify
import numpy as np
import pytest
from conftest import SMALL
from numpy.typing import NDArray

CORNERS = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], dtype=np.float64)
# Counter-clockwise from outside.
FACES = np.array(
    [
        [0, 1, 3], [0, 3, 2], [4, 6, 7], [4, 7, 5], [0, 4, 5], [0, 5, 1],
        [2, 3, 7], [2, 7, 6], [0, 2, 6], [0, 6, 4], [1, 5, 7], [1, 7, 3],
    ]
)  # fmt: skip


def cube(half_mm: float, depth_mm: float) -> NDArray[np.float64]:
    return CORNERS * half_mm + (0, 0, depth_mm)


def station(scene: insonify.Scene) -> insonify.Station:
    return insonify.Station.from_dict({"image": {"gain_db": 30}, "pose": {}}, scene=scene).copy(**SMALL)


def test_a_cube_of_arrays_lies_where_it_was_put() -> None:
    scene = insonify.Scene([(cube(15, 60), FACES, "liver", 1)], background="water")
    frame = station(scene).render((0, 0, 0, 1, 0, 0, 0), quality="balanced")
    rows, _ = np.nonzero(frame.tissue("liver"))
    depths = frame.corner_mm[1] + (rows + 0.5) * frame.mm_per_pixel
    assert abs(depths.min() - 45) < 1.5 and abs(depths.max() - 75) < 1.5
    assert frame.bmode[frame.tissue("liver")].mean() > frame.bmode[frame.tissue("water")].mean() + 10


def test_a_file_of_the_scene_gives_the_same_picture(tmp_path: Path) -> None:
    scene = insonify.Scene([(cube(16, 64), FACES, "liver", 1), (cube(8, 64), FACES, "blood", 2)])
    file = scene.save(tmp_path / "cubes.glb")
    of_file = insonify.Station.from_dict({"scene": {"path": file}, "image": {"gain_db": 30}}).copy(**SMALL)
    pose = (0, 0, 0, 1, 0, 0, 0)
    assert np.array_equal(station(scene).render(pose).segmentation, of_file.render(pose).segmentation)
    again = pickle.loads(pickle.dumps(station(scene)))
    assert np.array_equal(again.render(pose).bmode, station(scene).render(pose).bmode)
    assert [surface[1:] for surface in scene.surfaces] == [("liver", 1, 12), ("blood", 2, 12)]


def test_meshes_of_trimesh_are_taken() -> None:
    trimesh = pytest.importorskip("trimesh")
    ball = trimesh.creation.icosphere(subdivisions=3, radius=20)
    ball.apply_translation((0, 0, 60))
    scene = insonify.Scene([(ball, "liver", 1)], background="water")
    frame = station(scene).render((0, 0, 0, 1, 0, 0, 0))
    share = frame.tissue("liver").sum() * frame.mm_per_pixel**2 / (np.pi * 20**2)
    assert abs(share - 1) < 0.03


def test_a_surface_that_faces_inward_is_turned_over(caplog: pytest.LogCaptureFixture) -> None:
    outward = insonify.Scene([(cube(15, 60), FACES, "liver", 1)])
    inward = insonify.Scene([(cube(15, 60), FACES[:, ::-1], "liver", 1)])
    assert "faced inward: turned over" in caplog.text
    pose = (0, 0, 0, 1, 0, 0, 0)
    assert np.array_equal(station(outward).render(pose).segmentation, station(inward).render(pose).segmentation)


@pytest.mark.parametrize(
    ("surface", "words"),
    [
        ((CORNERS * np.nan, FACES, "liver"), "coordinates must be finite"),
        ((CORNERS * 1e30, FACES, "liver"), r"within ±1e5 mm"),
        ((CORNERS, FACES + 1, "liver"), "names vertex 8; the surface has 8 vertices"),
        ((CORNERS, FACES - 1, "liver"), "faces name vertex -1"),
        ((CORNERS, FACES.astype(float), "liver"), "must be whole numbers"),
        ((CORNERS[:, :2], FACES, "liver"), r"shape \(8, 2\)"),
        ((CORNERS.astype(complex), FACES, "liver"), "must be real numbers"),
        ((CORNERS.astype(str), FACES, "liver"), "must be real numbers"),
        (([[1, 2], [3]], FACES, "liver"), "no array"),
        ((CORNERS, FACES, 3), "must be a name"),
        ((CORNERS, FACES, "liver", 1.5), "must be a whole number"),
        ((CORNERS,), "has 1 parts"),
    ],
)
def test_wrong_arrays_are_refused(surface: Any, words: str) -> None:
    with pytest.raises(insonify.SceneError, match=words):
        insonify.Scene([surface])


def test_wrong_scenes_are_refused() -> None:
    with pytest.raises(insonify.SceneError, match="did you mean `liver`"):
        station(insonify.Scene([(CORNERS, FACES, "livre")])).render((0, 0, 0, 1, 0, 0, 0))
    with pytest.raises(insonify.InsonifyError, match="unknown tissue `wter`"):
        station(insonify.Scene([(CORNERS, FACES, "liver")], background="wter"))
    with pytest.raises(insonify.SceneError, match="no triangles"):
        station(insonify.Scene([])).render((0, 0, 0, 1, 0, 0, 0))
    many = [(CORNERS + 3 * n, FACES, "liver") for n in range(257)]
    with pytest.raises(insonify.RenderError, match="257 surfaces; at most 256"):
        station(insonify.Scene(many)).render((0, 0, 0, 1, 0, 0, 0))
    with pytest.raises(insonify.SceneError, match="no standard planes"):
        _ = station(insonify.Scene([(CORNERS, FACES, "liver")])).planes
