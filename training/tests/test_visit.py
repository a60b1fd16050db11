"""Training on a visit: tuples in memory, several trainings at once, judging, and the loss of what an eye sees."""

import json

import numpy as np
import pytest
import torch

from insonify_training import judge, visit
from insonify_training.beam import BeamGrid
from insonify_training.dataset import HQ, LQ, Dataset
from insonify_training.networks import fold, grain, make
from insonify_training.quality import seen_error
from insonify_training.resident import BORDER, Resident
from insonify_training.sheets import read_log
from insonify_training.export import load_run
from insonify_training.trainer import Trainer, read_checkpoint, save_checkpoint

SMALL = {"generator": "beam_msa", "data": "set", "beam": "64x0.5", "batch": 2, "ndf": 4, "share": 0.0}


def plan(folder, *rows):
    path = folder / "plan.json"
    path.write_text(json.dumps([{**SMALL, **row} for row in rows]))
    return path


def test_drawn_crops_are_pieces_of_the_tuples(data_dir):
    data = Dataset(data_dir, BeamGrid(64, 0.5))
    resident = Resident(data, "train", 32)
    torch.manual_seed(1)
    drawn = resident.draw(12)
    planes, mask, area = drawn.planes, drawn.mask, drawn.area
    assert planes.shape == (12, 4, *resident.crop) and mask.shape == (12, 1, *resident.crop) and area.shape == (12, 1, resident.crop[0], 1)
    whole = [np.pad(data.planes(row)[HQ], [(side, side + 64) for side in BORDER]) for row in data.split("train")]
    seen = set()
    for one in planes[:, HQ].numpy():
        places = [
            (at, y, x, mirrored)
            for at, picture in enumerate(whole)
            for y in range(2 * BORDER[0] + 1)
            for x in range(2 * BORDER[1] + 1)
            for mirrored in (False, True)
            if (picture[y : y + one.shape[0], x : x + one.shape[1]][:, :: -1 if mirrored else 1] == one).all()
        ]
        assert places
        seen.add(places[0])
    assert len(seen) > 6 and len({mirrored for *_, mirrored in seen}) == 2


def test_a_view_is_the_picture_that_the_station_makes(data_dir):
    data = Dataset(data_dir, BeamGrid(64, 0.5))
    resident = Resident(data, "train", 32)
    torch.manual_seed(2)
    drawn = resident.draw(6, window=96)
    image = drawn.planes[:, LQ : LQ + 1].float() / 255
    whole = [np.asarray(data.picture(row)[0][LQ]) for row in data.split("train")]
    for kept in (0.0, 0.5, 1.0):
        # A network that gives half of its input.
        made = drawn.view.of(0.5 * image, image, kept).clamp(0, 1)
        for one, view, inside in zip(made, drawn.view.lq, drawn.view.inside):
            level = (255 * view[0]).round().numpy().astype(int)
            seen = inside[0].numpy() > 0
            (at, y, x) = next(
                (at, y, x)
                for at, picture in enumerate(whole)
                for y in range(picture.shape[0] - 95)
                for x in range(picture.shape[1] - 95)
                if (picture[y : y + 96, x : x + 96][seen] == level[seen]).all()
            )
            sampling = data.sampling(data.split("train")[at])
            values = 0.5 * sampling.levels(whole[at]).astype(np.float32)
            expected = sampling.corrected(values, whole[at], kept)[y : y + 96, x : x + 96]
            # The station's weights are whole parts of 256.
            assert np.abs(255 * one[0].numpy() - expected)[seen].max() < 1.5 and seen.mean() > 0.2


def test_processes_read_the_same_tuples(data_dir):
    data = Dataset(data_dir, BeamGrid(64, 0.5))
    assert torch.equal(Resident(data, "train", 32).store, Resident(data, "train", 32, jobs=2).store)


