"""Data sets: those of the command line, read as PyTorch reads them."""

from __future__ import annotations

import pickle
import signal
import subprocess
import sys
import time
from pathlib import Path

import insonify
import numpy as np
import pytest
from conftest import Program, write_station

FRAMES = 6


@pytest.fixture(scope="module")
def station_file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    tables = insonify.Station("sphere", width=120, height=90, scanlines=32, samples=400).to_dict()
    scene = insonify.data_directory() / "assets" / "scenes" / "sphere.glb"
    tables["scene"]["path"] = str(scene)
    return write_station(tmp_path_factory.mktemp("station") / "small.toml", tables)


@pytest.fixture(scope="module")
def made(station_file: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    directory = tmp_path_factory.mktemp("data") / "own"
    calls: list[tuple[int, int]] = []
    made = insonify.make_dataset(
        station_file, directory, frames=FRAMES, frames_per_exam=2, hq="2x1", progress=lambda *step: calls.append(step)
    )
    assert (made.made, made.kept) == (FRAMES, 0) and made.manifest.is_file()
    assert calls[0] == (0, FRAMES) and calls[-1] == (FRAMES, FRAMES)
    return directory


def test_tuples_are_those_of_the_command(made: Path, station_file: Path, tmp_path: Path, run_program: Program) -> None:
    other = tmp_path / "other"
    said = run_program(
        "dataset", station_file, "--frames", FRAMES, "--frames-per-exam", 2, "--hq", "2x1", "--out", other
    )
    assert said.returncode == 0, said.stderr
    files = sorted(path.relative_to(made) for path in made.rglob("*.npy"))
    assert len(files) > FRAMES
    for file in files:
        assert (made / file).read_bytes() == (other / file).read_bytes(), file
    assert (made / "manifest.jsonl").read_text() == (other / "manifest.jsonl").read_text()


def test_shards_make_the_same_and_a_second_run_nothing(made: Path, station_file: Path, tmp_path: Path) -> None:
    for shard in ("1/2", "2/2"):
        insonify.make_dataset(station_file, tmp_path, frames=FRAMES, frames_per_exam=2, hq="2x1", shard=shard)
    whole, parts = insonify.Dataset(made), insonify.Dataset(tmp_path)
    assert len(parts) == FRAMES
    for index in range(FRAMES):
        assert np.array_equal(whole[index]["hq"], parts[index]["hq"])
    again = insonify.make_dataset(station_file, tmp_path, frames=FRAMES, frames_per_exam=2, hq="2x1", shard="1/2")
    assert again.made == 0 and again.kept > 0


def test_a_data_set_is_read(made: Path) -> None:
    data = insonify.Dataset(made)
    train, test = insonify.Dataset(made, "train"), insonify.Dataset(made, split="test")
    assert len(train) + len(test) == len(data) == FRAMES and len(test) > 0
    first = data[0]
    assert set(first) == {"lq", "hq", "segmentation", "attenuation", "mask"}
    assert all(array.shape == (90, 120) for array in (first["lq"], first["hq"], first["mask"]))
    assert first["attenuation"].dtype == np.float32 and 0 < first["attenuation"].max() <= 1
    stored = np.load(made / data.row(0)["file"])
    assert np.array_equal(stored[0], first["lq"]) and np.array_equal(stored[2], first["segmentation"])
    assert data.classes[0] == "outside" and first["segmentation"].max() < len(data.classes)
    assert {row["split"] for row in map(train.row, range(len(train)))} == {"train"}
    again = pickle.loads(pickle.dumps(test))
    assert np.array_equal(again[0]["hq"], test[0]["hq"]) and "to test" in repr(again)
    halves = insonify.Dataset(made, transform=lambda found: found["lq"][::2, ::2])
    assert halves[0].shape == (45, 60) and len(list(halves)) == FRAMES
    with pytest.raises(IndexError):
        data[FRAMES]


def test_torch_reads_it_with_workers(made: Path) -> None:
    torch = pytest.importorskip("torch")
    loader = torch.utils.data.DataLoader(insonify.Dataset(made), batch_size=3, num_workers=2)
    batches = list(loader)
    assert [tuple(batch["hq"].shape) for batch in batches] == [(3, 90, 120)] * 2


def test_wrong_data_sets_are_refused(made: Path, station_file: Path, tmp_path: Path) -> None:
    with pytest.raises(insonify.MissingFileError):
        insonify.Dataset(tmp_path / "nothing")
    (tmp_path / "dataset.json").write_text("{")
    with pytest.raises(insonify.DatasetError, match="no data set's header"):
        insonify.Dataset(tmp_path)
    with pytest.raises(insonify.InputError, match="split is `validation`"):
        insonify.Dataset(made, "validation")  # type: ignore[call-overload]
    out = tmp_path / "out"
    for keywords, words in (
        ({"test_share": 2.0}, "must be above 0 and below 1"),
        ({"shard": "3/2"}, "shard: expected i/n"),
        ({"hq": "best"}, "quality is `best`"),
        ({"lq": []}, "needs a low quality"),
        ({"frames": 1}, "too few"),
    ):
        with pytest.raises(insonify.InputError, match=words):
            insonify.make_dataset(station_file, out, **{"frames": FRAMES, "frames_per_exam": 2, **keywords})  # type: ignore[arg-type]
    with pytest.raises(insonify.DatasetError, match="holds another data set"):
        insonify.make_dataset(station_file, made, frames=FRAMES + 2, frames_per_exam=2, hq="2x1")


def test_ctrl_c_ends_it_and_another_call_goes_on(station_file: Path, tmp_path: Path) -> None:
    script = f"""
import insonify, sys
def progress(done, total):
    if done == 2:
        print("two", flush=True)
try:
    insonify.make_dataset({str(station_file)!r}, {str(tmp_path)!r}, frames=400, hq="16x3", progress=progress)
except KeyboardInterrupt:
    sys.exit(9)
"""
    with subprocess.Popen([sys.executable, "-c", script], stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None and process.stdout.readline() == "two\n"
        sent = time.monotonic()
        process.send_signal(signal.SIGINT)
        assert process.wait(20) == 9 and time.monotonic() - sent < 5
    kept = len(insonify.Dataset(tmp_path))
    assert 2 <= kept < 400
    tuples = sorted((tmp_path / "tuples").glob("*.npy"))
    assert len(tuples) >= kept
