"""The decoder, the encoder and the losses in plain PyTorch, for numbers to compare the C++ code
with.

Written from the formulas of the paper, of StyleGAN2 and of NeRF, not from the C++ code: modulation
as one convolution with a group for each sample, compositing as a running product, the last layer of
the field applied to every sample. Images are (N, C, H, W). Parameters have the names and shapes of
docs/models.md.
"""

import dataclasses

import numpy
import torch
import torch.nn.functional as F

CODES = {"id": 100, "expr": 79, "tex": 100, "light": 27}
ROOT2 = 2**0.5


class Philox:
    """Philox4x32-10 (Salmon et al. 2011) with keys derived from names: the random numbers of
    core/rng.h."""

    def __init__(self, key):
        self.key, self.counter = key, 0

    @staticmethod
    def block(words, key):
        mask = numpy.uint64(0xFFFFFFFF)
        words = [numpy.asarray(word, dtype=numpy.uint64) for word in words]
        keys = [key & 0xFFFFFFFF, key >> 32]
        for _ in range(10):
            first = numpy.uint64(0xD2511F53) * words[0]
            second = numpy.uint64(0xCD9E8D57) * words[2]
            words = [
                (second >> numpy.uint64(32)) ^ words[1] ^ numpy.uint64(keys[0]),
                second & mask,
                (first >> numpy.uint64(32)) ^ words[3] ^ numpy.uint64(keys[1]),
                first & mask,
            ]
            keys = [(keys[0] + 0x9E3779B9) & 0xFFFFFFFF, (keys[1] + 0xBB67AE85) & 0xFFFFFFFF]
        return words[0] | (words[1] << numpy.uint64(32))

    def split(self, name):
        key, data = self.key, name.encode()
        for begin in range(0, max(len(data), 1), 8):
            piece = int.from_bytes(data[begin : begin + 8], "big")
            key = int(self.block([piece & 0xFFFFFFFF, piece >> 32, len(data), 1], key))
        return Philox(key)

    def uniform(self, *shape):
        """Float64 in [0, 1)."""
        count = int(numpy.prod(shape))
        index = numpy.arange(self.counter, self.counter + count, dtype=numpy.uint64)
        self.counter += count
        bits = self.block(
            [index & numpy.uint64(0xFFFFFFFF), index >> numpy.uint64(32), 0, 0], self.key
        )
        return torch.from_numpy(
            (bits >> numpy.uint64(11)).astype(numpy.float64) * 2.0**-53
        ).reshape(shape)


class Numbers:
    """Weights and inputs that both sides make: functions of a seed and a name
    (tests/support/golden.h)."""

    def __init__(self, seed, dtype=torch.float64):
        self.random, self.dtype = Philox(seed), dtype

    def __call__(self, name, *shape):
        """Uniform in +-1.75, of deviation 1; float32 holds them exactly."""
        return ((self.random.split(name).uniform(*shape) - 0.5) * 3.5).float().to(self.dtype)


class Parameters:
    """Makes the parameters that layers ask for, and keeps them in order."""

    def __init__(self, numbers):
        self.numbers, self.tensors = numbers, {}

    def __call__(self, name, *shape, scale=1.0, offset=0.0):
        values = (
            (self.numbers(name, *shape).double() * scale + offset).float().to(self.numbers.dtype)
        )
        self.tensors[name] = values.requires_grad_()
        return self.tensors[name]


def leaky(x, gain):
    return F.leaky_relu(x, 0.2) * gain


class Equalised:
    """Fully connected layer or 1x1 convolution with equalised learning rate."""

    def __init__(self, create, name, inputs, outputs, bias=0.0, multiplier=1.0):
        self.weight = create(f"{name}.weight", outputs, inputs)
        self.bias = create(f"{name}.bias", outputs, scale=0.25, offset=bias)
        self.multiplier = multiplier

    def __call__(self, x):  # (B, C) or (B, C, H, W)
        weight = self.weight * (self.multiplier / self.weight.shape[1] ** 0.5)
        bias = self.bias * self.multiplier
        return (
            F.linear(x, weight, bias)
            if x.dim() == 2
            else F.conv2d(x, weight[:, :, None, None], bias)
        )


