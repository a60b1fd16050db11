import json
import shutil

import numpy as np
import pytest

import synthetic
from insonify_training.beam import BeamGrid
from insonify_training.channels import VARIANTS, Encoder
from insonify_training.classes import Segmentation
from insonify_training.dataset import Crops, Dataset, DatasetError, Quality


def test_batches_depend_on_seed_and_step_only(data):
    crops = Crops(data, "train", 64, 3, seed=7)
    ahead = list(crops.stream(4, 9, threads=3))
    for step, batch in zip(range(4, 9), ahead):
        again = Crops(data, "train", 64, 3, seed=7).at(step)
        assert (batch.planes == again.planes).all() and (batch.mask == again.mask).all()
    assert (Crops(data, "train", 64, 3, seed=8).at(4).planes != ahead[0].planes).any()


def test_crops_contain_enough_of_the_sector_and_stay_aligned(data):
    crops = Crops(data, "train", 48, 4, seed=1, min_inside=0.5)
    for step in range(20):
        batch = crops.at(step)
        inside = batch.mask[:, 0] > 0
        # Origins are shifted by less than the grid's step, so that slightly less may be inside.
        assert inside.mean((1, 2)).min() > 0.25
        # Outside the sector every plane is 0, whichever way a crop was mirrored.
        assert not batch.planes.transpose(1, 0, 2, 3)[:, ~inside].any()


def test_crops_may_extend_beyond_the_picture(data):
    rows = data.split("train")
    height, width = data.mask(rows[0]).shape
    crops = Crops(data, "train", 48, 4, seed=1, flip=False, min_inside=0.05, border=20)
    whole = {row.index: np.pad(data.planes(row), ((0, 0), (20, 20), (20, 20))) for row in rows}
    views = [np.lib.stride_tricks.sliding_window_view(p, (4, 48, 48))[0] for p in whole.values()]
    beyond = 0
    for step in range(6):
        batch = crops.at(step)
        assert not batch.planes.transpose(1, 0, 2, 3)[:, batch.mask[:, 0] == 0].any()
        for planes in batch.planes:
            # Each crop is a piece of a padded picture.
            places = [np.argwhere((v[:, :, :, ::6, ::6] == planes[:, ::6, ::6]).all((2, 3, 4))) for v in views]
            places = [p for p in places if len(p)]
            assert places
            y, x = places[0][0]
            beyond += y < 20 or x < 20 or y + 48 > height + 20 or x + 48 > width + 20
    assert beyond > 3


def test_an_incomplete_last_line_is_ignored_and_any_other_is_an_error(data_dir, tmp_path):
    copy = shutil.copytree(data_dir, tmp_path / "set")
    manifest = copy / "manifest.jsonl"
    whole = manifest.read_text()
    manifest.write_text(whole[:-40])
    assert len(Dataset(copy).rows) == len(Dataset(data_dir).rows) - 1
    manifest.write_text(whole[:30] + "\n" + whole)
    with pytest.raises(DatasetError, match="manifest.jsonl:1"):
        Dataset(copy)


def test_shards_are_read_together(data_dir, tmp_path):
    copy = shutil.copytree(data_dir, tmp_path / "set")
    lines = (copy / "manifest.jsonl").read_text().splitlines(keepends=True)
    (copy / "manifest.jsonl").unlink()
    (copy / "manifest.001-of-002.jsonl").write_text("".join(lines[1::2]))
    (copy / "manifest.000-of-002.jsonl").write_text("".join(lines[::2]))
    assert Dataset(copy).rows == Dataset(data_dir).rows
    assert Dataset(copy).sha256() == Dataset(data_dir).sha256()


def test_repeated_tuples_and_broken_headers_are_errors(data_dir, tmp_path):
    copy = shutil.copytree(data_dir, tmp_path / "set")
    first = (copy / "manifest.jsonl").read_text().splitlines(keepends=True)[0]
    (copy / "manifest.00001-of-00002.jsonl").write_text(first)
    with pytest.raises(DatasetError, match="twice"):
        Dataset(copy)
    for text, word in (("{", "no JSON"), ("[]", "format is none"), ('{"format": 1}', "names no classes")):
        (copy / "dataset.json").write_text(text)
        with pytest.raises(DatasetError, match=word):
            Dataset(copy)


