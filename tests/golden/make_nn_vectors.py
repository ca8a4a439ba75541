"""Writes nn_vectors.safetensors: the modulated layer, the upsampler, a tiny decoder and Adam as PyTorch computes them.

Written from the formulas of the paper and of StyleGAN2 (convolutions, images as N, C, H, W), independently of the C++ code.
Needs torch, numpy and safetensors:  python tests/golden/make_nn_vectors.py
"""

import pathlib

import numpy
import torch
import torch.nn.functional as F
from safetensors.torch import save_file

generator = torch.Generator().manual_seed(20250607)
tensors = {}  # what is written; parameters under the names that the layers give them
CODES = {"id": 100, "expr": 79, "tex": 100, "light": 27}


def normal(*shape):
    """Float64 numbers that a float32 file holds exactly."""
    return torch.randn(*shape, generator=generator, dtype=torch.float32).double()


def parameter(name, *shape, scale=1.0, offset=0.0):
    value = (normal(*shape) * scale + offset).float().double()
    tensors[name] = value.float()
    return value.requires_grad_()


def put(name, value):
    tensors[name] = value.detach().clone().contiguous()


def channels_last(x):
    return x.permute(0, 2, 3, 1)


def leaky(x, gain):
    return F.leaky_relu(x, 0.2) * gain


class Equalised:
    def __init__(self, name, inputs, outputs, bias=0.0):
        self.weight = parameter(f"{name}.weight", outputs, inputs)
        self.bias = parameter(f"{name}.bias", outputs, scale=0.3, offset=bias)

    def __call__(self, x):  # (B, C) or (B, C, H, W)
        weight = self.weight / self.weight.shape[1] ** 0.5
        return F.linear(x, weight, self.bias) if x.dim() == 2 else F.conv2d(x, weight[:, :, None, None], self.bias)


class Modulated:
    """StyleGAN2's way: one convolution with a group for each sample."""

    def __init__(self, name, inputs, outputs, style_size, activation):
        self.weight = parameter(f"{name}.weight", outputs, inputs)
        self.bias = parameter(f"{name}.bias", outputs, scale=0.3)
        self.style = Equalised(f"{name}.style", style_size, inputs, bias=1.0)
        self.activation = activation

    def __call__(self, x, w):
        batch, inputs, height, width = x.shape
        outputs = self.weight.shape[0]
        weight = self.weight[None] / inputs**0.5 * self.style(w)[:, None, :]
        weight = weight * torch.rsqrt(weight.square().sum(2, keepdim=True) + 1e-8)
        y = F.conv2d(x.reshape(1, batch * inputs, height, width), weight.reshape(batch * outputs, inputs, 1, 1), groups=batch)
        y = y.reshape(batch, outputs, height, width)
        bias = self.bias[None, :, None, None]
        if self.activation == "sine":
            return torch.sin(2**0.5 * y + bias)
        return leaky(y + bias, 2**0.5)


def blur(x):
    kernel = torch.tensor([1.0, 2.0, 1.0], dtype=torch.float64)
    kernel = (kernel[:, None] * kernel[None, :] / 16.0).expand(x.shape[1], 1, 3, 3)
    return F.conv2d(F.pad(x, (1, 1, 1, 1), mode="reflect"), kernel, groups=x.shape[1])


class Upsampler:
    def __init__(self, name, channels):
        self.detail = Equalised(f"{name}.detail", channels, 4 * channels)

    def __call__(self, x):
        return blur(F.pixel_shuffle(leaky(self.detail(x), 1.0) + x.repeat_interleave(4, dim=1), 2))


def double(x):
    return F.interpolate(x, scale_factor=2, mode="bilinear", align_corners=False)


