import hashlib
import json
import shutil
import tomllib

import numpy as np
import pytest
import torch

from insonify_training import export, int8, train
from insonify_training.beam import BeamGrid
from insonify_training.channels import Encoder
from insonify_training.classes import Segmentation
from insonify_training.dataset import Dataset
from insonify_training.sheets import read_log
from insonify_training.trainer import read_checkpoint

TINY = ["--crop", "64", "--batch", "4", "--threads", "1", "--ndf", "4"]
# pix2pix's terms in a few steps.
GAN = ["--gan-weight", "0.005", "--warmup", "3", "--ramp", "2"]


def run(data_dir, out, *flags):
    return train.main(["fast_msa", "--data", str(data_dir), "--out", str(out), *TINY, *flags])


@pytest.fixture(scope="module")
def trained(data_dir, tmp_path_factory):
    out = tmp_path_factory.mktemp("run") / "tiny"
    assert run(data_dir, out, "--steps", "150") == 0
    return out


def test_training_raises_the_psnr(trained):
    rows = read_log(trained / "log.jsonl")
    last = rows[-1]
    assert last["step"] == 150 and not any("gan" in row for row in rows)
    assert last["psnr_db"] > last["psnr_lq_db"] + 1
    assert (trained / "loss.png").stat().st_size > 1000 and (trained / "sheet.png").stat().st_size > 1000


def test_a_resumed_run_equals_an_uninterrupted_one(data_dir, tmp_path):
    flags = ["--steps", "8", *GAN, "--norm", "instance"]
    assert run(data_dir, tmp_path / "whole", *flags) == 0
    assert run(data_dir, tmp_path / "parts", *flags, "--stop-after", "5") == train.STOPPED
    assert read_checkpoint(tmp_path / "parts/checkpoint.pt")["step"] == 5
    assert run(data_dir, tmp_path / "parts", *flags) == 0
    whole, parts = (read_checkpoint(tmp_path / name / "checkpoint.pt") for name in ("whole", "parts"))
    for part in ("generator", "discriminator"):
        for name, tensor in whole[part].items():
            assert torch.equal(tensor, parts[part][name]), (part, name)


def test_a_refused_run_keeps_its_config(data_dir, trained):
    before = (trained / "config.json").read_text()
    with pytest.raises(SystemExit, match="beyond"):
        run(data_dir, trained, "--steps", "100", "--rate", "1e-3")
    assert (trained / "config.json").read_text() == before


@pytest.mark.parametrize(
    ("flags", "word"),
    [
        (["--variant", "SAM"], "--variant SAM: it must be one of M, MS"),
        (["--lq", "1"], "--lq `1`; it must be RAYSxLAYERS"),
        (["--norm", "layer"], "none, instance"),
        (["--network", "resnet"], "--network resnet: it must be stride8"),
        (["--crop", "100"], "--crop 100: stride8 takes multiples of 32"),
        (["--border", "-1"], "--border -1"),
        (["--share", "1"], "--share 1.0: at least 0 and below 1"),
        (["--network", "unet4", "--crop", "256", "--share", "0.1"], "--share 0.1: .* unet4 takes only 0"),
    ],
)
def test_wrong_flags_name_the_accepted_values(data_dir, tmp_path, flags, word):
    with pytest.raises(SystemExit, match=word):
        run(data_dir, tmp_path / "run", *flags)
    assert not (tmp_path / "run").exists()


@pytest.mark.parametrize(
    ("flags", "word"),
    [(["--lq", "1x3"], "lq is 1x1, the generator wants 1x3"), (["--hq", "32x3"], "hq is 32x3 of 9 angles, the generator wants 32x3: .*--hq 32x3x9")],
)
def test_a_data_set_of_another_quality_is_refused(data_dir, tmp_path, flags, word):
    with pytest.raises(SystemExit, match=word):
        run(data_dir, tmp_path / "run", "--steps", "2", *flags)
    assert not (tmp_path / "run").exists()


