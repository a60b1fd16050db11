"""A generator in training: networks, optimisers, one step, and the state for a resume."""

import copy
import os

import torch

from . import losses
from .channels import Encoder
from .classes import Segmentation
from .discriminator import PatchDiscriminator
from .networks import Norm, freeze, make

ADAM_BETAS = (0.5, 0.999)


class Trainer:
    """State of a training run."""

    def __init__(self, config, data, device="cpu", bf16=False):
        self.config, self.device, self.bf16 = config, torch.device(device), bf16
        self.segmentation = Segmentation.make(config.segmentation)
        self.encode = Encoder(config.variant, self.segmentation, data, config.attenuation_power, device)
        torch.manual_seed(config.seed)
        place = {"device": self.device, "memory_format": torch.channels_last}
        self.generator = make(config.network, self.encode.channels, config.norm, self.encode.image).to(**place)
        self.discriminator = PatchDiscriminator(self.encode.channels, config.ndf).to(**place)
        self.average = copy.deepcopy(self.generator).eval().requires_grad_(False)
        adam = {"lr": config.rate, "betas": ADAM_BETAS}
        self.generator_adam = torch.optim.Adam(self.generator.parameters(), **adam)
        self.discriminator_adam = torch.optim.Adam(self.discriminator.parameters(), **adam)
        self.step, self.seconds = 0, 0.0

    @property
    def frozen(self):
        """Whether the norms' statistics are frozen from here on."""
        return self.step >= self.config.freeze_from * self.config.steps

    def _autocast(self):
        return torch.autocast(self.device.type, torch.bfloat16, enabled=self.bf16)

    def train(self, batch):
        """One step on a batch; returns the losses as tensors."""
        config = self.config
        inputs, target, mask = self.encode(batch.planes, batch.mask)
        rate = config.rate_at(self.step)
        for adam in (self.generator_adam, self.discriminator_adam):
            for group in adam.param_groups:
                group["lr"] = rate
        weights = config.weights_at(self.step)
        freeze(self.generator, self.frozen)
        self.generator.train()
        with self._autocast():
            output = losses.soft_clip(self.generator(inputs).float()) * mask
        seen = {}
        loss = losses.l1(output, target)
        seen["l1"] = loss.detach()
        if config.histogram_weight > 0:
            # Patch positions change from step to step, so that their edges leave no trace.
            histogram = losses.patch_histogram(output, target, self.step * 7 % losses.PATCH)
            seen["histogram"] = histogram.detach()
            loss = loss + config.histogram_weight * histogram
        if weights.divergence > 0:
            divergence = losses.patch_divergence(output, target, self.step * 7 % losses.PATCH)
            seen["divergence"] = divergence.detach()
            loss = loss + weights.divergence * divergence
        if weights.grid > 0:
            grid = losses.grid(output, target)
            seen["grid"] = grid.detach()
            loss = loss + weights.grid * grid
        if weights.ssim > 0:
            # For every other picture: all would cost as much as the network.
            dissimilarity = losses.dissimilarity(output[::2], target[::2])
            seen["dissimilarity"] = dissimilarity.detach()
            loss = loss + weights.ssim * dissimilarity
        loss = config.l1_weight * loss
        if weights.gan > 0:
            seen["discriminator"] = self._train_discriminator(inputs, output.detach(), target)
            self.discriminator.requires_grad_(False)
            with self._autocast():
                gan = losses.generator_gan_loss(self.discriminator(inputs, output))
            self.discriminator.requires_grad_(True)
            seen["gan"] = gan.detach()
            loss = loss + weights.gan * gan
        self.generator_adam.zero_grad(set_to_none=True)
        loss.backward()
        if config.clip > 0:
            torch.nn.utils.clip_grad_norm_(self.generator.parameters(), config.clip, foreach=True)
        self.generator_adam.step()
        self._follow()
        self.step += 1
        return {**seen, "rate": rate, "gan_weight": weights.gan}

    def _train_discriminator(self, inputs, fake, real):
        with self._autocast():
            loss = losses.discriminator_loss(self.discriminator(inputs, real), self.discriminator(inputs, fake))
        self.discriminator_adam.zero_grad(set_to_none=True)
        loss.backward()
        self.discriminator_adam.step()
        return loss.detach()

    @torch.no_grad()
    def _follow(self):
        """Moves the averaged weights towards the present ones; in the beginning they are their mean."""
        part = max(1.0 - self.config.ema, 1.0 / (self.step + 2))
        averaged, present = list(self.average.parameters()), list(self.generator.parameters())
        torch._foreach_lerp_(averaged, present, part)
        for theirs, ours in zip(self.average.buffers(), self.generator.buffers()):
            theirs.copy_(ours)

    @torch.no_grad()
    def generate(self, batch):
        """Output of the averaged weights with frozen norms, target and mask of a batch: within 0..=1."""
        inputs, target, mask = self.encode(batch.planes, batch.mask)
        freeze(self.average)
        with self._autocast():
            output = self.average(inputs).float()
        return output.clamp(0, 1) * mask, target, mask

    @torch.no_grad()
    def calibrate(self, batches):
        """Sets the averaged network's statistics to their mean over `batches`."""
        for norm in (m for m in self.average.modules() if isinstance(m, Norm)):
            norm.passes.zero_()
            norm.frozen, norm.every, norm.momentum = False, 1, 0.0
        self.average.train()
        for batch in batches:
            self.average(self.encode(batch.planes, batch.mask)[0])
        self.average.eval()
        freeze(self.average)

    def state(self):
        """State from which `load` resumes exactly."""
        parts = ("generator", "discriminator", "average", "generator_adam", "discriminator_adam")
        return {
            "format": 1,
            "config": self.config.to_dict(),
            "step": self.step,
            "seconds": self.seconds,
            **{part: getattr(self, part).state_dict() for part in parts},
        }

    def load(self, state):
        """Resumes from `state`."""
        for part in ("generator", "discriminator", "average", "generator_adam", "discriminator_adam"):
            try:
                getattr(self, part).load_state_dict(state[part])
            except (RuntimeError, ValueError) as error:
                raise SystemExit(f"the checkpoint's {part} is of another network of that name: train anew ({error})") from None
        self.step, self.seconds = state["step"], state["seconds"]


def save_checkpoint(path, state):
    """Writes a checkpoint; a killed run leaves the last one complete."""
    partial = path.with_suffix(".part")
    with open(partial, "wb") as file:
        torch.save(state, file)
        file.flush()
        os.fsync(file.fileno())
    os.replace(partial, path)


def read_checkpoint(path):
    """Reads a checkpoint of `save_checkpoint`, without running any code in it."""
    return torch.load(path, map_location="cpu", weights_only=True)
