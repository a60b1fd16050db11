"""Miniature data set: speckle over shapes, with a noisy LQ frame and patchy shadows."""

import hashlib
import json
from pathlib import Path

import numpy as np

CLASSES = ["outside", "amniotic_fluid", "soft_tissue", "placenta", "bone_adult"]
LEVEL = np.array([0.0, 0.03, 0.35, 0.6, 0.8])


def _blur(picture, times):
    for _ in range(times):
        for axis in (0, 1):
            picture = (np.roll(picture, 1, axis) + 2 * picture + np.roll(picture, -1, axis)) / 4
    return picture


def frame(seed, size):
    """Planes uint8 [4, height, width] and mask uint8 [height, width]."""
    width, height = size
    random = np.random.default_rng(seed)
    y, x = np.mgrid[0:height, 0:width]
    radius = np.hypot(x - width / 2, y + height / 3)
    mask = (radius > height / 2) & (radius < 1.3 * height) & (np.abs(x - width / 2) < 0.65 * (y + height / 3))
    classes = np.full((height, width), 2)
    for kind in (1, 3, 1, 3, 4, 4):
        cx, cy, a, b = random.uniform((0, 0.2 * height, 5, 5), (width, height, width / 5, height / 7))
        classes[((x - cx) / a) ** 2 + ((y - cy) / b) ** 2 < 1] = kind
    depth = np.cumsum(classes == 4, axis=0)
    attenuation = np.exp(-0.25 * depth) * np.exp(-y / height)
    classes[~mask] = 0
    speckle = np.hypot(*(_blur(random.standard_normal((2, height, width)).reshape(-1, width), 1).reshape(2, height, width)))
    tissue = LEVEL[classes] * attenuation**0.5
    hq = _blur(tissue * (0.4 + 1.2 * speckle), 1)
    wrong = _blur(random.standard_normal((height, width)), 6) * 1.5
    lq = tissue * np.exp(wrong) * np.hypot(*random.standard_normal((2, height, width))) * 0.8
    to_bytes = lambda p: np.clip(p * 255 + 0.5, 0, 255).astype(np.uint8)
    planes = np.stack([to_bytes(lq * mask), to_bytes(hq * mask), classes.astype(np.uint8), to_bytes(attenuation * mask)])
    return planes, (mask * 255).astype(np.uint8)


def write(directory, frames=8, tests=2, size=(160, 128)):
    """Writes a data set like `insonify dataset`; returns its directory."""
    directory = Path(directory)
    (directory / "tuples").mkdir(parents=True)
    (directory / "masks").mkdir()
    header = {"format": 1, "seed": 1, "frames": frames, "classes": CLASSES, "something_new": 1}
    header |= {"lq": [1, 1], "hq": [32, 3], "look": {"lq_angles": 1, "hq_angles": 9, "span_deg": 30.0}}
    # A flat face as wide as the pictures.
    scan = {"half_extent": size[0] / 8, "depth_mm": size[1] / 4, "pixel_mm": 0.25, "corner_mm": [-size[0] / 8, 0.0]}
    header |= {"stations": [{"file": "stations/a.toml", "directory": ".", "scan": scan}]}
    (directory / "dataset.json").write_text(json.dumps(header))
    rows = []
    for index in range(frames):
        planes, mask = frame(index, size)
        name, mask_name = f"tuples/{index:06}.npy", f"masks/{size[0]}x{size[1]}.npy"
        np.save(directory / name, planes)
        np.save(directory / mask_name, mask)
        digest = hashlib.sha256((directory / name).read_bytes()).hexdigest()
        split = "test" if index >= frames - tests else "train"
        row = {"index": index, "split": split, "station": "stations/a.toml", "exam": index, "size": size, "file": name, "mask": mask_name}
        rows.append(json.dumps({**row, "sha256": digest}))
    (directory / "manifest.jsonl").write_text("\n".join(rows) + "\n")
    return directory


if __name__ == "__main__":
    import sys

    write(sys.argv[1], frames=int(sys.argv[2]), size=(int(sys.argv[3]), int(sys.argv[4])))
