"""Encoding of a tuple's bytes as a network's input tensor, like the station's by the model's manifest."""

import torch

from .dataset import ATTENUATION, HQ, LQ, SEGMENTATION

# Planes of maps that are read through a table.
PLANES = {"segmentation": SEGMENTATION, "attenuation": ATTENUATION}

# Channels of each variant, in input order (Zhang et al. 2020). The LQ image is the first.
VARIANTS = {
    "M": ("image", "mask"),
    "MS": ("image", "mask", "segmentation"),
    "MSA": ("image", "mask", "segmentation", "attenuation"),
}


class Encoder:
    """Makes input, target and mask of a batch of bytes."""

    def __init__(self, variant, segmentation, data, attenuation_power=1.0, device="cpu"):
        self.names = VARIANTS[variant]
        self.device = torch.device(device)
        # Attenuation falls by orders of magnitude with depth: a root of it shows deep shadows as well.
        levels = torch.arange(256, dtype=torch.float64) / 255
        attenuation = (levels ** (attenuation_power / data.attenuation_power)).float()
        self.tables = {
            "segmentation": torch.from_numpy(segmentation.values(data.classes)).to(self.device),
            "attenuation": attenuation.to(self.device),
        }

    @property
    def channels(self):
        """Channels of the input tensor."""
        return len(self.names)

    @property
    def outside(self):
        """Input [1, channels, 1, 1] of a pixel outside the sector: zeros in every map."""
        planes, mask = (torch.zeros(1, count, 1, 1, dtype=torch.uint8, device=self.device) for count in (4, 1))
        return self.input(planes, mask)

    def input(self, planes, mask):
        """Input float32 [n, channels, h, w] of planes uint8 [n, 4, h, w] and mask uint8 [n, 1, h, w]."""
        planes, mask = self._bytes(planes), self._bytes(mask)
        n, _, height, width = planes.shape
        out = torch.empty((n, self.channels, height, width), device=self.device)
        out = out.to(memory_format=torch.channels_last)
        for at, name in enumerate(self.names):
            if name == "image":
                out[:, at] = planes[:, LQ].float() * (1 / 255)
            elif name == "mask":
                out[:, at] = (mask[:, 0] > 0).float()
            else:
                out[:, at] = self.tables[name][planes[:, PLANES[name]].int()]
        return out

    def __call__(self, planes, mask):
        """Input [n, channels, h, w], target [n, 1, h, w] and mask [n, 1, h, w], float32 within 0..=1."""
        inside = (self._bytes(mask) > 0).float()
        target = self._bytes(planes)[:, HQ : HQ + 1].float() * (1 / 255) * inside
        return self.input(planes, mask), target, inside

    def _bytes(self, array):
        return array if torch.is_tensor(array) else torch.from_numpy(array).to(self.device)
