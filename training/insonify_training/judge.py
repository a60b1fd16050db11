"""Figures of generators on held-out tuples, whole pictures: `python -m insonify_training.judge FOLDER... --data NAME=DIR... --out DIR`.

FOLDER is one of `visit`. Writes judged.json, and NAME.png for each: input, output, target and difference of four tuples. The Rust program's
`insonify evaluate` measures the same from exported models; this needs neither them nor the program.
"""

import argparse
import json
import sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import torch

from .dataset import HQ, LQ, Dataset, DatasetError
from .export import ExportError, grid_of, load_run, on_picture, run_torch
from .quality import pkl, psnr_db, seen_error, ssim
from .sheets import sample_sheet
from .visit import named

TEXTURE64 = Path(__file__).resolve().parents[2] / "assets/quality/texture64.onnx"
# Most that a shipped generator may raise the input's pKL and texture distance.
WORSE = 1.05
NAMES = ("psnr_db", "ssim", "pkl", "seen", "levels", "texture")
# Side of a texture crop, and of what a sheet shows, px.
CROP, SHOWN = 256, 480


def crops(picture):
    """The four crops in the middle of a picture [h, w] within 0..=1, as `insonify evaluate` takes them; one if it is small."""
    height, width = picture.shape
    across = 2 if min(height, width) >= 2 * CROP else 1
    top, left = ((side - across * CROP) // 2 for side in (height, width))
    at = [(top + CROP * (i // across), left + CROP * (i % across)) for i in range(across * across)]
    return [picture[y : y + CROP, x : x + CROP] for y, x in at]


class Textures:
    """Texture features of pictures, by the network that the program uses."""

    def __init__(self, threads):
        import onnxruntime

        options = onnxruntime.SessionOptions()
        options.intra_op_num_threads = threads
        self.session = onnxruntime.InferenceSession(str(TEXTURE64), options, providers=["CPUExecutionProvider"])

    def __call__(self, picture):
        """Features [crops, 64] of a picture [h, w] within 0..=1; none of one too small."""
        if min(picture.shape) < CROP:
            return np.zeros((0, 64))
        run = lambda crop: self.session.run(None, {"input": np.ascontiguousarray(crop, np.float32)[None, None]})[0].reshape(-1)  # noqa: E731
        return np.stack([run(crop) for crop in crops(picture)])


def frechet(a, b):
    """Frechet distance of two sets of features [n, 64]; NaN of fewer than two."""
    if min(len(a), len(b)) < 2:
        return float("nan")
    means, roots, traces = [], [], 0.0
    for x in (np.asarray(a, np.float64), np.asarray(b, np.float64)):
        covariance = np.cov(x, rowvar=False)
        values, vectors = np.linalg.eigh(covariance)
        means.append(x.mean(0))
        roots.append(vectors * np.sqrt(values.clip(0)) @ vectors.T)
        traces += np.trace(covariance)
    return max(0.0, float(((means[0] - means[1]) ** 2).sum() + traces - 2 * np.linalg.svd(roots[0] @ roots[1], compute_uv=False).sum()))


def figures(picture, target, inside):
    """Values by `NAMES` of a picture against its target, tensors [1, 1, h, w]."""
    return [f(picture, target, inside).item() for f in (psnr_db, ssim, pkl)] + seen_error(picture, target, inside)[0].tolist()


def judge(runs, data, device, frames, threads, out):
    """Rows of figures by name, `LQ` first, of runs on one data set."""
    rows = data.split("test")
    rows = rows[:: max(1, len(rows) // frames)][:frames]
    if not rows:
        raise DatasetError(f"{data.directory}: no test rows")
    trainers = {}
    for name, folder in runs.items():
        trainer, _ = load_run(folder, data)
        unlike = data.unlike(trainer.config)
        if unlike:
            key, found, wanted = (part if isinstance(part, str) else ", ".join(map(str, part)) for part in unlike)
            raise DatasetError(f"{data.directory}: {key} is {found}; {name} learnt from {wanted}")
        trainer.generator.to(device)
        trainers[name] = trainer
    textures = Textures(1)

    def one(row):
        planes, mask = np.array(data.planes(row))[None], np.array(data.mask(row))[None, None]
        pictures, inside = data.picture(row)
        inside = np.array(inside) > 0
        lq, target = (np.where(inside, pictures[at], 0).astype(np.float32) / 255 for at in (LQ, HQ))
        made = {"LQ": lq}
        for name, trainer in trainers.items():
            inputs, _, within = trainer.encode(planes, mask)
            output = (run_torch(trainer.generator, inputs, trainer.encode.outside, device).clamp(0, 1) * within)[0, 0]
            if data.grid:
                output = on_picture(trainer.config, data.sampling(row), output.numpy(), np.asarray(pictures[LQ]))
            made[name] = np.round(255 * np.asarray(output)) / 255 * inside
        tensor = lambda x: torch.from_numpy(np.ascontiguousarray(x)).float()[None, None].to(device)  # noqa: E731
        scores = {name: figures(tensor(picture), tensor(target), tensor(inside)) for name, picture in made.items()}
        return made, target, scores, {name: textures(picture) for name, picture in {**made, "HQ": target}.items()}

    with ThreadPoolExecutor(threads) as pool:
        found = list(pool.map(one, rows))
    all_features = lambda name: np.concatenate([features[name] for *_, features in found])  # noqa: E731
    report = {}
    for name in ("LQ", *trainers):
        values = np.array([scores[name] for _, _, scores, _ in found])
        row = {key: round(float(value), 4) for key, value in zip(NAMES, values.mean(0))}
        row |= {f"{key}_worst": round(float(np.percentile(values[:, at], 5 if at < 2 else 95)), 4) for at, key in enumerate(NAMES[:3])}
        row["fd"] = round(frechet(all_features(name), all_features("HQ")), 4)
        report[name] = row
    for name, row in report.items():
        row["may_ship"] = name == "LQ" or all(row[key] <= WORSE * report["LQ"][key] for key in ("pkl", "fd"))
    shown = found[:: max(1, len(found) // 4)][:4]
    for name in trainers:
        pick = {title: middles([made[key] for made, *_ in shown]) for title, key in (("input", "LQ"), (name, name))}
        pick["target"] = middles([target for _, target, *_ in shown])
        pick["difference"] = (pick[name] - pick["target"]).abs()
        row = report[name]
        sample_sheet(out / f"{name}.png", pick, f"{row['psnr_db']:.2f} dB (input {report['LQ']['psnr_db']:.2f}), pKL {100 * row['pkl']:.1f} ({100 * report['LQ']['pkl']:.1f})")
    return report


def middles(pictures):
    """The middles [n, 1, <= SHOWN, <= SHOWN] of pictures."""
    cut = lambda side: slice(max(0, (side - SHOWN) // 2), max(0, (side - SHOWN) // 2) + SHOWN)  # noqa: E731
    return torch.stack([torch.from_numpy(np.ascontiguousarray(x[cut(x.shape[0]), cut(x.shape[1])])).float()[None] for x in pictures])


def table(report):
    """Markdown table of a report of `judge`."""
    head = "| | PSNR, dB | 5 % | SSIM, % | 5 % | pKL x100 | 95 % | FD texture64 | seen error | levels | texture | may be shipped |\n|---|" + "---:|" * 11
    lines = [
        f"| {name} | {r['psnr_db']:.2f} | {r['psnr_db_worst']:.2f} | {100 * r['ssim']:.1f} | {100 * r['ssim_worst']:.1f} | {100 * r['pkl']:.1f} "
        f"| {100 * r['pkl_worst']:.1f} | {r['fd']:.2f} | {r['seen']:.2f} | {r['levels']:.2f} | {r['texture']:.2f} | {'yes' if r['may_ship'] else 'no'} |"
        for name, r in report.items()
    ]
    return "\n".join([head, *lines])


def main(argv=None):
    """Entry point of the command."""
    p = argparse.ArgumentParser(prog="insonify-judge", description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    p.add_argument("folders", type=Path, nargs="+", metavar="FOLDER")
    p.add_argument("--data", action="append", default=[], type=named, metavar="NAME=DIR", help="as for `visit`: NAME is that of the folder's plan")
    p.add_argument("--out", type=Path, required=True)
    p.add_argument("--frames", type=int, default=32, help="held-out tuples [default: 32]")
    p.add_argument("--threads", type=int, default=2)
    p.add_argument("--device", default="cuda" if torch.cuda.is_available() else "cpu")
    args = p.parse_args(argv)
    torch.set_num_threads(1)
    args.out.mkdir(parents=True, exist_ok=True)
    directories = dict(args.data)
    by_data = {}
    for folder in args.folders:
        try:
            data = json.loads((folder / "config.json").read_text())["data"]
        except (OSError, ValueError, KeyError):
            raise SystemExit(f"{folder}: no folder of `visit`: config.json with the name of its data must be there") from None
        by_data.setdefault(data, {})[folder.name] = folder
    reports = {}
    for name, runs in by_data.items():
        if name not in directories:
            raise SystemExit(f"--data {name}=DIR is missing: {', '.join(runs)} learnt from it")
        try:
            data = Dataset(directories[name], grid_of(next(iter(runs.values()))))
            reports[name] = judge(runs, data, args.device, args.frames, args.threads, args.out)
        except (DatasetError, ExportError) as error:
            raise SystemExit(str(error)) from None
        print(f"{name}\n\n{table(reports[name])}\n", flush=True)
    (args.out / "judged.json").write_text(json.dumps(reports, indent=1))
    return 0


if __name__ == "__main__":
    sys.exit(main())
