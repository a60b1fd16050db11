"""Pictures that know the target, and the target of another data set."""

import json

import pytest
import synthetic
import torch

from insonify_training import bounds
from insonify_training.dataset import Dataset


def noise(seed, deviation=0.05):
    return deviation * torch.randn(96, 96, generator=torch.Generator().manual_seed(seed))


def test_levels_come_from_the_target_and_detail_from_the_input():
    inside = torch.ones(96, 96)
    ramp = torch.linspace(0.3, 0.7, 96).expand(96, 96)
    lq, target = 0.4 + noise(1), ramp + noise(2, 0.1)
    made = bounds.informed(lq, target, inside)
    assert list(made) == [f"{kind} {sigma} px" for sigma in (4, 8, 16) for kind in ("levels", "levels and grain")]
    for sigma_px in bounds.SIGMAS_PX:
        for kind, deviation in (("levels", 0.05), ("levels and grain", 0.1)):
            of = made[f"{kind} {sigma_px:g} px"]
            detail = of - bounds.blurred(of, inside, sigma_px)
            assert detail.std() == pytest.approx(deviation, rel=0.1)
            # The grain is the input's own.
            assert torch.corrcoef(torch.stack([detail.flatten(), noise(1).flatten()]))[0, 1] > 0.9
            assert (of - ramp).mean().abs() < 0.01


def test_outside_stays_black_and_does_not_darken_the_edge():
    inside = torch.ones(96, 96)
    inside[:, 48:] = 0
    made = bounds.informed(0.5 * inside, 0.8 * inside, inside)
    for picture in made.values():
        assert (picture[:, 48:] == 0).all() and (picture[:, :48] - 0.8).abs().max() < 0.01


def test_the_input_without_detail_gets_none():
    inside = torch.ones(96, 96)
    made = bounds.informed(torch.full((96, 96), 0.2), 0.5 + noise(1), inside)
    assert made["levels and grain 16 px"].std() < 0.02


def test_rows_of_a_data_set_and_of_another(data_dir, tmp_path, capsys):
    assert bounds.main([str(data_dir), "--also", f"itself={data_dir}", "--frames", "2"]) == 0
    rows = [line.split("|")[1].strip() for line in capsys.readouterr().out.splitlines()[2:]]
    assert rows == ["LQ", *(f"{kind} {sigma} px" for sigma in (4, 8, 16) for kind in ("levels", "levels and grain")), "itself"]
    data = Dataset(data_dir)
    found = bounds.bounds(data, {"itself": data}, 2)
    assert found["itself"]["levels"] == 0.0 and found["itself"]["pkl"] < 1e-6
    # The better the levels are known, the less is off.
    errors = [found[f"levels and grain {sigma} px"]["levels"] for sigma in (4, 8, 16)] + [found["LQ"]["levels"]]
    assert errors == sorted(errors)


def test_another_data_set_of_other_tuples_is_refused(data_dir, tmp_path):
    # As many tuples, in another order.
    other = synthetic.write(tmp_path / "other")
    manifest = other / "manifest.jsonl"
    rows = [json.loads(line) for line in manifest.read_text().splitlines()]
    files = [row["file"] for row in rows]
    manifest.write_text("".join(json.dumps({**row, "file": file}) + "\n" for row, file in zip(rows, files[::-1])))
    with pytest.raises(SystemExit, match="isn't that of"):
        bounds.main([str(data_dir), "--also", f"other={other}"])
    with pytest.raises(SystemExit, match="no data set"):
        bounds.main([str(tmp_path)])
