"""Beam coordinates agree with the station's."""

import json
from pathlib import Path

import numpy as np
import pytest

from insonify_training.beam import BeamGrid, Sampling, Scan

FIXTURE = Path(__file__).parents[2] / "tests/data/beam_grid.json"


@pytest.fixture(scope="module")
def fixture():
    found = json.loads(FIXTURE.read_text())
    return found, Sampling(BeamGrid.parse(found["grid"]), Scan.of(found["scan"]), tuple(found["size"]))


def plane(found, key, sampling):
    """A picture of the fixture."""
    return np.array(found[key], dtype=np.uint8).reshape(sampling.height, sampling.width)


def test_pictures_come_to_the_grid_as_in_the_station(fixture):
    found, sampling = fixture
    levels = sampling.levels(plane(found, "image", sampling))
    # Another libm may move a weight by one part.
    assert np.abs(levels.reshape(-1).astype(int) - found["grid_image"]).max() <= 1
    assert (sampling.map(plane(found, "segmentation", sampling)).reshape(-1) == found["grid_segmentation"]).mean() > 0.99
    assert (sampling.mask == (plane(found, "mask", sampling) > 0)).all()


def test_values_come_back_as_in_the_station(fixture):
    found, sampling = fixture
    values = np.array(found["grid_image"], dtype=np.float32).reshape(sampling.shape)
    assert np.abs(np.round(sampling.picture(values)).reshape(-1) - found["picture"]).max() <= 1


def test_a_picture_is_corrected_as_in_the_station(fixture):
    found, sampling = fixture
    values = 0.5 * np.array(found["grid_image"], dtype=np.float32).reshape(sampling.shape) + 0.25 * 255
    levels = np.round(sampling.corrected(values, plane(found, "image", sampling), 0.5)).reshape(-1)
    # A level of the grid that differs by one, and a rounding.
    assert np.abs(levels - found["corrected"]).max() <= 2
    unchanged = sampling.levels(plane(found, "image", sampling)).astype(np.float32)
    assert (sampling.corrected(unchanged, plane(found, "image", sampling), 1.0) == plane(found, "image", sampling) * sampling.mask).all()


def test_a_grid_is_written_as_text():
    grid = BeamGrid.parse("256x0.2")
    assert str(grid) == "256x0.2" and grid.cells(150.0) == 750
    assert BeamGrid.parse("") is None
    with pytest.raises(ValueError, match="SCANLINESxCELL_MM"):
        BeamGrid.parse("256")