class Modulated:
    """StyleGAN2's way: one convolution with a group for each sample."""

    def __init__(self, create, name, inputs, outputs, style_size, activation):
        self.weight = create(f"{name}.weight", outputs, inputs)
        self.bias = create(f"{name}.bias", outputs, scale=0.25)
        self.style = Equalised(create, f"{name}.style", style_size, inputs, bias=1.0)
        self.activation = activation

    def __call__(self, x, w):
        batch, inputs, height, width = x.shape
        outputs = self.weight.shape[0]
        weight = self.weight[None] / inputs**0.5 * self.style(w)[:, None, :]
        weight = weight * torch.rsqrt(weight.square().sum(2, keepdim=True) + 1e-8)
        y = F.conv2d(
            x.reshape(1, batch * inputs, height, width),
            weight.reshape(batch * outputs, inputs, 1, 1),
            groups=batch,
        )
        y = y.reshape(batch, outputs, height, width)
        bias = self.bias[None, :, None, None]
        if self.activation == "sine":
            return torch.sin(ROOT2 * y + bias)
        return leaky(y + bias, ROOT2)


def blur(x):
    kernel = torch.tensor([1.0, 2.0, 1.0], dtype=x.dtype)
    kernel = (kernel[:, None] * kernel[None, :] / 16.0).expand(x.shape[1], 1, 3, 3)
    return F.conv2d(F.pad(x, (1, 1, 1, 1), mode="reflect"), kernel, groups=x.shape[1])


class Upsampler:
    def __init__(self, create, name, channels):
        self.detail = Equalised(create, f"{name}.detail", channels, 4 * channels)

    def __call__(self, x):
        return blur(F.pixel_shuffle(leaky(self.detail(x), 1.0) + x.repeat_interleave(4, dim=1), 2))


def doubled(x):
    return F.interpolate(x, scale_factor=2, mode="bilinear", align_corners=False)


def rotation(yaw, pitch, roll):
    """Rz(roll) Ry(yaw) Rx(pitch)."""
    c, s = numpy.cos, numpy.sin
    rx = numpy.array([[1, 0, 0], [0, c(pitch), -s(pitch)], [0, s(pitch), c(pitch)]])
    ry = numpy.array([[c(yaw), 0, s(yaw)], [0, 1, 0], [-s(yaw), 0, c(yaw)]])
    rz = numpy.array([[c(roll), -s(roll), 0], [s(roll), c(roll), 0], [0, 0, 1]])
    return rz @ ry @ rx


def sample_rays(poses, side, samples, uniforms=None, focal=2.03, near=2.5, far=-3.5):
    """Rays through the middles of the pixels, sampled between the world planes z = near and z =
    far.

    `poses` (B, 6): yaw, pitch, roll, centre; `uniforms` (B, R, N + 1) moves each depth within its
    stratum. Returns points (B, 3, R, N), and deltas and depths (B, 1, R, N).
    """
    points, deltas, depths = [], [], []
    inverse_k = numpy.linalg.inv(numpy.array([[focal, 0, 0.5], [0, focal, 0.5], [0, 0, 1]]))
    v, u = numpy.meshgrid(*[(numpy.arange(side) + 0.5) / side] * 2, indexing="ij")
    pixels = numpy.stack([u.ravel(), v.ravel(), numpy.ones(u.size)])
    for i, (yaw, pitch, roll, *center) in enumerate(poses.tolist()):
        world_from_camera = rotation(yaw, pitch, roll) @ numpy.diag([1.0, -1.0, -1.0])
        directions = (world_from_camera @ inverse_k @ pixels).T
        directions /= numpy.linalg.norm(directions, axis=1, keepdims=True)
        z = numpy.linspace(center[2] - near, center[2] - far, samples + 1)[None].repeat(
            side * side, 0
        )
        if uniforms is not None:
            middles = (z[:, 1:] + z[:, :-1]) / 2
            lower = numpy.concatenate([z[:, :1], middles], 1)
            upper = numpy.concatenate([middles, z[:, -1:]], 1)
            z = lower + (upper - lower) * uniforms[i].numpy()
        lengths = z / -directions[:, 2:]
        points.append(
            numpy.array(center)[:, None, None] + directions.T[:, :, None] * lengths[None, :, :-1]
        )
        deltas.append(numpy.diff(lengths, axis=1)[None])
        depths.append(lengths[None, :, :-1])
    return tuple(torch.from_numpy(numpy.stack(each)) for each in (points, deltas, depths))