def test_bfloat16_trains(data_dir, tmp_path):
    flags = ["--steps", "8", *GAN]
    assert run(data_dir, tmp_path / "half", *flags, "--bf16") == 0
    assert run(data_dir, tmp_path / "whole", *flags) == 0
    half, whole = (read_log(tmp_path / name / "log.jsonl")[-1]["l1"] for name in ("half", "whole"))
    # Different rounding, much the same training.
    assert half != whole and half == pytest.approx(whole, rel=0.1)


def test_a_checkpoint_of_another_version_is_explained(data_dir, trained, tmp_path):
    run_dir = shutil.copytree(trained, tmp_path / "run")
    state = torch.load(run_dir / "checkpoint.pt", weights_only=False)
    state["config"]["polish"] = 1
    torch.save(state, run_dir / "checkpoint.pt")
    with pytest.raises(SystemExit, match="another version .*polish.*name another --out"):
        run(data_dir, run_dir, "--steps", "2")
    with pytest.raises(SystemExit, match="another version .*polish"):
        export.main([str(run_dir), "--data", str(data_dir), "--out", str(tmp_path / "none")])


def test_an_export_without_a_run_or_test_rows_is_explained(data, data_dir, trained, tmp_path):
    with pytest.raises(SystemExit, match="checkpoint.pt must be there"):
        export.main([str(tmp_path), "--data", str(data_dir), "--out", str(tmp_path / "none")])
    only = shutil.copytree(data_dir, tmp_path / "set")
    text = (only / "manifest.jsonl").read_text()
    (only / "manifest.jsonl").write_text("".join(line for line in text.splitlines(True) if '"train"' in line))
    with pytest.raises(SystemExit, match="no test rows"):
        export.main([str(trained), "--data", str(only), "--out", str(tmp_path / "none")])


def test_a_run_is_not_loaded_with_data_of_other_coordinates(data_dir, trained):
    with pytest.raises(export.ExportError, match="of pictures, the others are of beam coordinates 80x0.5"):
        export.load_run(trained, Dataset(data_dir, BeamGrid(80, 0.5)))


def test_a_run_in_beam_coordinates_is_exported(data_dir, tmp_path, monkeypatch):
    run(data_dir, tmp_path / "run", "--steps", "3", "--beam", "80x0.5")
    out = tmp_path / "net"
    export.main([str(tmp_path / "run"), "--data", str(data_dir), "--out", str(out), "--frames", "1"])
    manifest = tomllib.loads((out / "net.toml").read_text())
    assert manifest["beam"] == {"scanlines": 80, "cell_mm": 0.5}
    pictures = Dataset(data_dir)
    lq, hq = (np.array(pictures.planes(pictures.split("test")[0]))[at] / 255.0 for at in (0, 1))
    mask = np.array(pictures.mask(pictures.split("test")[0])) > 0
    # int8 finds the same picture, and a second time replaces the first.
    for _ in range(2):
        int8.main([str(tmp_path / "run"), "--data", str(data_dir), "--out", str(out), "--frames", "1"])
    (precision,) = tomllib.loads((out / "net.toml").read_text())["precision"]
    assert precision["name"] == "int8" and precision["sha256"] == hashlib.sha256((out / precision["model"]).read_bytes()).hexdigest()
    assert precision["psnr_db"] == pytest.approx(manifest["quality"]["psnr_db"], abs=int8.COST_DB)
    whole, small = (np.load(out / name) for name in ("net.parity_output.npy", precision["output"]))
    assert whole.shape == small.shape and 0 < np.abs(whole - small).max() < 10
    # Where it costs too much, what is there stays.
    before = {path.name: path.read_bytes() for path in out.iterdir()}
    monkeypatch.setattr(int8, "COST_DB", -100.0)
    assert int8.main([str(tmp_path / "run"), "--data", str(data_dir), "--out", str(out), "--frames", "1"]) == int8.TOO_COSTLY
    assert {path.name: path.read_bytes() for path in out.iterdir()} == before
    with pytest.raises(SystemExit, match="no exported generator"):
        int8.main([str(tmp_path / "run"), "--data", str(data_dir), "--out", str(tmp_path / "none")])
    # Its figures are of pictures.
    assert manifest["quality"]["lq_psnr_db"] == pytest.approx(-10 * np.log10(((lq - hq)[mask] ** 2).mean()), abs=0.01)


