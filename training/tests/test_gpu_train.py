"""The script `gpu-train`: shares of the time, tars of the result, and its report."""

import importlib.machinery
import importlib.util
import json
import pathlib
import tarfile
import types

import pytest

SCRIPT = pathlib.Path(__file__).parents[2] / "scripts" / "gpu-train"


@pytest.fixture
def script():
    loader = importlib.machinery.SourceFileLoader("gpu_train", str(SCRIPT))
    module = importlib.util.module_from_spec(importlib.util.spec_from_loader("gpu_train", loader))
    loader.exec_module(module)
    return module


@pytest.fixture
def unpacked(tmp_path, script):
    """A run in an unpacked archive, of 600 s."""
    (tmp_path / "scripts").mkdir()
    (tmp_path / "training").mkdir()
    (tmp_path / "packed.json").write_text(json.dumps({"commit": "abcdef0"}))
    (tmp_path / "training/gpu_plan.json").write_text(json.dumps({"data": {}, "trainings": [], "common": {}, "pairs": 4}))
    script.HERE = tmp_path / "scripts"
    arguments = types.SimpleNamespace(trial=False, work=tmp_path / "work", seconds=600.0)
    return script.Run(arguments)


def test_a_run_outside_an_archive_is_refused(tmp_path, script):
    script.HERE = tmp_path / "scripts"
    with pytest.raises(script.VisitError, match="unpacked archive"):
        script.Run(types.SimpleNamespace(trial=False, work=None, seconds=1.0))


def test_parts_share_what_is_left(unpacked, script):
    parts = list(script.PARTS)
    shares = [unpacked.share(part, parts) for part in parts]
    # The last part has all that is left, and no part has more than that.
    assert shares[-1] == pytest.approx(unpacked.left(), abs=1.0)
    assert all(0.0 < share <= 600.0 for share in shares)
    unpacked.seconds = 0.0
    assert unpacked.share("train", parts) == 5.0


def test_the_result_is_packed_whole_in_tars_of_limited_size(unpacked, script):
    script.PIECE = 10_000
    sizes = {"a.bin": 6000, "b/c.bin": 5000, "b/d.bin": 100, "large.bin": 20_000, "z.bin": 1}
    for name, size in sizes.items():
        path = unpacked.result / name
        path.parent.mkdir(exist_ok=True)
        path.write_bytes(name[:1].encode() * size)
    (unpacked.root / "result-9.tar").write_bytes(b"of an earlier run")
    found = {}
    tars = script.pieces(unpacked)
    assert sorted(unpacked.root.glob("*.tar")) == sorted(map(pathlib.Path, tars))
    for tar in tars:
        with tarfile.open(tar) as piece:
            members = piece.getmembers()
            found |= {member.name: member.size for member in members}
            assert len(members) == 1 or sum(member.size + 1024 for member in members) <= script.PIECE
    assert found == {f"result/{name}": size for name, size in sizes.items()}


def test_a_report_keeps_the_machine_that_trained(unpacked, script, monkeypatch):
    def reported(machine, times):
        monkeypatch.setattr(script.visit, "machine", lambda: machine)
        script.report(unpacked, times)
        return json.loads((unpacked.result / "report.json").read_text())

    assert reported("a GPU, its host, 16 cores", {"render": 52.0, "train": 166.0})["machine"] == "a GPU, its host, 16 cores"
    (unpacked.result / "judged").mkdir()
    (unpacked.result / "judged/judged.json").write_text(json.dumps({"set": {"LQ": {"psnr": 20.0}}}))
    (unpacked.result / "judge.log").write_text("the table of the judge")
    later = reported("another, 2 cores", {"judge": 9.0})
    assert later["machine"] == "a GPU, its host, 16 cores"
    assert later["seconds"] == {"render": 52.0, "train": 166.0, "judge": 9.0}
    assert later["judged"]["set"]["LQ"]["psnr"] == 20.0 and later["packed"]["commit"] == "abcdef0"
    assert "the table of the judge" in (unpacked.result / "report.md").read_text()
    # Trained again elsewhere, it is that machine's.
    assert reported("another, 2 cores", {"train": 100.0})["machine"] == "another, 2 cores"
