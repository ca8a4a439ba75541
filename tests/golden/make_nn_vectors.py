"""Writes nn_vectors.safetensors: the modulated layer, the upsampler and Adam as PyTorch computes
them.

The layers are those of torch_model.py, whose whole networks make_agreement_vectors.py compares.
Needs torch, numpy and safetensors:  python tests/golden/make_nn_vectors.py
"""

import pathlib

import torch
from safetensors.torch import save_file

from torch_model import Modulated, Upsampler

generator = torch.Generator().manual_seed(20250607)
tensors = {}  # what is written; parameters under the names that the layers give them


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


def modulated_vectors(name, activation):
    layer = Modulated(parameter, name, 5, 4, 3, activation)
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
    layer = Upsampler(parameter, "upsampler", 3)
    x = normal(2, 3, 4, 5).requires_grad_()
    y = layer(x)
    dL_dy = normal(*y.shape)
    (dL_dx,) = torch.autograd.grad(y, [x], dL_dy)
    for key, value in {"x": x, "y": y, "dL_dy": dL_dy, "dL_dx": dL_dx}.items():
        put(f"upsampler.{key}", channels_last(value))


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
adam_vectors("adam", (0.9, 0.999))
adam_vectors("adam_gan", (0.0, 0.99))
save_file(tensors, pathlib.Path(__file__).with_name("nn_vectors.safetensors"))
