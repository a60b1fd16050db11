"""The script `gpu-train`: shares of the time, tars of the result, and its report."""

import importlib.machinery
import importlib.util
import json
import pathlib
import tarfile
import types

import pytest

from insonify_training.visit import Entry

ROOT = pathlib.Path(__file__).parents[2]
SCRIPT = ROOT / "scripts" / "gpu-train"
PLAN = {
    "pairs": {"frames": 4, "frames_per_exam": 2, "phantoms": 1, "hq": "2x3", "angles": 3, "test_share": 0.5},
    "depths_mm": [150],
    "data": {"1x1": {"lq": "1x1", "angles": 1}},
    "common": {"data": "1x1", "batch": 16},
    "trainings": [{"name": "a", "generator": "beam_m", "seed": 1}, {"name": "a_2", "generator": "beam_m", "seed": 2, "batch": 8}],
}


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
    (tmp_path / "training/gpu_plan.json").write_text(json.dumps(PLAN))
    script.HERE = tmp_path / "scripts"
    return script.Run(arguments(tmp_path))


def arguments(tmp_path, **other):
    return types.SimpleNamespace(**{"trial": False, "work": tmp_path / "work", "seconds": 600.0, "plan": None, **other})


def test_a_run_outside_an_archive_is_refused(tmp_path, script):
    script.HERE = tmp_path / "scripts"
    with pytest.raises(script.VisitError, match="unpacked archive"):
        script.Run(arguments(tmp_path))


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
    (unpacked.result / "judge_gpu_plan.log").write_text("the table of the judge")
    later = reported("another, 2 cores", {"judge": 9.0})
    assert later["machine"] == "a GPU, its host, 16 cores"
    assert later["plans"]["gpu_plan"]["seconds"] == {"render": 52.0, "train": 166.0, "judge": 9.0}
    assert later["judged"]["set"]["LQ"]["psnr"] == 20.0 and later["packed"]["commit"] == "abcdef0"
    assert "the table of the judge" in (unpacked.result / "report.md").read_text()
    # Trained again elsewhere, it is that machine's.
    assert reported("another, 2 cores", {"train": 100.0})["machine"] == "another, 2 cores"


def test_a_second_plan_adds_to_the_result(tmp_path, unpacked, script, monkeypatch):
    monkeypatch.setattr(script.visit, "machine", lambda: "a GPU, its host, 16 cores")
    judged = unpacked.result / "judged/judged.json"
    judged.parent.mkdir()
    judged.write_text(json.dumps({"1x1": {"LQ": {"pkl": 0.5}, "a": {"pkl": 0.3}}}))
    (unpacked.result / "judge_gpu_plan.log").write_text("table of the first")
    script.report(unpacked, {"render": 80.0, "train": 300.0})
    other = {**PLAN, "data": {"1x1": {"lq": "1x1", "angles": 1}, "rolling": {"lq": "1x1", "angles": 9}}, "common": {"data": "rolling"}}
    (tmp_path / "training/gpu_plan_other.json").write_text(json.dumps(other))
    second = script.Run(arguments(tmp_path, plan=tmp_path / "training/gpu_plan_other.json"))
    judged.write_text(json.dumps({"rolling": {"LQ": {"pkl": 0.4}, "b": {"pkl": 0.2}}}))
    (second.result / "judge_gpu_plan_other.log").write_text("table of the second")
    script.report(second, {"render": 20.0, "train": 200.0})
    found = json.loads((unpacked.result / "report.json").read_text())
    assert {name: of["seconds"] for name, of in found["plans"].items()} == {"gpu_plan": {"render": 80.0, "train": 300.0}, "gpu_plan_other": {"render": 20.0, "train": 200.0}}
    assert {data: list(rows) for data, rows in found["judged"].items()} == {"1x1": ["LQ", "a"], "rolling": ["LQ", "b"]}
    text = (unpacked.result / "report.md").read_text()
    assert "table of the first" in text and "table of the second" in text


def test_a_trial_has_a_budget_of_its_own(tmp_path, unpacked, script):
    assert script.Run(arguments(tmp_path, seconds=None)).seconds == script.BUDGET_S
    trial = script.Run(arguments(tmp_path, seconds=None, trial=True))
    assert trial.seconds == script.TRIAL_S and trial.plan["pairs"]["frames"] == script.TRIAL["frames"]
    assert script.Run(arguments(tmp_path, seconds=33.0, trial=True)).seconds == 33.0