def test_a_longer_training_is_not_resumed(data_dir, trained):
    with pytest.raises(SystemExit, match="at step 150, beyond the 149"):
        run(data_dir, trained, "--steps", "149")


def test_another_network_is_not_resumed(data_dir, trained):
    with pytest.raises(SystemExit, match="network is stride8, not stride4"):
        run(data_dir, trained, "--network", "stride4")


@pytest.mark.parametrize("flags", [[], ["--norm", "instance", "--freeze-from", "1"]])
def test_an_export_matches_its_manifest(data, data_dir, tmp_path, flags):
    run(data_dir, tmp_path / "run", "--steps", "6", *flags)
    found = export.export(tmp_path / "run", data, tmp_path / "tiny_msa", frames=1)
    assert found["onnxruntime_levels"] < export.AGREES and found["folded_levels"] < export.AGREES
    manifest = tomllib.loads((tmp_path / "tiny_msa/tiny_msa.toml").read_text())
    assert manifest["variant"] == "MSA" and manifest["training"] == {
        "data_sha256": data.sha256(), "iterations": 6,
        "lq": {"rays": 1, "layers": 1, "angles": 1}, "hq": {"rays": 32, "layers": 3, "angles": 9},
    }

    # As in the station: from the parity pair's planes by the manifest alone.
    planes = np.load(tmp_path / "tiny_msa/tiny_msa.parity_input.npy")
    expected = np.load(tmp_path / "tiny_msa/tiny_msa.parity_output.npy")
    image, classes, attenuation, mask = planes
    table = manifest["input"]
    channels = []
    for name in table["channels"]:
        plane = {"image": image / 255, "mask": mask / 255, "segmentation": classes, "attenuation": attenuation}[name]
        affine = table[name]
        channels.append(plane ** affine.get("power", 1.0) * affine["scale"] + affine["offset"])
    tensor = np.stack(channels)[None].astype(np.float32)
    # No padding is needed.
    assert all(side % manifest["padding_multiple"] == 0 for side in mask.shape)
    session = export.session(tmp_path / "tiny_msa/tiny_msa.onnx", 1)
    output = session.run(None, {"input": tensor})[0][0, 0]
    levels = np.clip(output * 255, 0, 255) * (mask > 0)
    assert np.abs(levels - expected).max() < manifest["parity"]["tolerance"]


def test_a_field_of_view_is_surrounded_by_outside(data):
    encode = Encoder("MSA", Segmentation.make(), data)
    # A frame completely outside is passed through.
    inputs = encode.input(np.zeros((2, 4, 3, 5), np.uint8), np.zeros((2, 1, 3, 5), np.uint8))
    whole = export.padded(inputs, 4, encode.outside)
    assert whole.shape == (2, encode.channels, 4, 8)
    assert (whole == whole[..., :1, :1]).all()
    inputs += 1
    # Half of the padding before, an odd pixel behind.
    whole = export.padded(inputs, 4, encode.outside)
    assert (whole[..., 0:3, 1:6] == inputs).all()
    assert (whole[..., 3, :] == encode.outside[..., 0]).all() and (whole[..., 0] == encode.outside[..., 0]).all()


def test_the_log_keeps_the_last_row_of_a_step(tmp_path):
    log = tmp_path / "log.jsonl"
    rows = [{"step": 1, "l1": 0.5}, {"event": "resume"}, {"step": 1, "l1": 0.4}, {"step": 1, "psnr_db": 20.0}]
    log.write_text("\n".join(map(json.dumps, rows)) + '\n{"step": 2, "l')
    assert read_log(log) == [{"step": 1, "l1": 0.4, "psnr_db": 20.0}]