@dataclasses.dataclass
class DecoderSize:
    resolution: int
    field_width: int
    field_layers: int
    feature_channels: int
    frequencies: int
    block_channels: tuple
    mask_channels: int
    mapping_layers: int
    rays_per_side: int = 32
    mapping_multiplier: float = 1.0


class Mapping:
    def __init__(self, create, name, size, layers, multiplier):
        self.layers = [
            Equalised(create, f"{name}.layer{i}", size, size, multiplier=multiplier)
            for i in range(layers)
        ]

    def __call__(self, z):
        for layer in self.layers[:-1]:
            z = leaky(layer(z), ROOT2)
        return self.layers[-1](z)


class Field:
    """Sine layers; the encoding enters again at layer layers / 2 + 1."""

    def __init__(self, create, name, size):
        encoding, width = 3 + 6 * size.frequencies, size.field_width
        self.frequencies = size.frequencies
        self.skip = size.field_layers // 2 + 1 if size.field_layers >= 4 else None
        self.layers = []
        for i in range(size.field_layers):
            inputs = encoding if i == 0 else width + encoding if i == self.skip else width
            self.layers.append(Modulated(create, f"{name}.layer{i}", inputs, width, 179, "sine"))
        self.density = Equalised(create, f"{name}.density", width, 1)
        self.feature0 = Modulated(create, f"{name}.feature0", width, width, 179, "sine")
        self.feature1 = Equalised(create, f"{name}.feature1", width, size.feature_channels)

    def __call__(self, points, w):
        encoding = [points]
        for k in range(self.frequencies):
            encoding += [torch.sin(2.0**k * points), torch.cos(2.0**k * points)]
        encoding = torch.cat(encoding, 1)
        x = encoding
        for i, layer in enumerate(self.layers):
            x = layer(torch.cat([encoding, x], 1) if i == self.skip else x, w)
        return F.softplus(self.density(x) - 1.0), self.feature1(self.feature0(x, w))


class Decoder:
    def __init__(self, create, name, size):
        self.size = size
        self.mapping = {
            group: Mapping(
                create,
                f"{name}.mapping.{group}",
                length,
                size.mapping_layers,
                size.mapping_multiplier,
            )
            for group, length in CODES.items()
        }
        self.field = Field(create, f"{name}.field", size)
        self.blocks, self.laterals = [], []
        inputs, side = size.feature_channels, 2 * size.rays_per_side
        for channels in size.block_channels:
            if side > size.resolution:
                break
            block = f"{name}.block{side}"
            self.blocks.append(
                (
                    Upsampler(create, f"{block}.upsampler", inputs),
                    Modulated(create, f"{block}.modulated0", inputs, channels, 127, "leaky"),
                    Modulated(create, f"{block}.modulated1", channels, channels, 127, "leaky"),
                    Equalised(create, f"{block}.to_rgb", channels, 3),
                )
            )
            self.laterals.append(
                Equalised(create, f"{name}.mask.lateral{side}", channels, size.mask_channels)
            )
            inputs, side = channels, 2 * side
        self.logit = Equalised(create, f"{name}.mask.logit", size.mask_channels, 1)

    def __call__(self, z, rays):
        """Everything that the losses see: images, mask_logit, feature_map, weights, transmittance
        and depths."""
        w = {group: mapping(z[group]) for group, mapping in self.mapping.items()}
        appearance = torch.cat([w["tex"], w["light"]], 1)
        side = self.size.rays_per_side
        points, deltas, depths = rays
        density, features = self.field(points, torch.cat([w["id"], w["expr"]], 1))
        alpha = 1.0 - torch.exp(-density * deltas)
        passed = torch.cumprod(1.0 - alpha, 3)
        weights = alpha * torch.cat([torch.ones_like(alpha[..., :1]), passed[..., :-1]], 3)
        x = (weights * features).sum(3).reshape(len(points), -1, side, side)
        result = {
            "feature_map": x,
            "weights": weights[:, 0],
            "transmittance": passed[:, 0, :, -1:],
            "depths": depths[:, 0],
        }
        result["images"] = []
        rgb = total = None
        for (upsampler, first, second, to_rgb), lateral in zip(self.blocks, self.laterals):
            x = second(first(upsampler(x), appearance), appearance)
            rgb = to_rgb(x) if rgb is None else to_rgb(x) + blur(doubled(rgb))
            result["images"].append(torch.tanh(rgb))
            total = leaky(lateral(x), 1.0) + (0.0 if total is None else doubled(total))
        result["mask_logit"] = self.logit(total)
        return result