def test_trainings_have_the_common_keys_and_their_own(unpacked, script):
    assert script.trainings(unpacked) == [
        {"data": "1x1", "batch": 16, "name": "a", "generator": "beam_m", "seed": 1},
        {"data": "1x1", "batch": 8, "name": "a_2", "generator": "beam_m", "seed": 2},
    ]


@pytest.mark.parametrize(
    ("change", "word"),
    [
        ({"trainings": []}, "trainings is empty"),
        ({"trainings": [{"generator": "beam_m"}]}, "name is missing"),
        ({"trainings": [{"name": "a"}]}, "training a: generator is missing"),
        ({"trainings": [PLAN["trainings"][0]] * 2}, "two trainings are named a"),
        ({"common": {"data": "2x3"}}, "a: data is 2x3; it must be one of 1x1"),
        ({"batch": 16}, "the plan has no key batch"),
        ({"pairs": {"frames": 4}}, "pairs lacks frames_per_exam"),
    ],
)
def test_a_wrong_plan_is_refused_before_anything_is_rendered(tmp_path, script, change, word):
    path = tmp_path / "plan.json"
    path.write_text(json.dumps({**PLAN, **change}))
    with pytest.raises(script.VisitError, match=word):
        script.read_plan(path)
    path.write_text("{")
    with pytest.raises(script.VisitError, match="plan.json"):
        script.read_plan(path)
    with pytest.raises(script.VisitError, match="No such file"):
        script.read_plan(tmp_path / "none.json")


@pytest.mark.parametrize("path", sorted((ROOT / "training").glob("gpu_plan*.json")), ids=lambda path: path.stem)
def test_the_plans_of_the_next_visit_are_valid_and_packed(path, script):
    rows = script.read_plan(path)["trainings"]
    for row in rows:
        Entry.of(row)
    assert len({row["seed"] for row in rows}) == 2
    assert str(path.relative_to(ROOT)) in script.FILES


def test_what_passed_of_two_plans_is_kept(tmp_path, script):
    from measuring import trained

    figures = dict.fromkeys(("psnr_db", "psnr_db_worst", "ssim", "pkl", "pkl_worst", "fd", "seen", "levels", "texture"), 0.5)
    row = {**figures, "may_ship": True}
    plans = {name: {"plan": {**PLAN, "pairs": {**PLAN["pairs"], "frames": count}}, "seconds": {"render": count / 10, "train": 300.0}} for name, count in (("gpu_plan", 800), ("other", 40))}
    report = {
        "packed": {"commit": "abcdef0"}, "machine": "a GPU, its host, 16 cores", "date": "2026-11-29", "plans": plans,
        "judged": {"1x1": {"LQ": row, "msa": row, "ms": {**row, "may_ship": False}}, "rolling": {"LQ": row, "rolling": row}},
    }  # fmt: skip
    result = tmp_path / "result"
    for name, generator in (("msa", "beam_msa"), ("ms", "beam_ms"), ("rolling", "beam_m_rolling")):
        folder = result / "generators" / name / generator
        folder.mkdir(parents=True)
        (folder / f"{generator}.toml").write_text(name)
    (result / "report.json").write_text(json.dumps(report))
    root = tmp_path / "checkout"
    (root / "docs/figures").mkdir(parents=True)
    (root / "docs/notes.md").write_text("<!-- figure: trained -->\n\n<!-- /figure -->\n")
    with pytest.raises(script.VisitError, match="ms: its pKL"):
        trained.keep(root, result, ["msa", "ms"])
    assert not (root / "assets").exists()
    trained.keep(root, result, ["msa", "rolling"])
    assert {path.read_text() for path in (root / "assets/generators").glob("*/*.toml")} == {"msa", "rolling"}
    shown = (root / "docs/notes.md").read_text()
    assert "800 pairs rendered in 80 s, 2 trained side by side in 300 s, then 40 pairs rendered in 4 s" in shown
    assert all(f"`{name}`" in shown for name in ("msa", "ms", "rolling"))
    # A visit that ended early has what was trained before.
    del report["plans"]["other"]["seconds"]["train"]
    (result / "report.json").write_text(json.dumps(report))
    trained.keep(root, result, [])
    assert "then 40 pairs" not in (root / "docs/notes.md").read_text()
    del report["plans"]["gpu_plan"]
    (result / "report.json").write_text(json.dumps(report))
    with pytest.raises(script.VisitError, match="no plan was rendered, trained and judged"):
        trained.keep(root, result, [])
    (result / "report.json").write_text("{}")
    with pytest.raises(script.VisitError, match="no report of a run that judged"):
        trained.keep(root, result, [])