def modulated_vectors(name, activation):
    layer = Modulated(name, 5, 4, 3, activation)
    x = normal(2, 5, 2, 3).requires_grad_()
    w = normal(2, 3).requires_grad_()
    y = layer(x, w)
    dL_dy = normal(*y.shape)
    dL_dx, dL_dw, dL_dweight = torch.autograd.grad(y, [x, w, layer.weight], dL_dy)
    for key, value in {"x": x, "y": y, "dL_dy": dL_dy, "dL_dx": dL_dx}.items():
        put(f"{name}.{key}", channels_last(value))
    put(f"{name}.w", w)
    put(f"{name}.dL_dw", dL_dw)
    put(f"{name}.dL_dweight", dL_dweight)


def upsampler_vectors():
    layer = Upsampler("upsampler", 3)
    x = normal(2, 3, 4, 5).requires_grad_()
    y = layer(x)
    dL_dy = normal(*y.shape)
    (dL_dx,) = torch.autograd.grad(y, [x], dL_dy)
    for key, value in {"x": x, "y": y, "dL_dy": dL_dy, "dL_dx": dL_dx}.items():
        put(f"upsampler.{key}", channels_last(value))


class Decoder:
    """4 x 4 rays, images of 8 and 16."""

    side, width, feature_channels, frequencies, samples = 4, 8, 6, 2, 5
    block_channels = [5, 4]

    def __init__(self, name):
        self.mapping = {
            group: [Equalised(f"{name}.mapping.{group}.layer{i}", size, size) for i in range(2)] for group, size in CODES.items()
        }
        encoding = 3 + 6 * self.frequencies
        inputs = [encoding, self.width, self.width, self.width + encoding]
        self.layers = [Modulated(f"{name}.field.layer{i}", n, self.width, 179, "sine") for i, n in enumerate(inputs)]
        self.density = Equalised(f"{name}.field.density", self.width, 1)
        self.feature0 = Modulated(f"{name}.field.feature0", self.width, self.width, 179, "sine")
        self.feature1 = Equalised(f"{name}.field.feature1", self.width, self.feature_channels)
        self.blocks, self.laterals = [], []
        inputs = self.feature_channels
        for i, channels in enumerate(self.block_channels):
            resolution = self.side * 2 ** (i + 1)
            block = f"{name}.block{resolution}"
            self.blocks.append(
                (
                    Upsampler(f"{block}.upsampler", inputs),
                    Modulated(f"{block}.modulated0", inputs, channels, 127, "leaky"),
                    Modulated(f"{block}.modulated1", channels, channels, 127, "leaky"),
                    Equalised(f"{block}.to_rgb", channels, 3),
                )
            )
            self.laterals.append(Equalised(f"{name}.mask.lateral{resolution}", channels, 3))
            inputs = channels
        self.logit = Equalised(f"{name}.mask.logit", 3, 1)

    def rays(self, poses):
        """Points (B, 3, R, N) and interval lengths (B, 1, R, N) between the world planes z = 2.5 and z = -3.5."""
        all_points, all_deltas = [], []
        for yaw, pitch, roll, *center in poses.tolist():
            cos, sin = numpy.cos, numpy.sin
            rx = numpy.array([[1, 0, 0], [0, cos(pitch), -sin(pitch)], [0, sin(pitch), cos(pitch)]])
            ry = numpy.array([[cos(yaw), 0, sin(yaw)], [0, 1, 0], [-sin(yaw), 0, cos(yaw)]])
            rz = numpy.array([[cos(roll), -sin(roll), 0], [sin(roll), cos(roll), 0], [0, 0, 1]])
            world_from_camera = rz @ ry @ rx @ numpy.diag([1.0, -1.0, -1.0])
            inverse_k = numpy.linalg.inv(numpy.array([[2.03, 0, 0.5], [0, 2.03, 0.5], [0, 0, 1]]))
            v, u = numpy.meshgrid(*[(numpy.arange(self.side) + 0.5) / self.side] * 2, indexing="ij")
            directions = (world_from_camera @ inverse_k @ numpy.stack([u.ravel(), v.ravel(), numpy.ones(u.size)])).T
            directions /= numpy.linalg.norm(directions, axis=1, keepdims=True)
            lengths = numpy.linspace(center[2] - 2.5, center[2] + 3.5, self.samples + 1)[None] / -directions[:, 2:]
            points = numpy.array(center)[:, None, None] + directions.T[:, :, None] * lengths[None, :, :-1]
            all_points.append(torch.from_numpy(points))
            all_deltas.append(torch.from_numpy(numpy.diff(lengths, axis=1))[None])
        return torch.stack(all_points), torch.stack(all_deltas)

    def __call__(self, z, poses):
        w = {group: layers[1](leaky(layers[0](z[group]), 2**0.5)) for group, layers in self.mapping.items()}
        geometry = torch.cat([w["id"], w["expr"]], 1)
        appearance = torch.cat([w["tex"], w["light"]], 1)
        points, deltas = self.rays(poses)
        encoding = [points]
        for k in range(self.frequencies):
            encoding += [torch.sin(2.0**k * points), torch.cos(2.0**k * points)]
        encoding = torch.cat(encoding, 1)
        x = encoding
        for i, layer in enumerate(self.layers):
            x = layer(torch.cat([encoding, x], 1) if i == 3 else x, geometry)
        density = F.softplus(self.density(x) - 1.0)
        features = self.feature1(self.feature0(x, geometry))
        alpha = 1.0 - torch.exp(-density * deltas)
        transmittance = torch.cat([torch.ones_like(alpha[..., :1]), torch.cumprod(1.0 - alpha, 3)[..., :-1]], 3)
        x = (alpha * transmittance * features).sum(3).reshape(len(poses), self.feature_channels, self.side, self.side)
        result = {"feature_map": x}
        rgb = total = None
        for i, (upsampler, first, second, to_rgb) in enumerate(self.blocks):
            x = second(first(upsampler(x), appearance), appearance)
            rgb = to_rgb(x) if rgb is None else to_rgb(x) + blur(double(rgb))
            result[f"image{self.side * 2 ** (i + 1)}"] = torch.tanh(rgb)
            lateral = leaky(self.laterals[i](x), 1.0)
            total = lateral if total is None else lateral + double(total)
        result["mask_logit"] = self.logit(total)
        return result


