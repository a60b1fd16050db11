#!/usr/bin/env python3
"""Reference values of the image-quality metrics, by NumPy, SciPy and scikit-image.

    python3 -m venv /tmp/quality && /tmp/quality/bin/pip install numpy==2.4.6 scipy==1.17.1 scikit-image==0.26.0
    /tmp/quality/bin/python tests/python/quality_reference.py tests/data/quality

Writes small grey images (.png), images.json (PSNR, SSIM, pKL) and frechet.json (feature vectors and their distance).
Nothing is shared with the Rust code. PSNR and the inner SSIM are scikit-image's; the SSIM with MATLAB's replicated
edges is filtered by scipy.ndimage. pKL sums numpy.histogram's bins with scipy.stats.entropy. The Frechet distance
uses scipy.linalg.sqrtm, or for singular covariances the eigenvalues of their product.
"""

import json
import platform
import sys
from pathlib import Path

import numpy as np
import scipy
import skimage
from scipy.linalg import sqrtm
from scipy.ndimage import gaussian_filter
from scipy.stats import entropy
from skimage.io import imsave
from skimage.metrics import peak_signal_noise_ratio, structural_similarity

COMMAND = "python3 tests/python/quality_reference.py tests/data/quality"


def versions():
    return {
        "command": COMMAND,
        "python": platform.python_version(),
        "numpy": np.__version__,
        "scipy": scipy.__version__,
        "scikit-image": skimage.__version__,
    }


