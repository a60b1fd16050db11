"""Configurations of trained generators: those that insonify ships, those of the paper's tables, and the paper's own for a GPU."""

import sys
from dataclasses import asdict, dataclass, fields, replace


# Frames of a live session with rolling compounding.
ROLLING = "1x1x9,1x3x9,2x3x9,4x3x9,8x3x9"


@dataclass(frozen=True)
class Config:
    """Configuration of a generator's training, stored in the run's folder."""

    network: str = "stride8"
    variant: str = "MSA"
    # Rendering of input and target: rays x layers x angles. Tuples have several inputs in turn.
    lq: str = "1x1"
    hq: str = "32x3x9"
    # Beam coordinates, SCANLINESxCELL_MM; none: pictures.
    beam: str = ""
    # Share of the picture's detail finer than the grid that the station keeps in the output, 0..=1.
    detail_kept: float = 0.0
    # Exponent of the attenuation that the network sees: 1 is the map itself.
    attenuation_power: float = 0.25
    norm: str = "none"
    steps: int = 14000
    batch: int = 4
    crop: int = 256
    # Pixels of outside around a picture that crops may contain: a station pads so, and a sector may end at the
    # picture's edge.
    border: int = 32
    rate: float = 1e-3
    # Fraction of the steps from which the rate falls towards 0, and from which the norms' statistics are frozen.
    decay_from: float = 0.4
    freeze_from: float = 0.7
    # Limit on the norm of the generator's gradient; 0 for none.
    clip: float = 0.5
    # Weights of the loss's terms; L1's is 1.
    ssim_weight: float = 0.3
    divergence_weight: float = 0.05
    grid_weight: float = 4.0
    # Share of the LQ image in the exported output, for its grain; 0 for networks that have no such share.
    share: float = 0.0
    gan_weight: float = 0.0
    # Adversarial loss: `log` is pix2pix's; `hinge` takes a discriminator with spectral norm.
    gan: str = "log"
    # Learning rate of the discriminator; 0 for the generator's.
    discriminator_rate: float = 0.0
    # Share that the running mean of the weights keeps at a step; it is exported. 0: the last weights are.
    ema: float = 0.0
    # Steps without the GAN term, and steps in which it rises to its weight.
    warmup: int = 0
    ramp: int = 1
    # Width of the discriminator.
    ndf: int = 16
    flip: bool = True
    seed: int = 1

    def to_dict(self):
        """Dictionary for JSON."""
        return asdict(self)

    @classmethod
    def from_dict(cls, values):
        """Inverse of `to_dict`; unknown keys are an error."""
        unknown = set(values) - {f.name for f in fields(cls)}
        if unknown:
            raise ValueError(f"unknown keys {sorted(unknown)}")
        return cls(**values)

    @property
    def data(self):
        """Name of the data set that `scripts/train` renders for it."""
        if not self.hq.endswith("x9"):
            return "single"
        return "rolling" if self.lq == ROLLING else self.lq

    def rate_at(self, step):
        """Learning rate of Adam at a step: constant, then falling linearly towards 0."""
        start = self.decay_from * self.steps
        if step <= start:
            return self.rate
        return self.rate * max(0.01, 1.0 - (step - start) / max(self.steps - start, 1.0))

    def gan_weight_at(self, step):
        """Weight of the GAN term at a step: 0 during the warm-up, then rising linearly."""
        if step < self.warmup:
            return 0.0
        return self.gan_weight * min(1.0, (step - self.warmup + 1) / max(self.ramp, 1))

    def trial(self, steps):
        """The same in so few steps that it only shows that everything runs."""
        if steps < 2:
            raise SystemExit(f"a trial of {steps} steps: it takes 2 at least")
        return replace(self, steps=steps, warmup=min(self.warmup, steps // 2), ramp=1)


FAST = Config(network="stride8", share=0.1)
MIDDLE = Config(network="stride4", share=0.1)
# Range cells of 0.2 mm lose less than speckle holds: a picture comes back with 38 dB.
BEAM = "256x0.2"
# For compounded input, whose grain resembles the target's.
NATURAL = {"divergence_weight": 0.0, "share": 0.25}
# pix2pix's own loss and rate. Its 100 on levels within -1..=1 is 200 on 0..=1, here the inverse of the GAN's weight.
PIX2PIX = Config(
    norm="instance",
    rate=2e-4,
    clip=0.0,
    border=0,
    ssim_weight=0.0,
    divergence_weight=0.0,
    grid_weight=0.0,
    gan_weight=0.005,
    crop=512,
    batch=16,
)
CLASSIC = replace(PIX2PIX, network="unet64", steps=20000, warmup=2000, ramp=3000, ndf=64)
# The paper's schedule.
PAPER = replace(CLASSIC, steps=50000, decay_from=1.0)


def _variants(name, config, variants=("M", "MS", "MSA"), suffix=""):
    return {f"{name}_{variant.lower()}{suffix}": replace(config, variant=variant) for variant in variants}


# Generators by name: NETWORK_VARIANT, for another input or target NETWORK_VARIANT_DATA.
GENERATORS = {
    **_variants("fast", FAST),
    **_variants("middle", MIDDLE),
    **_variants("fast", replace(FAST, lq=ROLLING, **NATURAL), suffix="_rolling"),
    **_variants("middle", replace(MIDDLE, lq=ROLLING, **NATURAL), suffix="_rolling"),
    # A step sees as much of the sector as seven of pictures do.
    **_variants("beam", replace(FAST, beam=BEAM, steps=8000, divergence_weight=0.3)),
    **_variants("beam", replace(FAST, beam=BEAM, steps=8000, lq=ROLLING, divergence_weight=0.0, share=0.35), suffix="_rolling"),
    **_variants("beam4", replace(MIDDLE, beam=BEAM, steps=8000, lq=ROLLING, **NATURAL), suffix="_rolling"),
    **_variants("fast", replace(FAST, hq="32x3x1"), suffix="_single"),
    **_variants("classic", CLASSIC),
    **_variants("paper", PAPER),
}
# Generators in assets/generators, in the order of their training.
SHIPPED = ("beam_m_rolling", "beam_msa", "fast_msa", "fast_ms", "fast_m")
# Generators that only the tables compare with.
TABLE = (
    "fast_m_rolling", "beam_msa_rolling", "beam4_m_rolling",
    "middle_msa", "middle_ms", "middle_m", "middle_m_rolling",
    "fast_msa_single", "fast_ms_single", "fast_m_single",
)  # fmt: skip

if __name__ == "__main__":
    # For scripts/train: the generators of the list that is asked for, or the data set, LQ and HQ of each named one.
    lists = {"shipped": SHIPPED, "table": TABLE}
    if sys.argv[1:2] and sys.argv[1] in lists:
        print(*lists[sys.argv[1]])
    else:
        for name in sys.argv[1:]:
            if name not in GENERATORS:
                raise SystemExit(f"no generator is called {name}; there are {', '.join(GENERATORS)}")
            print(name, GENERATORS[name].data, GENERATORS[name].lq, GENERATORS[name].hq)