def decoder_vectors():
    decoder = Decoder("decoder")
    poses = torch.tensor([[0.2, -0.1, 0.05, 0.9, 0.6, 5.1], [-0.3, 0.15, -0.1, -1.4, -0.7, 5.4]], dtype=torch.float64)
    z = {group: normal(2, size).requires_grad_() for group, size in CODES.items()}
    result = decoder(z, poses)
    loss = sum(value.square().mean() for value in result.values())
    gradients = torch.autograd.grad(loss, [*z.values(), decoder.layers[0].weight])
    put("case.poses", poses)
    for (group, value), gradient in zip(z.items(), gradients):
        put(f"case.z.{group}", value)
        put(f"case.dL_dz.{group}", gradient)
    put("case.dL_dweight", gradients[-1])
    for key, value in result.items():
        put(f"case.{key}", channels_last(value))


def adam_vectors(name, betas):
    value = normal(5).requires_grad_()
    put(f"{name}.start", value)
    optimizer = torch.optim.Adam([value], lr=0.01, betas=betas, eps=1e-8)
    gradients, values = [], []
    for _ in range(8):
        value.grad = normal(5) * torch.tensor([1.0, 1e-3, 1e-6, 10.0, 0.0], dtype=torch.float64)
        gradients.append(value.grad.clone())
        optimizer.step()
        values.append(value.detach().clone())
    put(f"{name}.gradients", torch.stack(gradients))
    put(f"{name}.values", torch.stack(values))


modulated_vectors("sine", "sine")
modulated_vectors("leaky", "leaky")
upsampler_vectors()
decoder_vectors()
adam_vectors("adam", (0.9, 0.999))
adam_vectors("adam_gan", (0.0, 0.99))
save_file(tensors, pathlib.Path(__file__).with_name("nn_vectors.safetensors"))
