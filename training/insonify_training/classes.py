"""Mapping from tissues to the classes that a generator sees.

Tissues are identified by name, since their numbers differ between data sets and stations. Two encodings:

- ``map``: one channel, the class's index over the greatest index. Each tissue of ``assets/tissues.toml`` is a class,
  in the order of `order`: neighbours look alike, so intermediate values are meaningful.
- ``classes``: one channel per group of tissues (`GROUPS`), 0 or 1.
"""

import math
import tomllib
from dataclasses import dataclass
from pathlib import Path

import numpy as np

TISSUES = Path(__file__).resolve().parents[2] / "assets/tissues.toml"

OUTSIDE = "outside"
# Class of a tissue that is not in the table.
OTHER = "soft_tissue"
# Groups, from dark to bright between the two that cast shadows.
GROUPS = (OUTSIDE, "gas", "fluid", "dark", "mid", "iso", "bright", "hard")
# Upper limits of the speckle's amplitude (deviation x sqrt(density)) in the groups fluid, dark, mid, iso.
LIMITS = (0.0006, 0.0045, 0.0075, 0.0125)
# Impedances, MRayl, below which a tissue is gas, and above which it is hard.
GAS_MRAYL, HARD_MRAYL = 1.0, 2.5


@dataclass(frozen=True)
class Tissue:
    """Properties of a tissue that determine its appearance."""

    name: str
    impedance_mrayl: float
    speckle: float

    @property
    def group(self):
        """Group of `GROUPS` that the tissue belongs to."""
        if self.impedance_mrayl < GAS_MRAYL:
            return "gas"
        if self.impedance_mrayl > HARD_MRAYL:
            return "hard"
        below = (name for name, limit in zip(("fluid", "dark", "mid", "iso"), LIMITS) if self.speckle < limit)
        return next(below, "bright")


def read_tissues(path=TISSUES):
    """Tissues of insonify's table by name."""
    table = tomllib.loads(Path(path).read_text(encoding="utf-8"))
    tissues = {}
    for name, row in table.items():
        value = {key: entry["value"] for key, entry in row.items() if isinstance(entry, dict)}
        impedance = value["speed_m_s"] * value["density_kg_m3"] * 1e-6
        speckle = value["scatterer_deviation"] * math.sqrt(value["scatterer_density"])
        tissues[name] = Tissue(name, impedance, speckle)
    return tissues


def order(tissues):
    """Names of `tissues` by appearance: gas, then by speckle from fluids upwards, then hard tissues."""
    key = lambda t: (GROUPS.index(t.group), t.impedance_mrayl if t.group == "hard" else t.speckle, t.name)
    return [t.name for t in sorted(tissues.values(), key=key)]


# Encodings of the segmentation as channels.
ENCODINGS = ("map", "classes")


@dataclass(frozen=True)
class Segmentation:
    """Conversion of the segmentation to channels."""

    encoding: str
    # Names of the classes in the order of their indices.
    classes: tuple
    # Class of each tissue whose name differs from its class.
    of: dict
    # Class of all other tissues.
    other: str

    @classmethod
    def make(cls, encoding, tissues=None):
        """Segmentation of insonify's tissue table in the encoding `map` or `classes`."""
        tissues = tissues or read_tissues()
        if encoding == "map":
            return cls("map", (OUTSIDE, *order(tissues)), {}, OTHER)
        if encoding == "classes":
            of = {name: tissues[name].group for name in order(tissues)}
            return cls("classes", GROUPS, of, tissues[OTHER].group)
        raise ValueError(f"segmentation is `{encoding}`; it must be one of {', '.join(ENCODINGS)}")

    @property
    def channels(self):
        """Number of channels."""
        return 1 if self.encoding == "map" else len(self.classes)

    @property
    def scale(self):
        """Factor from the class's index (or 0 and 1) to the tensor's value."""
        return 1.0 / (len(self.classes) - 1) if self.encoding == "map" else 1.0

    def index(self, name):
        """Index of the class of the tissue `name`."""
        name = self.of.get(name, name)
        return self.classes.index(name if name in self.classes else self.other)

    def unknown(self, names):
        """Those of `names` without a class of their own, which become `other`."""
        return [n for n in names if n not in self.of and n not in self.classes]

    def indices(self, names):
        """Class index of each number of a segmentation whose numbers mean `names`: uint8 [256]."""
        table = np.zeros(256, dtype=np.uint8)
        table[: len(names)] = [self.index(name) for name in names]
        return table

    def values(self, names):
        """Channel values of each number of a segmentation whose numbers mean `names`: float32 [256, channels]."""
        indices = self.indices(names)
        if self.encoding == "map":
            return (indices[:, None] * np.float32(self.scale)).astype(np.float32)
        return np.eye(len(self.classes), dtype=np.float32)[indices]

    def manifest(self):
        """Table ``[segmentation]`` of a model's manifest."""
        table = {"encoding": self.encoding, "classes": list(self.classes), "other": self.other}
        return {**table, "of": dict(self.of)} if self.of else table