def test_an_exam_in_both_splits_is_refused(data_dir, tmp_path):
    copy = shutil.copytree(data_dir, tmp_path / "set")
    manifest = copy / "manifest.jsonl"
    manifest.write_text(manifest.read_text().replace('"exam": 7', '"exam": 0'))
    with pytest.raises(DatasetError, match="both train and test"):
        Dataset(copy)


@pytest.mark.parametrize("variant", list(VARIANTS))
def test_channels_follow_the_manifest(data, variant):
    segmentation = Segmentation.make()
    encode = Encoder(variant, segmentation, data, attenuation_power=0.25)
    batch = Crops(data, "train", 64, 2, seed=3).at(0)
    inputs, target, mask = encode(batch.planes, batch.mask)
    assert inputs.shape == (2, encode.channels, 64, 64)
    indices = segmentation.indices(data.classes)[batch.planes[:, 2]]
    expected = {
        "image": batch.planes[:, :1] / np.float32(255),
        "mask": (batch.mask > 0).astype(np.float32),
        "segmentation": indices[:, None] * segmentation.scale,
        "attenuation": (batch.planes[:, 3:] / np.float32(255)) ** 0.25,
    }
    whole = np.concatenate([expected[name] for name in VARIANTS[variant]], axis=1)
    np.testing.assert_allclose(inputs.numpy(), whole, atol=1e-6)
    np.testing.assert_allclose(target.numpy(), batch.planes[:, 1:2] / np.float32(255), atol=1e-6)
    assert ((mask.numpy() > 0) == (batch.mask > 0)).all()


def test_neighbouring_classes_look_alike():
    segmentation = Segmentation.make()
    classes = segmentation.classes
    assert classes[0] == "outside" and len(set(classes)) == len(classes)
    at = classes.index
    assert at("air") < at("amniotic_fluid") < at("brain") < at("liver") < at("fascia") < at("bone_fetal")
    assert segmentation.index("never_heard_of") == at("soft_tissue")
    assert segmentation.unknown(["liver", "never_heard_of"]) == ["never_heard_of"]


def test_qualities_are_those_of_the_header(data_dir, tmp_path):
    data = Dataset(data_dir)
    assert (data.lq, data.hq) == ((Quality(1, 1, 1),), Quality(32, 3, 9))
    copy = shutil.copytree(data_dir, tmp_path / "set")
    header = json.loads((copy / "dataset.json").read_text())
    # Older data sets have a single look.
    del header["look"]
    (copy / "dataset.json").write_text(json.dumps(header))
    assert Dataset(copy).hq == Quality(32, 3, 1)
    header["hq"] = 32
    (copy / "dataset.json").write_text(json.dumps(header))
    with pytest.raises(DatasetError, match="lq, hq or look"):
        Dataset(copy)


def test_tuples_are_resampled_to_beam_coordinates(data_dir, data):
    # Cells of 2 x 2 pixels, with their middle on a corner of four.
    on_grid = Dataset(data_dir, BeamGrid(80, 0.5))
    row = on_grid.split("test")[0]
    assert row.size == (80, 64) and row.index == data.split("test")[0].index
    planes, whole = np.array(on_grid.planes(row)).astype(int), np.array(data.planes(data.split("test")[0])).astype(int)
    means = whole[:2].reshape(2, 64, 2, 80, 2).mean((2, 4))
    assert np.abs(planes[:2] - means).max() <= 0.5
    cells = whole[2].reshape(64, 2, 80, 2).transpose(0, 2, 1, 3).reshape(64, 80, 4)
    assert (cells == planes[2][..., None]).any(-1).all()
    assert (on_grid.mask(row) == 255).all()
    assert (np.array(on_grid.picture(row)[0]) == whole).all()
    crops = Crops(on_grid, "train", 32, 2, 1).at(0)
    assert crops.planes.shape == (2, 4, 32, 32) and (crops.mask == 255).all()


def test_beam_coordinates_need_the_scanlines(tmp_path):
    directory = synthetic.write(tmp_path / "set", frames=2, tests=1)
    header = json.loads((directory / "dataset.json").read_text())
    del header["stations"][0]["scan"]
    (directory / "dataset.json").write_text(json.dumps(header))
    with pytest.raises(DatasetError, match="scan of a station"):
        Dataset(directory, BeamGrid(80, 0.5))
