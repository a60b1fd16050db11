"""patchGAN of four convolutions: judges which patches of a picture are rendered, given their input."""

import torch
import torch.nn.functional as F
from torch import nn


class PatchDiscriminator(nn.Module):
    """Logits [n, 1, ~h/4, ~w/4] of an input [n, channels, h, w] and a picture [n, 1, h, w] (Isola et al. 2017)."""

    def __init__(self, channels, ndf):
        super().__init__()
        self.layers = nn.ModuleList(
            [
                nn.Conv2d(channels + 1, ndf, 4, 2, 1),
                nn.Conv2d(ndf, 2 * ndf, 4, 2, 1),
                nn.Conv2d(2 * ndf, 4 * ndf, 4, 1, 1),
                nn.Conv2d(4 * ndf, 1, 4, 1, 1),
            ]
        )
        self.norms = nn.ModuleList([nn.GroupNorm(c, c) for c in (2 * ndf, 4 * ndf)])

    def forward(self, inputs, picture):
        x = F.leaky_relu(self.layers[0](torch.cat([inputs, picture], 1)), 0.2)
        for layer, norm in zip(self.layers[1:3], self.norms):
            x = F.leaky_relu(norm(layer(x)), 0.2)
        return self.layers[3](x)
