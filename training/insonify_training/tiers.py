"""Configurations of trained tiers: those that insonify ships, and the paper's own schedule for a GPU."""

from dataclasses import asdict, dataclass, fields, replace

from .losses import falling, gan_weight


@dataclass(frozen=True)
class Weights:
    """Weights of the loss's terms at a step. `gan` is relative to L1's own weight, the others to an L1 weight of 1."""

    gan: float
    divergence: float
    grid: float
    ssim: float


@dataclass(frozen=True)
class Config:
    """Configuration of a generator's training, stored in the run's folder."""

    network: str = "stride8"
    variant: str = "MSA"
    segmentation: str = "map"
    # Exponent of the attenuation that the network sees: 1 is the map itself.
    attenuation_power: float = 0.25
    norm: str = "none"
    steps: int = 12000
    batch: int = 4
    crop: int = 256
    # Pixels of outside around a picture that crops may contain: a station pads so, and a sector may end at the
    # picture's edge.
    border: int = 32
    rate: float = 7e-4
    # Limit on the norm of the generator's gradient; 0 for none. One crop in a thousand would set a network without norm
    # back.
    clip: float = 100.0
    # Final steps, with a restarted falling rate and other weights: they regain the SSIM that the GAN term cost, and
    # keep the grain.
    polish: int = 5000
    polish_rate: float = 6e-4
    polish_gan_weight: float = 0.0
    polish_divergence_weight: float = 0.6
    polish_ssim_weight: float = 2.5
    # Fraction of the steps before the polish from which the rate falls towards 0; fraction of all steps from which the
    # norms' statistics are frozen.
    decay_from: float = 0.6
    freeze_from: float = 0.7
    gan_weight: float = 0.5
    # The paper's 100 is for levels within -1..=1; here they are within 0..=1.
    l1_weight: float = 200.0
    # Weight of the patches' histogram distance, relative to an L1 weight of 1.
    histogram_weight: float = 1.0
    # Likewise of the patches' divergence, pKL; and the step from which on it applies.
    divergence_weight: float = 0.6
    divergence_from: int = 5500
    # Likewise of a pattern with the network's stride, from the same step on.
    grid_weight: float = 4.0
    # Likewise of 1 minus the structural similarity.
    ssim_weight: float = 0.3
    # Steps without the GAN term, and steps in which it rises to its weight.
    warmup: int = 4000
    ramp: int = 400
    ndf: int = 8
    # Decay of the running mean of the weights, which is exported.
    ema: float = 0.999
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
    def main_steps(self):
        """Steps before the polish, which takes at most half of all steps."""
        return self.steps - min(self.polish, self.steps // 2)

    def rate_at(self, step):
        """Learning rate of Adam at a step."""
        if step < self.main_steps:
            return falling(step, self.main_steps, self.rate, self.decay_from)
        return falling(step - self.main_steps, self.steps - self.main_steps, self.polish_rate, 0.0)

    def weights_at(self, step):
        """Weights of the scheduled terms at a step."""

        def now(weight, polish):
            # A term that is switched off stays off.
            return polish if weight > 0 and step >= self.main_steps else weight

        late = step >= self.divergence_from
        gan = now(self.gan_weight, self.polish_gan_weight)
        return Weights(
            gan=gan_weight(step, gan, self.warmup, self.ramp),
            divergence=now(self.divergence_weight, self.polish_divergence_weight) if late else 0.0,
            grid=self.grid_weight if late else 0.0,
            ssim=now(self.ssim_weight, self.polish_ssim_weight),
        )

    def trial(self, steps):
        """The same in so few steps that it only shows that everything runs.

        The second half has the late terms, the last quarter the polish.
        """
        if steps < 4:
            raise SystemExit(f"a trial of {steps} steps: all phases take 4 at least")
        polish = min(self.polish, steps // 4)
        return replace(self, steps=steps, warmup=steps // 2, divergence_from=steps // 2, ramp=1, polish=polish)


FAST = Config(network="stride8")
MIDDLE = Config(network="stride4")
# pix2pix's own loss and rate.
PIX2PIX = Config(
    norm="instance",
    rate=2e-4,
    clip=0.0,
    border=0,
    steps=10500,
    polish=0,
    gan_weight=1.0,
    histogram_weight=0.0,
    divergence_weight=0.0,
    grid_weight=0.0,
    ssim_weight=0.0,
    warmup=6000,
    ramp=600,
)
# As in the paper, but small.
CLASSIC = replace(PIX2PIX, network="unet16", ndf=16)
# For a GPU: the paper's network and schedule.
PAPER = replace(
    PIX2PIX, network="unet64", steps=50000, batch=16, crop=512, decay_from=1.0, ndf=64, warmup=2000, ramp=3000
)


def _variants(name, config, variants):
    return {f"{name}_{variant.lower()}": replace(config, variant=variant) for variant in variants}


# Tiers by name, `NETWORK_VARIANT`.
TIERS = {
    **_variants("fast", FAST, ("M", "MS", "MSA", "Maps")),
    **_variants("middle", MIDDLE, ("M", "MS", "MSA", "Maps")),
    **_variants("classic", CLASSIC, ("M", "MS", "MSA", "Maps")),
    **_variants("paper", PAPER, ("M", "MS", "MSA", "Maps")),
}
# Tiers that `make train` trains, in this order.
SHIPPED = ("fast_msa", "fast_ms", "fast_m", "fast_maps", "middle_msa")

if __name__ == "__main__":
    # For scripts/train.
    print(*SHIPPED)