def test_trainings_side_by_side_leave_the_best_weights(data_dir, tmp_path, monkeypatch):
    monkeypatch.setattr(visit, "LOOK_S", 1.0)
    rows = [{"name": "plain"}, {"name": "adversarial", "network": "grain8", "gan": "hinge", "gan_weight": 0.02, "ema": 0.9, "detail_kept": 0.5}]
    arguments = ["--data", f"set={data_dir}", "--seconds", "12", "--out", str(tmp_path / "runs"), "--device", "cpu", "--jobs", "1"]
    assert visit.main([str(plan(tmp_path, *rows)), *arguments]) == 0
    for name in ("plain", "adversarial"):
        log = read_log(tmp_path / "runs" / name / "log.jsonl")
        best = min(log, key=lambda row: row["seen"])
        assert best["psnr_db"] > best["psnr_db_lq"] - 3 and ("gan" in best) == (name == "adversarial")
        assert read_checkpoint(tmp_path / "runs" / name / "checkpoint.pt")["step"] == best["step"]
    # A second run does not replace them.
    with pytest.raises(SystemExit, match="weights of an earlier run"):
        visit.main([str(plan(tmp_path, *rows)), *arguments])
    out = tmp_path / "judged"
    folders = [str(tmp_path / "runs" / name) for name in ("plain", "adversarial")]
    assert judge.main([*folders, "--data", f"set={data_dir}", "--out", str(out), "--device", "cpu", "--threads", "1"]) == 0
    report = json.loads((out / "judged.json").read_text())["set"]
    assert list(report) == ["LQ", "plain", "adversarial"] and report["plain"]["psnr_db"] > report["LQ"]["psnr_db"] - 3
    assert (out / "adversarial.png").stat().st_size > 1000
    with pytest.raises(SystemExit, match="no folder of `visit`"):
        judge.main([str(tmp_path), "--data", f"set={data_dir}", "--out", str(out)])


def test_worse_weights_do_not_replace_better_ones(data_dir, tmp_path):
    entry = visit.Entry.of({**SMALL, "name": "a"})
    data, train, test = visit.open_data([entry], {"set": data_dir}, 1)["set"]
    session = visit.Session(entry, data, train, visit.held_out(test, 2), False)
    session.look(tmp_path)
    with torch.no_grad():
        session.trainer.generator.head[0].bias.add_(5.0)
    session.trainer.step = 7
    session.look(tmp_path)
    assert read_checkpoint(tmp_path / "checkpoint.pt")["step"] == 0 and len(read_log(tmp_path / "log.jsonl")) == 2


@pytest.mark.parametrize(
    ("row", "word"),
    [
        ({"name": "a", "generator": "none"}, "a: no generator is called none"),
        ({"name": "a", "speed": 1}, "a: a configuration has no key speed"),
        ({"name": "a", "data": "other"}, "--data other=DIR is missing"),
        ({"name": "a", "lq": "1x3"}, "a: lq of set is 1x1"),
        ({}, "lacks the key 'name'"),
        ({"name": "a", "steps": 5}, "a: steps has no effect here"),
        ({"name": "a", "gan": "soft"}, "a: gan is soft; it must be one of log, hinge"),
        ({"name": "a", "norm": "instance"}, "a: norm is instance"),
    ],
)
def test_a_wrong_plan_is_explained(data_dir, tmp_path, row, word):
    with pytest.raises(SystemExit, match=word):
        visit.main([str(plan(tmp_path, row)), "--data", f"set={data_dir}", "--seconds", "2", "--out", str(tmp_path / "runs"), "--jobs", "1"])


def test_trainings_that_do_not_fit_together_are_explained(data_dir, tmp_path):
    arguments = ["--data", f"set={data_dir}", "--seconds", "2", "--out", str(tmp_path / "runs"), "--jobs", "1"]
    with pytest.raises(SystemExit, match="two trainings have the same name"):
        visit.main([str(plan(tmp_path, {"name": "a"}, {"name": "a"})), *arguments])
    with pytest.raises(SystemExit, match="b: trainings on set must have one beam grid"):
        visit.main([str(plan(tmp_path, {"name": "a"}, {"name": "b", "beam": "80x0.5"})), *arguments])
    (tmp_path / "object.json").write_text("{}")
    with pytest.raises(SystemExit, match="no JSON list of trainings"):
        visit.main([str(tmp_path / "object.json"), *arguments])


