"""Writes lpips_vectors.safetensors: LPIPS with VGG-16, AlexNet and SqueezeNet 1.1 as PyTorch
computes it, in float64.

Written from the papers, torchvision's layer tables and the definition of LPIPS v0.1, independently
of the C++ code. Weights, heads and images are numbers of a formula (`uniform`), so that no weights
have to be stored: tests/nn/pretrained/test_lpips.cpp computes the same ones. Needs torch, numpy and
safetensors:  python tests/golden/make_lpips_vectors.py
"""

import pathlib

import numpy
import torch
import torch.nn.functional as F
from safetensors.torch import save_file
from torch import nn


def uniform(stream, count):
    """`count` numbers in [0, 1): a 32-bit finaliser (MurmurHash3's) of the index; exact in
    float64."""
    x = numpy.arange(count, dtype=numpy.uint32) + numpy.uint32((stream << 24) & 0xFFFFFFFF)
    x ^= x >> numpy.uint32(16)
    x *= numpy.uint32(0x85EBCA6B)
    x ^= x >> numpy.uint32(13)
    x *= numpy.uint32(0xC2B2AE35)
    x ^= x >> numpy.uint32(16)
    return torch.from_numpy(x.astype(numpy.float64) / 2.0**32)


class Fire(nn.Module):
    def __init__(self, inputs, squeezed, expanded):
        super().__init__()
        self.squeeze = nn.Conv2d(inputs, squeezed, 1)
        self.expand1x1 = nn.Conv2d(squeezed, expanded, 1)
        self.expand3x3 = nn.Conv2d(squeezed, expanded, 3, padding=1)

    def forward(self, x):
        x = F.relu(self.squeeze(x))
        return torch.cat([F.relu(self.expand1x1(x)), F.relu(self.expand3x3(x))], 1)


def vgg16():
    layers, inputs = [], 3
    for width, count in ((64, 2), (128, 2), (256, 3), (512, 3), (512, 3)):
        for _ in range(count):
            layers += [nn.Conv2d(inputs, width, 3, padding=1), nn.ReLU()]
            inputs = width
        layers.append(nn.MaxPool2d(2, 2))
    return nn.Sequential(*layers[:-1]), (3, 8, 15, 22, 29)


def alexnet():
    return nn.Sequential(
        nn.Conv2d(3, 64, 11, stride=4, padding=2),
        nn.ReLU(),
        nn.MaxPool2d(3, 2),
        nn.Conv2d(64, 192, 5, padding=2),
        nn.ReLU(),
        nn.MaxPool2d(3, 2),
        nn.Conv2d(192, 384, 3, padding=1),
        nn.ReLU(),
        nn.Conv2d(384, 256, 3, padding=1),
        nn.ReLU(),
        nn.Conv2d(256, 256, 3, padding=1),
        nn.ReLU(),
    ), (1, 4, 7, 9, 11)


def squeezenet1_1():
    pool = {"kernel_size": 3, "stride": 2, "ceil_mode": True}
    return nn.Sequential(
        nn.Conv2d(3, 64, 3, stride=2),
        nn.ReLU(),
        nn.MaxPool2d(**pool),
        Fire(64, 16, 64),
        Fire(128, 16, 64),
        nn.MaxPool2d(**pool),
        Fire(128, 32, 128),
        Fire(256, 32, 128),
        nn.MaxPool2d(**pool),
        Fire(256, 48, 192),
        Fire(384, 48, 192),
        Fire(384, 64, 256),
        Fire(512, 64, 256),
    ), (1, 4, 7, 9, 10, 11, 12)


def features(network, taps, x):
    shift = torch.tensor([-0.030, -0.088, -0.188], dtype=x.dtype).reshape(1, 3, 1, 1)
    scale = torch.tensor([0.458, 0.448, 0.450], dtype=x.dtype).reshape(1, 3, 1, 1)
    x = (x - shift) / scale
    result = []
    for place, layer in enumerate(network):
        x = layer(x)
        if place in taps:
            result.append(x / (x.square().sum(1, keepdim=True).sqrt() + 1e-10))
    return result


def vectors(name, made, shape):
    network, taps = made
    network = network.double().requires_grad_(False)
    stream = 0
    for parameter in network.parameters():
        size = parameter.numel()
        # He's variance for weights; biases small, of either sign.
        bound = (6.0 / parameter[0].numel()) ** 0.5 if parameter.dim() > 1 else 0.1
        parameter.copy_((bound * (2.0 * uniform(stream, size) - 1.0)).reshape(parameter.shape))
        stream += 1
    batch, side = shape
    a, b = (
        (2.0 * uniform(254 + i, batch * side * side * 3) - 1.0).reshape(batch, side, side, 3)
        for i in range(2)
    )
    a.requires_grad_(True)
    terms = []
    for f, g in zip(
        features(network, taps, a.permute(0, 3, 1, 2)),
        features(network, taps, b.permute(0, 3, 1, 2)),
    ):
        head = uniform(stream, f.shape[1]).reshape(1, -1, 1, 1)
        stream += 1
        terms.append((head * (f - g).square()).sum(1).mean((1, 2)))
    terms = torch.stack(terms)
    distance = terms.sum(0)
    (gradient,) = torch.autograd.grad(distance.sum(), a)
    print(name, distance.detach().tolist(), gradient.abs().max().item())
    return {f"{name}.terms": terms.detach(), f"{name}.dL_da": gradient}


def main():
    tensors = {}
    tensors |= vectors("vgg16", vgg16(), (2, 24))
    tensors |= vectors("alexnet", alexnet(), (1, 35))
    tensors |= vectors("squeezenet1_1", squeezenet1_1(), (1, 33))
    path = pathlib.Path(__file__).with_name("lpips_vectors.safetensors")
    save_file(tensors, path)
    print(f"{path.name}: {path.stat().st_size} bytes")


if __name__ == "__main__":
    main()