def images(rng):
    """Dictionary from name to (image, reference), like ultrasound: log-compressed speckle over a few structures."""
    height, width = 101, 139
    y, x = np.mgrid[:height, :width]
    tissue = 0.02 + 0.08 * (np.hypot(x - 60, y - 50) < 30) + 0.5 * (abs(y - 80 - x / 20) < 1.5)
    tissue *= np.hypot(x - 100, y - 30) > 12

    def speckle(sigma):
        field = rng.normal(size=(2, height, width))
        field = gaussian_filter(field, (0, 0.8, sigma))
        field /= field.std()
        db = 20 * np.log10(np.maximum(tissue * np.hypot(*field), 1e-6))
        return np.clip(np.round((1 + db / 60) * 255), 0, 255).astype(np.uint8)

    reference = speckle(2.5)
    noisy = np.clip(reference + rng.normal(0, 9, reference.shape).round(), 0, 255).astype(np.uint8)
    blurred = gaussian_filter(reference, 2)
    ramp = (np.outer(np.arange(64), np.arange(96)) * 255 // (63 * 95)).astype(np.uint8)
    checker = ((np.add.outer(np.arange(64) // 3, np.arange(96) // 5) % 2) * 255).astype(np.uint8)
    flat = np.full((64, 96), 93, np.uint8)
    return {
        "other_speckle": (speckle(1.5), reference),
        "noisy": (noisy, reference),
        "blurred": (blurred, reference),
        "ramp_checker": (ramp, checker),
        "flat_ramp": (flat, ramp),
        "black_white": (np.zeros((64, 96), np.uint8), np.full((64, 96), 255, np.uint8)),
    }


def sector(shape):
    """Fan-shaped mask."""
    y, x = np.mgrid[: shape[0], : shape[1]]
    angle = np.arctan2(x - shape[1] / 2, y + 15)
    radius = np.hypot(x - shape[1] / 2, y + 15)
    return (abs(angle) < 0.6) & (radius > 20) & (radius < shape[0] + 12)


def matlab_map(a, b):
    """SSIM map as in MATLAB: structural_similarity with replicated edges."""
    a, b = a.astype(float), b.astype(float)
    f = lambda v: gaussian_filter(v, 1.5, radius=5, mode="nearest")
    ma, mb = f(a), f(b)
    va, vb, vab = f(a * a) - ma * ma, f(b * b) - mb * mb, f(a * b) - ma * mb
    c1, c2 = (0.01 * 255) ** 2, (0.03 * 255) ** 2
    return (2 * ma * mb + c1) * (2 * vab + c2) / ((ma**2 + mb**2 + c1) * (va + vb + c2))


def pkl(image, reference, inside=None):
    """Mean over patches of D(reference || image): 50 bins, half a pixel added to each."""
    inside = np.ones(image.shape, bool) if inside is None else inside
    divergences = []
    for top in range(0, image.shape[0] - 31, 32):
        for left in range(0, image.shape[1] - 31, 32):
            patch = np.s_[top : top + 32, left : left + 32]
            if 2 * inside[patch].sum() < 1024:
                continue
            p, q = (np.histogram(i[patch][inside[patch]], 50, (0, 255))[0] + 0.5 for i in (reference, image))
            divergences.append(entropy(p, q))
    return float(np.mean(divergences))


def measure(image, reference):
    inner, full = structural_similarity(
        reference, image, data_range=255, gaussian_weights=True, sigma=1.5, use_sample_covariance=False, full=True
    )
    ssim_map = matlab_map(image, reference)
    assert np.allclose(full[5:-5, 5:-5], ssim_map[5:-5, 5:-5], rtol=0, atol=1e-12)
    inside = sector(image.shape)
    error = (image.astype(float) - reference)[inside]
    return {
        "psnr_db": peak_signal_noise_ratio(reference, image, data_range=255),
        "ssim": float(ssim_map.mean()),
        "ssim_inner": float(inner),
        "pkl": pkl(image, reference),
        "masked": {
            "psnr_db": float(10 * np.log10(255**2 / np.mean(error**2))),
            "ssim": float(ssim_map[inside].mean()),
            "pkl": pkl(image, reference, inside),
        },
    }


def frechet(a, b):
    ma, mb, ca, cb = a.mean(0), b.mean(0), np.cov(a.T), np.cov(b.T)
    root = sqrtm(ca @ cb)
    cross = np.trace(root).real
    if not np.isfinite(root).all() or np.linalg.matrix_rank(ca @ cb) < len(ca):
        # A singular product: the trace of its root is the sum of the roots of its eigenvalues.
        cross = np.sqrt(np.clip(np.linalg.eigvals(ca @ cb).real, 0, None)).sum()
    return float(((ma - mb) ** 2).sum() + np.trace(ca) + np.trace(cb) - 2 * cross)


def features(rng):
    mix = rng.normal(size=(12, 12))
    shifted = rng.normal(size=(60, 12)) @ (mix + 0.3 * rng.normal(size=(12, 12))) + rng.normal(size=12)
    # Multiples of 1/32, so that products are exact and the covariances truly singular.
    coarse = lambda *size: (rng.normal(size=size) * 32).round() / 32
    low = coarse(30, 3) @ coarse(3, 10)
    low2 = coarse(30, 2) @ coarse(2, 10) + 0.5
    sets = {
        "regular": (rng.normal(size=(50, 12)) @ mix, shifted),
        "rank_3_of_10": (low, low2),
        "fewer_than_dimensions": (rng.normal(size=(6, 16)), 1.5 * rng.normal(size=(5, 16))),
    }
    return {name: tuple((v * 1024).round() / 1024 for v in pair) for name, pair in sets.items()}


def main(folder):
    rng = np.random.default_rng(20)
    cases = []
    for name, (image, reference) in images(rng).items():
        files = {"image": f"{name}.png", "reference": f"{name}_reference.png", "mask": f"{name}_mask.png"}
        for file, pixels in zip(files.values(), (image, reference, sector(image.shape).astype(np.uint8) * 255)):
            imsave(folder / file, pixels, check_contrast=False)
        cases.append({"name": name, **files, **measure(image, reference)})
    (folder / "images.json").write_text(json.dumps({**versions(), "cases": cases}, indent=1) + "\n")
    sets = [
        {"name": name, "a": a.tolist(), "b": b.tolist(), "distance": frechet(a, b)}
        for name, (a, b) in features(rng).items()
    ]
    (folder / "frechet.json").write_text(json.dumps({**versions(), "cases": sets}) + "\n")


if __name__ == "__main__":
    main(Path(sys.argv[1]))
