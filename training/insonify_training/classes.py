"""Mapping from tissues to the classes that a generator sees.

Tissues are identified by name, since their numbers differ between data sets and stations. Each tissue of
``crates/core/assets/tissues.toml`` is a class. Classes are ordered by appearance, so that intermediate values are meaningful.
"""

import math
import tomllib
from dataclasses import dataclass
from pathlib import Path

import numpy as np

TISSUES = Path(__file__).resolve().parents[2] / "crates/core/assets/tissues.toml"

OUTSIDE = "outside"
# Class of a tissue that is not in the table.
OTHER = "soft_tissue"
# Impedances, MRayl, below which a tissue is gas, and above which it is hard.
GAS_MRAYL, HARD_MRAYL = 1.0, 2.5


@dataclass(frozen=True)
class Tissue:
    """Properties of a tissue that determine its appearance."""

    name: str
    impedance_mrayl: float
    speckle: float

    @property
    def look(self):
        """Sort key: gas, then by speckle from fluids upwards, then hard tissues by impedance."""
        if self.impedance_mrayl < GAS_MRAYL:
            return (0, self.speckle, self.name)
        if self.impedance_mrayl > HARD_MRAYL:
            return (2, self.impedance_mrayl, self.name)
        return (1, self.speckle, self.name)


def read_tissues(path=TISSUES):
    """Tissues of insonify's table by name."""
    table = tomllib.loads(Path(path).read_text(encoding="utf-8"))
    tissues = {}
    for name, row in table.items():
        value = {key: entry["value"] for key, entry in row.items() if isinstance(entry, dict) and "value" in entry}
        impedance = value["speed_m_s"] * value["density_kg_m3"] * 1e-6
        speckle = value["scatterer_deviation"] * math.sqrt(value["scatterer_density"])
        tissues[name] = Tissue(name, impedance, speckle)
    return tissues


def order(tissues):
    """Names of `tissues` by appearance."""
    return [t.name for t in sorted(tissues.values(), key=lambda t: t.look)]


@dataclass(frozen=True)
class Segmentation:
    """Conversion of the segmentation to one channel: the index of the class over the greatest index."""

    # Names of the classes in the order of their indices.
    classes: tuple
    # Class of tissues that aren't classes.
    other: str = OTHER

    @classmethod
    def make(cls, tissues=None):
        """Segmentation of insonify's tissue table."""
        return cls((OUTSIDE, *order(tissues or read_tissues())))

    @property
    def scale(self):
        """Factor from the class's index to the tensor's value."""
        return 1.0 / (len(self.classes) - 1)

    def index(self, name):
        """Index of the class of the tissue `name`."""
        return self.classes.index(name if name in self.classes else self.other)

    def unknown(self, names):
        """Those of `names` without a class of their own, which become `other`."""
        return [n for n in names if n not in self.classes]

    def indices(self, names):
        """Class index of each number of a segmentation whose numbers mean `names`: uint8 [256]."""
        table = np.zeros(256, dtype=np.uint8)
        table[: len(names)] = [self.index(name) for name in names]
        return table

    def values(self, names):
        """Channel value of each number of a segmentation whose numbers mean `names`: float32 [256]."""
        return self.indices(names) * np.float32(self.scale)

    def manifest(self):
        """Table ``[segmentation]`` of a model's manifest."""
        return {"encoding": "map", "classes": list(self.classes), "other": self.other}
