"""Pictures of a training run: generated samples, and the course of the losses."""

import json
import os

import numpy as np
from PIL import Image, ImageDraw


def _save(image, path):
    partial = path.with_suffix(".part.png")
    image.save(partial)
    os.replace(partial, path)


def sample_sheet(path, columns, title=""):
    """Writes a picture with one column per name of `columns` {name: levels within 0..=1 [n, 1, h, w]}, one row per
    sample."""
    arrays = {n: np.clip(np.asarray(c)[:, 0] * 255 + 0.5, 0, 255).astype(np.uint8) for n, c in columns.items()}
    count, height, width = next(iter(arrays.values())).shape
    gap, top = 4, 18
    sheet = Image.new("L", (len(arrays) * (width + gap) - gap, top + count * (height + gap)), 40)
    draw = ImageDraw.Draw(sheet)
    for column, (name, pictures) in enumerate(arrays.items()):
        left = column * (width + gap)
        draw.text((left + 2, 3), f"{name}  {title}" if column == 0 else name, fill=255)
        for row in range(count):
            sheet.paste(Image.fromarray(pictures[row]), (left, top + row * (height + gap)))
    _save(sheet, path)


def read_log(path):
    """Rows of a log by step; of a step repeated after a resume, the last one."""
    rows = {}
    for line in path.read_text(encoding="utf-8").splitlines():
        try:
            row = json.loads(line)
        except json.JSONDecodeError:
            continue
        if "step" in row:
            rows.setdefault(row["step"], {}).update(row)
    return [rows[step] for step in sorted(rows)]


# Terms of the loss beside L1 and GAN, before their weights.
TERMS = {"dissimilarity": "1 − SSIM", "divergence": "divergence", "grid": "pattern"}


def loss_plot(log, path, title=""):
    """Draws the losses of a log, and the test crops' PSNR."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    rows = read_log(log)
    if not rows:
        return
    figure, (left, right) = plt.subplots(1, 2, figsize=(11, 4), layout="constrained")

    def line(axis, key, label, **style):
        points = [(r["step"], r[key]) for r in rows if r.get(key) is not None]
        if points:
            axis.plot(*zip(*points), label=label, linewidth=1, **style)

    line(left, "l1", "L1 (train)")
    for key, label in TERMS.items():
        line(left, key, label)
    left.set(xlabel="step", ylabel="L1 and what is added to it", yscale="log")
    gan = left.twinx()
    line(gan, "gan", "GAN, generator", color="black")
    line(gan, "discriminator", "GAN, discriminator", color="grey")
    gan.set_ylabel("cross-entropy")
    lines = left.get_lines() + gan.get_lines()
    left.legend(lines, [one.get_label() for one in lines], fontsize=8)
    line(right, "psnr_db", "generated (test)")
    line(right, "psnr_lq_db", "LQ (test)", linestyle="--")
    right.set(xlabel="step", ylabel="PSNR, dB")
    if right.get_lines():
        right.legend(fontsize=8)
    figure.suptitle(title)
    partial = path.with_suffix(".part.png")
    figure.savefig(partial, dpi=90)
    plt.close(figure)
    os.replace(partial, path)
