"""Ray Data on a local cluster of two workers: the tuples of `make_dataset`."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import insonify
import numpy as np
import pytest
from conftest import write_station

ray = pytest.importorskip("ray")
pytest.importorskip("ray.data")

FRAMES = 8


@pytest.fixture(scope="module")
def cluster() -> Iterator[None]:
    import os

    # Workers must find what this process has found, an installation or a folder of the repository.
    paths = os.pathsep.join([str(Path(insonify.__file__).parent.parent), os.environ.get("PYTHONPATH", "")])
    ray.init(num_cpus=2, include_dashboard=False, log_to_driver=False, runtime_env={"env_vars": {"PYTHONPATH": paths}})
    yield
    ray.shutdown()


@pytest.mark.filterwarnings("ignore")
def test_tuples_are_those_of_one_process(cluster: None, tmp_path: Path) -> None:
    from insonify.ray_data import dataset

    tables = insonify.Station("sphere", width=96, height=72, scanlines=32, samples=300).to_dict()
    tables["scene"]["path"] = str(insonify.data_directory() / "assets" / "scenes" / "sphere.glb")
    station = write_station(tmp_path / "small.toml", tables)
    options = {"frames": FRAMES, "frames_per_exam": 2, "hq": "2x1"}
    insonify.make_dataset(station, tmp_path / "alone", **options)  # type: ignore[arg-type]
    alone = insonify.Dataset(tmp_path / "alone")
    for _ in range(2):
        rows = dataset(station, tmp_path / "ray", parts=4, workers=2, **options).take_all()
        assert sorted(row["index"] for row in rows) == list(range(FRAMES))
        for row in rows:
            expected = alone[row["index"]]
            assert np.array_equal(row["lq"], expected["lq"]) and np.array_equal(row["hq"], expected["hq"])
            assert np.array_equal(row["segmentation"], expected["segmentation"])
            assert np.array_equal(row["attenuation"], expected["attenuation"])
    files = sorted(path.relative_to(tmp_path / "ray") for path in (tmp_path / "ray").rglob("*.npy"))
    for file in files:
        assert (tmp_path / "ray" / file).read_bytes() == (tmp_path / "alone" / file).read_bytes()
