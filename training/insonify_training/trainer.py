"""A generator in training: networks, optimisers, one step, and the state for a resume."""

import copy
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
        self.generator = make(config.network, self.encode.channels, config.norm).to(**place)
        if config.share > 0:
            self.generator.share = config.share
        self.generator_adam = self._adam(self.generator, config.rate)
        self.parts = ["generator", "generator_adam"]
        if config.gan_weight > 0:
            hinge = config.gan == "hinge"
            self.discriminator = PatchDiscriminator(self.encode.channels, config.ndf, spectral=hinge).to(**place)
            self.discriminator_adam = self._adam(self.discriminator, config.discriminator_rate or config.rate)
            self.parts += ["discriminator", "discriminator_adam"]
        if config.ema > 0:
            self.average = copy.deepcopy(self.generator).requires_grad_(False)
            self.parts.append("average")
        self.step, self.seconds = 0, 0.0

    def _adam(self, network, rate):
        # On a GPU a step may be part of a CUDA graph, which reads its rate from memory.
        captured = self.device.type == "cuda"
        rate = torch.tensor(rate, device=self.device) if captured else rate
        return torch.optim.Adam(network.parameters(), lr=rate, betas=ADAM_BETAS, capturable=captured)

    @property
    def shown(self):
        """Network that is judged and exported: the running mean of the weights, or the last ones."""
        return self.average if self.config.ema > 0 else self.generator

    @property
    def frozen(self):
        """Whether the norms' statistics are frozen from here on."""
        return self.step >= self.config.freeze_from * self.config.steps

    def _autocast(self):
        # Weights in bfloat16 that are kept from one pass to the next would be those of a CUDA graph's first run.
        on_gpu = self.device.type == "cuda"
        return torch.autocast(self.device.type, torch.bfloat16, enabled=self.bf16, cache_enabled=not on_gpu)

    def schedule(self):
        """Sets the optimisers' rates for this step; returns the weight of the adversarial term."""
        part = self.config.rate_at(self.step) / self.config.rate
        rates = {"generator_adam": self.config.rate, "discriminator_adam": self.config.discriminator_rate or self.config.rate}
        for name in (name for name in self.parts if name.endswith("adam")):
            for group in getattr(self, name).param_groups:
                if torch.is_tensor(group["lr"]):
                    group["lr"].fill_(rates[name] * part)
                else:
                    group["lr"] = rates[name] * part
        return self.config.gan_weight_at(self.step)

    def train(self, batch):
        """One step on a batch; returns the losses as tensors."""
        gan_weight = self.schedule()
        freeze(self.generator, self.frozen)
        self.generator.train()
        inputs, target, mask = self.encode(batch.planes, batch.mask)
        # Positions of windows and patches change from step to step, so that their edges leave no trace.
        offsets = (self.step % 4, self.step * 7 % losses.PATCH)
        seen = self.update(inputs, target, mask, gan_weight if gan_weight > 0 else None, offsets)
        self.step += 1
        return {**seen, "rate": self.config.rate_at(self.step - 1)}

    def update(self, inputs, target, mask, gan_weight=None, offsets=(0, 0), area=None, view=None):
        """Changes the weights by the losses of a batch, and returns the losses as tensors.

        `gan_weight`, a number or a tensor, is left out before the adversarial term begins. `offsets` are those of SSIM's windows and
        of the divergence's patches, px. `area` [n, 1, h, 1] weighs the rows of L1. With a `view`, the divergence is that of the picture
        which the station makes. Nothing here waits for the device, so that a CUDA graph can hold it.
        """
        config = self.config
        with self._autocast():
            output = losses.soft_clip(self.generator(inputs).float()) * mask
        loss = losses.l1(output, target, area)
        seen = {"l1": loss.detach()}
        if config.ssim_weight > 0:
            dissimilarity = losses.dissimilarity(output, target, offsets[0])
            seen["dissimilarity"] = dissimilarity.detach()
            loss = loss + config.ssim_weight * dissimilarity
        if config.divergence_weight > 0:
            pair = (output, target)
            if view is not None:
                pair = (losses.soft_clip(view.of(output, inputs[:, :1], config.detail_kept)), view.hq)
            divergence = losses.patch_divergence(*pair, offsets[1])
            seen["divergence"] = divergence.detach()
            loss = loss + config.divergence_weight * divergence
        if config.grid_weight > 0:
            grid = losses.grid(output, target)
            seen["grid"] = grid.detach()
            loss = loss + config.grid_weight * grid
        if gan_weight is not None:
            of_discriminator, of_generator = losses.GAN[config.gan]
            seen["discriminator"] = self._train_discriminator(inputs, output.detach(), target, of_discriminator)
            self.discriminator.requires_grad_(False)
            with self._autocast():
                gan = of_generator(self.discriminator(inputs, output))
            self.discriminator.requires_grad_(True)
            seen["gan"] = gan.detach()
            loss = loss + gan_weight * gan
        self.generator_adam.zero_grad(set_to_none=True)
        loss.backward()
        if config.clip > 0:
            torch.nn.utils.clip_grad_norm_(self.generator.parameters(), config.clip, foreach=True)
        self.generator_adam.step()
        if config.ema > 0:
            with torch.no_grad():
                torch._foreach_lerp_(list(self.average.parameters()), list(self.generator.parameters()), 1 - config.ema)
                # Norms follow their statistics in the generator alone.
                for mean, last in zip(self.average.buffers(), self.generator.buffers()):
                    mean.copy_(last)
        return seen

    def _train_discriminator(self, inputs, fake, real, of_discriminator):
        with self._autocast():
            loss = of_discriminator(self.discriminator(inputs, real), self.discriminator(inputs, fake))
        self.discriminator_adam.zero_grad(set_to_none=True)
        loss.backward()
        self.discriminator_adam.step()
        return loss.detach()

    @torch.no_grad()
    def generate(self, batch):
        """Output with frozen norms, target and mask of a batch: within 0..=1."""
        inputs, target, mask = self.encode(batch.planes, batch.mask)
        freeze(self.shown.eval())
        with self._autocast():
            output = self.shown(inputs).float()
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

    def weights(self):
        """State of the exported network alone: enough to export it, and a tenth of `state`."""
        return {**self.state(), **dict.fromkeys(self.parts), "generator": self.shown.state_dict(), "average": self.shown.state_dict()}

    def load(self, state):
        """Resumes from `state`. Of parts that are None, as in `weights`, nothing is loaded."""
        for part in self.parts:
            if part in state and state[part] is None:
                continue
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
