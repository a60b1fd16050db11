"""A generator in training: networks, optimisers, one step, and the state for a resume."""

import os

import torch

from . import losses
from .channels import Encoder
from .classes import Segmentation
from .discriminator import PatchDiscriminator
from .networks import freeze, make

ADAM_BETAS = (0.5, 0.999)


class Trainer:
    """State of a training run."""

    def __init__(self, config, data, device="cpu", bf16=False):
        self.config, self.device, self.bf16 = config, torch.device(device), bf16
        self.segmentation = Segmentation.make()
        self.encode = Encoder(config.variant, self.segmentation, data, config.attenuation_power, device)
        torch.manual_seed(config.seed)
        place = {"device": self.device, "memory_format": torch.channels_last}
        adam = {"lr": config.rate, "betas": ADAM_BETAS}
        self.generator = make(config.network, self.encode.channels, config.norm).to(**place)
        if config.share > 0:
            self.generator.share = config.share
        self.generator_adam = torch.optim.Adam(self.generator.parameters(), **adam)
        self.parts = ["generator", "generator_adam"]
        if config.gan_weight > 0:
            self.discriminator = PatchDiscriminator(self.encode.channels, config.ndf).to(**place)
            self.discriminator_adam = torch.optim.Adam(self.discriminator.parameters(), **adam)
            self.parts += ["discriminator", "discriminator_adam"]
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
        rate, gan_weight = config.rate_at(self.step), config.gan_weight_at(self.step)
        for part in (name for name in self.parts if name.endswith("adam")):
            for group in getattr(self, part).param_groups:
                group["lr"] = rate
        freeze(self.generator, self.frozen)
        self.generator.train()
        with self._autocast():
            output = losses.soft_clip(self.generator(inputs).float()) * mask
        loss = losses.l1(output, target)
        seen = {"l1": loss.detach()}
        if config.ssim_weight > 0:
            # Positions of windows and patches change from step to step, so that their edges leave no trace.
            dissimilarity = losses.dissimilarity(output, target, self.step % 4)
            seen["dissimilarity"] = dissimilarity.detach()
            loss = loss + config.ssim_weight * dissimilarity
        if config.divergence_weight > 0:
            divergence = losses.patch_divergence(output, target, self.step * 7 % losses.PATCH)
            seen["divergence"] = divergence.detach()
            loss = loss + config.divergence_weight * divergence
        if config.grid_weight > 0:
            grid = losses.grid(output, target)
            seen["grid"] = grid.detach()
            loss = loss + config.grid_weight * grid
        if gan_weight > 0:
            seen["discriminator"] = self._train_discriminator(inputs, output.detach(), target)
            self.discriminator.requires_grad_(False)
            with self._autocast():
                gan = losses.generator_gan_loss(self.discriminator(inputs, output))
            self.discriminator.requires_grad_(True)
            seen["gan"] = gan.detach()
            loss = loss + gan_weight * gan
        self.generator_adam.zero_grad(set_to_none=True)
        loss.backward()
        if config.clip > 0:
            torch.nn.utils.clip_grad_norm_(self.generator.parameters(), config.clip, foreach=True)
        self.generator_adam.step()
        self.step += 1
        return {**seen, "rate": rate}

    def _train_discriminator(self, inputs, fake, real):
        with self._autocast():
            loss = losses.discriminator_loss(self.discriminator(inputs, real), self.discriminator(inputs, fake))
        self.discriminator_adam.zero_grad(set_to_none=True)
        loss.backward()
        self.discriminator_adam.step()
        return loss.detach()

    @torch.no_grad()
    def generate(self, batch):
        """Output with frozen norms, target and mask of a batch: within 0..=1."""
        inputs, target, mask = self.encode(batch.planes, batch.mask)
        freeze(self.generator.eval())
        with self._autocast():
            output = self.generator(inputs).float()
        return output.clamp(0, 1) * mask, target, mask

    def state(self):
        """State from which `load` resumes exactly."""
        return {
            "format": 2,
            "config": self.config.to_dict(),
            "step": self.step,
            "seconds": self.seconds,
            **{part: getattr(self, part).state_dict() for part in self.parts},
        }

    def load(self, state):
        """Resumes from `state`."""
        for part in self.parts:
            try:
                getattr(self, part).load_state_dict(state[part])
            except (KeyError, RuntimeError, ValueError) as error:
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