class SmallConv:
    """Five 3x3 convolutions of stride 2 from 64 pixels to 2, then one layer to the embedding."""

    def __init__(self, create, name):
        self.convolutions, inputs = [], 3
        for i, outputs in enumerate([32, 64, 128, 256, 256]):
            weight = create(f"{name}.conv{i}.weight", outputs, 3, 3, inputs)
            self.convolutions.append((weight, create(f"{name}.conv{i}.bias", outputs, scale=0.25)))
            inputs = outputs
        self.embed = Equalised(create, f"{name}.embed", 1024, 256)

    def __call__(self, x):
        for weight, bias in self.convolutions:
            weight = weight.permute(0, 3, 1, 2) / weight[0].numel() ** 0.5
            x = leaky(F.conv2d(x, weight, bias, stride=2, padding=1), ROOT2)
        return self.embed(x.permute(0, 2, 3, 1).flatten(1))


class Encoder:
    def __init__(self, create, name, backbone, embedding, head_width):
        self.backbone = backbone
        self.heads = {}
        for group, length in CODES.items():
            head = f"{name}.heads.{group}"
            self.heads[group] = (
                Equalised(create, f"{head}.wide", embedding, head_width),
                Equalised(create, f"{head}.narrow", head_width, head_width // 2),
                Equalised(create, f"{head}.code", head_width // 2, length),
            )

    def __call__(self, image):
        embedding = self.backbone(image)
        return {
            group: code(leaky(narrow(leaky(wide(embedding), ROOT2)), ROOT2))
            for group, (wide, narrow, code) in self.heads.items()
        }


def photometric_loss(images, targets, weights):
    return sum(
        weight * F.l1_loss(image, target) for image, target, weight in zip(images, targets, weights)
    )


def code_loss(z, codes, present, weights):
    """Squared distances; a mean over the batch to which a face without a code adds 0."""
    return sum(
        weight * (present[:, None] * (z[g] - codes[g]).square()).sum() / len(present)
        for g, weight in weights.items()
    )


def opacity_loss(transmittance, mask):
    """Cross-entropy of the opacity of each ray, both logarithms lifted by 1e-3."""
    mask = mask.reshape(transmittance.shape)
    return -(
        mask * torch.log(1.0 - transmittance + 1e-3)
        + (1.0 - mask) * torch.log(transmittance + 1e-3)
    ).mean()


def depth_variance(weights, depths):
    probability = weights / weights.sum(2, keepdim=True).clamp(min=1e-3)
    mean = (probability * depths).sum(2, keepdim=True)
    return (probability * (depths - mean).square()).sum(2).mean()


def code_norm(z):
    return torch.cat(list(z.values()), 1).square().mean()
