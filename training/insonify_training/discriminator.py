"""patchGAN of four convolutions: judges which patches of a picture are rendered, given their input."""

import torch
import torch.nn.functional as F
from torch import nn
from torch.nn.utils.parametrizations import spectral_norm


class PatchDiscriminator(nn.Module):
    """Logits [n, 1, ~h/4, ~w/4] of an input [n, channels, h, w] and a picture [n, 1, h, w] (Isola et al. 2017).

    `spectral` limits the slope of all layers but the last (Miyato et al. 2018) in place of pix2pix's instance norm, which divides by
    the contrast of a picture and so never sees it. The last layer is free: grain differs by a few hundredths of the levels' range, which
    slopes of 1 would leave far below the margins of the hinge loss.
    """

    def __init__(self, channels, ndf, spectral=False):
        super().__init__()
        self.layers = nn.ModuleList(
            [
                nn.Conv2d(channels + 1, ndf, 4, 2, 1),
                nn.Conv2d(ndf, 2 * ndf, 4, 2, 1),
                nn.Conv2d(2 * ndf, 4 * ndf, 4, 1, 1),
                nn.Conv2d(4 * ndf, 1, 4, 1, 1),
            ]
        )
        self.norms = nn.ModuleList([nn.Identity() if spectral else nn.GroupNorm(c, c) for c in (2 * ndf, 4 * ndf)])
        if spectral:
            for layer in self.layers[:-1]:
                spectral_norm(layer)

    def forward(self, inputs, picture):
        x = F.leaky_relu(self.layers[0](torch.cat([inputs, picture], 1)), 0.2)
        for layer, norm in zip(self.layers[1:3], self.norms):
            x = F.leaky_relu(norm(layer(x)), 0.2)
        return self.layers[3](x)
