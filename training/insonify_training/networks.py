"""Networks: from the channels of a frame to its grey levels / 255.

All are convolutional and take sides that are a multiple of `padding_multiple`. Each norm directly follows a
convolution, into which `fold` merges it once its statistics are frozen.
"""

import copy

import torch
import torch.nn.functional as F
from torch import nn

EPS = 1e-5
# `none` omits the norm.
NORMS = ("none", "instance")
# Statistics are updated on every n-th training pass, by this fraction: they change slowly, and reading them is
# expensive.
FOLLOW_EVERY, MOMENTUM = 4, 0.02


class Norm(nn.Module):
    """Instance norm that tracks its statistics, and can be frozen to them.

    Live statistics differ between a crop and the full field of view; frozen ones are the same everywhere.
    """

    def __init__(self, channels):
        super().__init__()
        self.weight, self.bias = nn.Parameter(torch.ones(channels)), nn.Parameter(torch.zeros(channels))
        self.register_buffer("mean", torch.zeros(channels))
        self.register_buffer("variance", torch.ones(channels))
        self.register_buffer("passes", torch.zeros((), dtype=torch.long))
        self.frozen = False
        self.every, self.momentum = FOLLOW_EVERY, MOMENTUM

    def forward(self, x):
        if self.frozen:
            return F.batch_norm(x, self.mean, self.variance, self.weight, self.bias, False, 0.0, EPS)
        if self.training:
            if self.passes % self.every == 0:
                self.follow(x)
            self.passes += 1
        # One group per channel is instance norm, and keeps channels_last.
        return F.group_norm(x, x.shape[1], self.weight, self.bias, EPS)

    @torch.no_grad()
    def follow(self, x):
        """Moves the statistics towards those of `x`; in the beginning they are the mean."""
        variance, mean = (s.mean(0) for s in torch.var_mean(x.detach().float(), (2, 3), unbiased=False))
        part = max(self.momentum, 1.0 / (1 + int(self.passes) // self.every))
        self.mean.lerp_(mean, part)
        self.variance.lerp_(variance, part)


def freeze(network, frozen=True):
    """Freezes the norms of `network` to their tracked statistics."""
    for module in network.modules():
        if isinstance(module, Norm):
            module.frozen = frozen


class Conv(nn.Sequential):
    """A convolution and its norm."""

    def __init__(self, inputs, outputs, kernel=3, stride=1, padding=1, norm="none", transposed=False):
        layer = nn.ConvTranspose2d if transposed else nn.Conv2d
        parts = [layer(inputs, outputs, kernel, stride, padding)]
        if norm not in NORMS:
            raise ValueError(f"norm is `{norm}`; it must be one of {', '.join(NORMS)}")
        super().__init__(*parts, *([Norm(outputs)] if norm == "instance" else []))

    def folded(self):
        """Single convolution equivalent to convolution and frozen norm."""
        layer = copy.deepcopy(self[0])
        if len(self) == 2:
            norm = self[1]
            scale = norm.weight * torch.rsqrt(norm.variance + EPS)
            shape = (1, -1, 1, 1) if isinstance(layer, nn.ConvTranspose2d) else (-1, 1, 1, 1)
            layer.weight.data = layer.weight * scale.view(shape)
            layer.bias.data = (layer.bias - norm.mean) * scale + norm.bias
        return layer


def fold(network):
    """Copy of `network` for the runtime: its norms and its share of the image folded into the convolutions."""
    network = copy.deepcopy(network).float().eval()
    freeze(network)

    def visit(module):
        for name, child in module.named_children():
            if isinstance(child, Conv):
                setattr(module, name, child.folded())
            else:
                visit(child)

    visit(network)
    network.requires_grad_(False)
    if getattr(network, "share", 0) > 0:
        network.fold_share()
    return network


def tent(side):
    """Weights [side * side, 1, 3, 3] by which the pixels of a cell interpolate linearly between it and its neighbours."""
    place = (torch.arange(side) + 0.5) / side - 0.5
    weights = torch.stack([(-place).clamp_min(0), 1 - place.abs(), place.clamp_min(0)], 1)
    return torch.einsum("ai,bj->abij", weights, weights).reshape(side * side, 1, 3, 3)


def grain(image, side=5, floor=0.02):
    """Fine detail of `image` [n, 1, h, w], divided by its own local deviation: about 1 in speckle of any level, 0 in black.

    Mean and deviation are of `side` x `side` pixels. `floor` is the deviation, of levels within 0..=1, below which detail fades.
    """
    mean = lambda x: F.avg_pool2d(x, side, 1, side // 2, count_include_pad=False)  # noqa: E731
    detail = image - mean(image)
    return detail / (mean(detail * detail) + floor**2).sqrt()


class StemNet(nn.Module):
    """A strided convolution as the stem, a small U-Net at the coarse scales, a pixel shuffle as the head.

    `widths` are the channels of its scales, each half as fine as the previous one. Convolutions at the finest scale
    take most of the time: only one follows the stem's skip. The head sums two parts: one only mixes the channels of a
    cell; the other interpolates `SMOOTH` channels between cells, without which cells of `stride` pixels are visible.

    The first channel is the LQ image. The output is b + g * image: the gain g, one for each `GAIN_PX` x `GAIN_PX` pixels,
    sets how much of the image's grain is kept. With `grained`, h * grain(image) is added; h has the
    resolution of g. It gives any place the target's strength of grain, whatever the image's level. Where the image is black it has no grain to give, and detail that b drew there
    would be a lattice of cells: b is smoothed there (`calm`). In evaluation, and where it is exported, `share` of the image
    replaces as much of that output.
    """

    GAIN_PX = 2
    SMOOTH = 4
    # Mean level of the image, within 0..=1, below which detail of the base fades.
    DARK = 0.12

    def __init__(self, channels, stride, widths, norm="none", grained=False):
        super().__init__()
        self.share, self.grained = 0.0, grained
        weights = torch.tensor([0.25, 0.5, 0.25])
        self.register_buffer("binomial", (weights[:, None] * weights)[None, None], persistent=False)
        self.stride = stride
        self.padding_multiple = stride << (len(widths) - 1)
        self.stem = Conv(channels, widths[0], stride, stride, 0, norm)
        self.down = nn.ModuleList(Conv(a, b, stride=2, norm=norm) for a, b in zip(widths, widths[1:]))
        self.bottom = nn.ModuleList(Conv(widths[-1], widths[-1], norm=norm) for _ in range(2))
        self.up = nn.ModuleList(Conv(b, a, 1, padding=0) for a, b in zip(widths, widths[1:]))
        self.decode = nn.ModuleList(Conv(w, w, norm=norm) for w in widths[:-1])
        sides = (stride, *[stride // self.GAIN_PX] * (1 + grained))
        self.shapes = [side * side for side in sides]
        self.head = Conv(widths[0], sum(self.shapes), 1, padding=0)
        self.reduce = Conv(widths[0], self.SMOOTH, 1, padding=0)
        self.spread = Conv(self.SMOOTH, sum(self.shapes))
        with torch.no_grad():
            # Starts as an interpolation, and at half of the image: a training that began at the image itself never left it.
            self.spread[0].weight.mul_(0.1).add_(torch.cat([tent(side) for side in sides]))
            self.spread[0].bias.zero_()
            gain = slice(self.shapes[0], sum(self.shapes[:2]))
            self.head[0].bias[gain] = 0.5
            if grained:
                self.spread[0].weight[gain.stop :].zero_()

    def fold_share(self):
        """Puts the share into the head: (1 - share) * output + share * image has another base and other gains."""
        for part in (self.head, self.spread):
            part.weight.mul_(1 - self.share)
            part.bias.mul_(1 - self.share)
        self.head.bias[self.shapes[0] : sum(self.shapes[:2])].add_(self.share)
        self.share = 0.0

    def calm(self, base, image):
        """The base at full resolution, without detail where the surrounding of `image` is below `DARK`.

        The weights 1, 2, 1 over means of cells leave nothing of a pattern whose period is one cell or two.
        """
        coarse = torch.cat([base.mean(1, keepdim=True), F.avg_pool2d(image, self.stride)], 1)
        coarse = F.conv2d(F.pad(coarse, (1, 1, 1, 1), mode="replicate"), self.binomial.expand(2, 1, 3, 3), groups=2)
        coarse = F.interpolate(coarse, scale_factor=float(self.stride), mode="bilinear", align_corners=False)
        smooth, level = coarse.split(1, 1)
        detail = F.pixel_shuffle(base, self.stride) - smooth
        return smooth + detail * (level / self.DARK).clamp(0, 1)

    def forward(self, inputs):
        x = F.relu(self.stem(inputs))
        skips = []
        for down in self.down:
            skips.append(x)
            x = F.relu(down(x))
        for bottom in self.bottom:
            x = F.relu(bottom(x))
        for up, decode, skip in zip(reversed(self.up), reversed(self.decode), reversed(skips)):
            x = F.interpolate(up(x), scale_factor=2.0, mode="nearest") + skip
            x = F.relu(decode(x))
        base, *gains = (self.head(x) + self.spread(self.reduce(x))).split(self.shapes, 1)
        image = inputs[:, :1]
        output = self.calm(base, image) if self.grained else F.pixel_shuffle(base, self.stride)
        for gain, of in zip(gains, (image, grain(image)) if self.grained else (image,)):
            gain = F.pixel_shuffle(gain, self.stride // self.GAIN_PX)
            output = output + F.interpolate(gain, scale_factor=float(self.GAIN_PX), mode="nearest") * of
        if self.training or self.share == 0:
            return output
        return (1 - self.share) * output + self.share * inputs[:, :1]


class UNet(nn.Module):
    """pix2pix's generator (Isola et al. 2017) of 8 levels, norm before each non-linearity; `ngf` is its base width."""

    LEVELS = 8

    def __init__(self, channels, ngf, norm="instance"):
        super().__init__()
        self.padding_multiple = 1 << self.LEVELS
        widths = [min(ngf << level, 8 * ngf) for level in range(self.LEVELS)]
        last = self.LEVELS - 1
        # The first has no norm; at the deepest one a crop may be a single pixel, which has no variance.
        norms = ["none", *[norm] * (last - 1), "none"]
        self.down = nn.ModuleList(
            Conv(a, b, 4, 2, norm=n) for a, b, n in zip([channels, *widths], widths, norms)
        )
        self.up = nn.ModuleList()
        for level in reversed(range(self.LEVELS)):
            inputs = widths[level] * (1 if level == last else 2)
            outputs = widths[level - 1] if level else 1
            self.up.append(Conv(inputs, outputs, 4, 2, norm=norm if level else "none", transposed=True))

    def forward(self, x):
        skips = []
        for level, down in enumerate(self.down):
            x = down(x if level == 0 else F.leaky_relu(x, 0.2))
            skips.append(x)
        x = skips.pop()
        for level, up in enumerate(self.up):
            x = up(F.relu(x if level == 0 else torch.cat([x, skips.pop()], 1)))
        return x


def make(network, channels, norm="none"):
    """Network by name: stride8, stride4, the same with grain (grain8, grain4), unet64 (any ngf); weights from torch's own seed."""
    if network in ("stride8", "grain8"):
        return StemNet(channels, 8, (48, 96, 128), norm, network == "grain8")
    if network in ("stride4", "grain4"):
        return StemNet(channels, 4, (32, 64, 96, 128), norm, network == "grain4")
    if network.startswith("unet") and network[4:].isdigit():
        return UNet(channels, int(network[4:]), norm)
    raise ValueError(f"network {network}: it must be stride8, stride4, grain8, grain4 or unetN (N: channels of the first level)")