def test_grain_is_of_one_strength_at_any_level():
    torch.manual_seed(1)
    noise = torch.rand(1, 1, 64, 64) - 0.5
    bright, dark = grain(0.5 + 0.4 * noise), grain(0.2 + 0.2 * noise)
    assert bright.std() == pytest.approx(float(dark.std()), rel=0.1) and 0.7 < bright.std() < 1.3
    assert (grain(torch.zeros(1, 1, 16, 16)) == 0).all() and grain(torch.full((1, 1, 16, 16), 0.6)).abs().max() < 1e-3


@pytest.mark.parametrize("name", ["grain8", "grain4"])
def test_a_network_with_grain_draws_no_lattice_in_the_dark(name):
    torch.manual_seed(1)
    network = make(name, 2).eval()
    with torch.no_grad():
        # A pattern of the cell that any place gets.
        network.head[0].bias.add_(0.2 * torch.randn_like(network.head[0].bias))
        image = torch.zeros(1, 1, 128, 128)
        image[..., 64:] = 0.5
        output = network(torch.cat([image, torch.ones_like(image)], 1))[0, 0]
    dark, bright = output[32:96, 16:40], output[32:96, 88:112]
    assert dark.std() < 0.02 and bright.std() > 0.1


@pytest.mark.parametrize("name", ["grain8", "grain4"])
def test_a_share_of_the_image_is_folded_into_a_network_with_grain(name):
    torch.manual_seed(1)
    network = make(name, 2).eval()
    network.share = 0.3
    x = torch.rand(1, 2, 64, 64)
    with torch.no_grad():
        assert torch.allclose(network(x), fold(network)(x), atol=1e-5)


def test_the_running_mean_is_exported(data, tmp_path):
    config = visit.Entry.of({**SMALL, "name": "a", "beam": "", "ema": 0.5}).config
    trainer = Trainer(config, data)
    before = [p.clone() for p in trainer.average.parameters()]
    inputs = torch.rand(1, trainer.encode.channels, 64, 64)
    trainer.update(inputs, torch.rand(1, 1, 64, 64), torch.ones(1, 1, 64, 64))
    for mean, old, new in zip(trainer.shown.parameters(), before, trainer.generator.parameters()):
        assert torch.allclose(mean, 0.5 * (old + new.detach()), atol=1e-6)
    save_checkpoint(tmp_path / "checkpoint.pt", trainer.weights())
    loaded, _ = load_run(tmp_path, data)
    for kept, mean in zip(loaded.generator.parameters(), trainer.average.parameters()):
        assert torch.equal(kept, mean)


class TestSeenError:
    """The error that an eye sees."""

    mask = torch.ones(1, 1, 64, 64)

    def picture(self, seed, deviation=0.1, level=0.5):
        return level + deviation * torch.randn(1, 1, 64, 64, generator=torch.Generator().manual_seed(seed))

    def test_another_look_of_the_same_speckle_is_a_small_error(self):
        whole, levels, texture = seen_error(self.picture(1), self.picture(2), self.mask)[0]
        pixels = 255 * (self.picture(1) - self.picture(2)).square().mean().sqrt()
        assert pixels > 30 and whole < 4 and whole == pytest.approx(float((levels**2 + texture**2).sqrt()))

    def test_smoothing_is_an_error_of_texture(self):
        whole, levels, texture = seen_error(self.picture(1, 0.0), self.picture(2, 0.1), self.mask)[0]
        assert texture == pytest.approx(25.5, rel=0.05) and levels < 3 and whole > 25

    def test_another_level_is_an_error_of_levels(self):
        whole, levels, texture = seen_error(self.picture(1, level=0.4), self.picture(1), self.mask)[0]
        assert levels == pytest.approx(25.5, abs=0.5) and texture < 0.5

    def test_what_is_outside_does_not_count(self):
        mask = self.mask.clone()
        mask[..., 32:] = 0
        other = self.picture(1)
        other[..., 32:] = 1.0
        assert seen_error(other * mask, self.picture(1) * mask, mask)[0, 0] == 0
