#!/usr/bin/env python3
"""Writes op_vectors.safetensors: PyTorch's values, first and second gradients for the rows of
tests/core/op_cases*.cpp.

    python3 -m venv venv && venv/bin/pip install torch numpy safetensors
    venv/bin/python tests/golden/make_op_vectors.py

Each case OP/FORM has float64 tensors: inputs "x0", "x1", ...; the value "y"; "dx0", ...: the
gradient for the cotangent cos(i + 1) at element i of y; "ddx0", ...: the gradient of the sum over
all inputs k of <dxk, sin(i + 1 + k)>. Images are NHWC and convolution weights (out, kernel height,
kernel width, in), as in the library.
"""

import math
import zlib
from pathlib import Path

import numpy as np
import torch
import torch.nn.functional as F
from safetensors.numpy import save_file

CASES = {}


def case(name, function, *inputs):
    assert name not in CASES, name
    CASES[name] = (function, inputs)


def uniform(*shape, low=-1.0, high=1.0, spacing=0.0, offset=0.0):
    """Uniform, or within a tenth of the spacing of the points offset + k spacing, away from kinks
    between them."""
    return shape, low, high, spacing, offset


def draw(rng, spec):
    shape, low, high, spacing, offset = spec
    values = rng.uniform(low, high, shape)
    if spacing > 0:
        values = np.round((values - offset) / spacing) * spacing + offset
        values = values + 0.1 * spacing * rng.uniform(-1, 1, shape)
    return torch.tensor(np.asarray(values), dtype=torch.float64)


def like(spec, *shape):
    return (shape, *spec[1:])


ANY = uniform()
POSITIVE = uniform(low=0.5, high=2.0)
AROUND_ZERO = uniform(low=-2.0, high=2.0, spacing=0.4, offset=0.2)
TICK = uniform(spacing=0.2)
TOCK = uniform(spacing=0.2, offset=0.1)
WIDE = uniform(low=-4.0, high=4.0)
WAVES = uniform(low=-6.0, high=6.0)


def elementwise():
    forms = {
        "same shape": ((2, 3), (2, 3)),
        "row and column": ((3, 1), (1, 4)),
        "channels of an image": ((1, 2, 2, 3), (3,)),
        "scalar left": ((), (2, 2)),
    }
    binary = {
        "add": (torch.add, ANY, ANY),
        "subtract": (torch.sub, ANY, ANY),
        "multiply": (torch.mul, ANY, ANY),
        "divide": (torch.div, ANY, POSITIVE),
        "maximum": (torch.maximum, TICK, TOCK),
        "minimum": (torch.minimum, TICK, TOCK),
    }
    for name, (function, a, b) in binary.items():
        for form, (shape_a, shape_b) in forms.items():
            case(f"{name}/{form}", function, like(a, *shape_a), like(b, *shape_b))
    condition = torch.arange(12).reshape(3, 4) % 3 != 0
    case(
        "where/same shape", lambda a, b: torch.where(condition, a, b), uniform(3, 4), uniform(3, 4)
    )
    case(
        "where/row and column",
        lambda a, b: torch.where(condition, a, b),
        uniform(3, 1),
        uniform(1, 4),
    )
    unary = {
        "negate": (torch.neg, ANY),
        "affine": (lambda x: -1.5 * x + 0.25, ANY),
        "exp": (torch.exp, ANY),
        "log": (torch.log, POSITIVE),
        "sin": (torch.sin, WAVES),
        "cos": (torch.cos, WAVES),
        "sqrt": (torch.sqrt, POSITIVE),
        "square": (torch.square, ANY),
        "abs": (torch.abs, AROUND_ZERO),
        "clamp": (lambda x: torch.clamp(x, -0.5, 0.7), TICK),
        "sigmoid": (torch.sigmoid, WIDE),
        "tanh": (torch.tanh, WIDE),
        "softplus": (lambda x: F.softplus(x, threshold=1000.0), WIDE),
        "leaky_relu": (lambda x: F.leaky_relu(x, 0.2), AROUND_ZERO),
        "relu": (F.relu, AROUND_ZERO),
    }
    for name, (function, spec) in unary.items():
        case(f"{name}/elements", function, like(spec, 3, 4))


def activations():
    case(
        "leaky_gate/elements",
        lambda x, sign: torch.where(sign > 0, x, 0.2 * x),
        uniform(3, 4),
        uniform(3, 4, spacing=0.5, offset=0.25),
    )
    case("prelu/rows", F.prelu, like(AROUND_ZERO, 3, 4), uniform(4))
    case(
        "prelu/image",
        lambda x, slope: nhwc(F.prelu(nchw(x), slope)),
        like(AROUND_ZERO, 2, 2, 2, 3),
        uniform(3),
    )
    # The functional form has no gradient of order 2 for its target.
    case(
        "binary_cross_entropy_with_logits/elements",
        lambda x, t: F.softplus(x, threshold=1000.0) - x * t,
        like(WIDE, 3, 4),
        uniform(3, 4, low=0.0, high=1.0),
    )


def shapes():
    case("reshape/given shape", lambda x: x.reshape(6, 2), uniform(2, 6))
    case("reshape/one extent left open", lambda x: x.reshape(2, -1, 2), uniform(2, 6))
    case("permute/rotate", lambda x: x.permute(2, 0, 1), uniform(2, 3, 4))
    case("permute/image to planes", lambda x: x.permute(0, 3, 1, 2), uniform(2, 2, 3, 4))
    case("permute/swap the first two", lambda x: x.permute(1, 0, 2), uniform(3, 2, 4))
    case("transpose/matrix", lambda x: x.transpose(-1, -2), uniform(3, 4))
    case("transpose/batch", lambda x: x.transpose(-1, -2), uniform(2, 3, 4))
    for axis in (0, 1, -1):
        case(f"flip/axis {axis}", lambda x, a=axis: x.flip(a), uniform(2, 3, 4))
        case(
            f"slice/axis {axis}", lambda x, a=axis: x.narrow(a, 1, x.shape[a] - 2), uniform(4, 3, 5)
        )
        widths = [0, 0] * ((-1 - axis) % 3) + [1, 2]
        case(f"pad/axis {axis}", lambda x, w=widths: F.pad(x, w), uniform(2, 3, 2))
    case("concat/two along axis 0", lambda *x: torch.cat(x, 0), uniform(2, 3), uniform(1, 3))
    case(
        "concat/three along the last axis",
        lambda *x: torch.cat(x, -1),
        uniform(2, 1),
        uniform(2, 3),
        uniform(2, 2),
    )
    case("concat/one", lambda *x: torch.cat(x, 0), uniform(2, 3))
    case("broadcast_to/column", lambda x: x.expand(2, 3, 4), uniform(3, 1))
    case("broadcast_to/scalar", lambda x: x.expand(2, 3), uniform())
    case("broadcast_to/middle axis", lambda x: x.expand(2, 4, 3), uniform(2, 1, 3))


def reductions():
    case("sum/all", torch.sum, uniform(2, 3, 4))
    case("mean/all", torch.mean, uniform(2, 3, 4))
    for form, axes in {
        "axis 0": (0,),
        "axis 1": (1,),
        "last axis": (-1,),
        "axes 0 and 2": (0, 2),
        "axes 1 and 2": (1, 2),
    }.items():
        case(f"sum/{form}", lambda x, a=axes: x.sum(a, keepdim=True), uniform(2, 3, 4))
        case(f"mean/{form}", lambda x, a=axes: x.mean(a, keepdim=True), uniform(2, 3, 4))
    case("sum_to/channels", lambda x: x.sum_to_size(4), uniform(2, 3, 4))
    case("sum_to/column", lambda x: x.sum_to_size(3, 1), uniform(2, 3, 4))
    case("sum_to/scalar", torch.sum, uniform(2, 3))
    for axis in (0, 1, -1):
        case(f"cumsum/inclusive axis {axis}", lambda x, a=axis: x.cumsum(a), uniform(2, 3, 4))
        case(f"cumsum/exclusive axis {axis}", lambda x, a=axis: x.cumsum(a) - x, uniform(2, 3, 4))


def some_rows(count, row_count):
    return torch.tensor([(i * i + 3) % row_count for i in range(count)])


def indexing():
    for form, tail in {"matrix": (3,), "rank 3": (2, 2)}.items():
        case(f"gather_rows/{form}", lambda x: x[some_rows(6, 4)], uniform(4, *tail))
        case(
            f"scatter_add_rows/{form}",
            lambda x: torch.zeros(5, *x.shape[1:], dtype=x.dtype).index_add(0, some_rows(6, 5), x),
            uniform(6, *tail),
        )


def products():
    def transposed(x, flag):
        return x.transpose(-1, -2) if flag else x

    def matrix(batch, rows, columns, flag):
        return uniform(
            *(() if batch == 0 else (batch,)), *((columns, rows) if flag else (rows, columns))
        )

    for form, (batch_a, batch_b) in {
        "matrices": (0, 0),
        "batch": (2, 2),
        "one left": (1, 2),
        "one right": (2, 1),
    }.items():
        for ta in (False, True):
            for tb in (False, True):
                suffix = (" transposed a" if ta else "") + (" transposed b" if tb else "")
                case(
                    f"matmul/{form}{suffix}",
                    lambda a, b, s=ta, t=tb: torch.matmul(transposed(a, s), transposed(b, t)),
                    matrix(batch_a, 2, 3, ta),
                    matrix(batch_b, 3, 4, tb),
                )
    activation = {
        "plain": lambda x: x,
        "sine": torch.sin,
        "leaky relu": lambda x: math.sqrt(2.0) * F.leaky_relu(x, 0.2),
    }
    for op in ("linear", "linear_reference"):
        for name, f in activation.items():

            def layer(x, weight, bias=0.0, f=f):
                return f(torch.matmul(x, weight.transpose(-1, -2)) + bias)

            x, bias = uniform(2, 3, 3, low=-0.5, high=0.5), uniform(4, spacing=2.0, offset=1.0)
            case(f"{op}/{name}", layer, x, uniform(1, 4, 3, low=-0.4, high=0.4), bias)
            case(
                f"{op}/{name}, weight of each sample",
                layer,
                x,
                uniform(2, 4, 3, low=-0.4, high=0.4),
                bias,
            )
            case(
                f"{op}/{name}, no bias", layer, uniform(2, 3, 3, low=0.2), uniform(1, 4, 3, low=0.2)
            )


def rays():
    faces, width, count, samples = 2, 3, 2, 3

    def constant(low, high, *shape):
        i = torch.arange(math.prod(shape), dtype=torch.float64).reshape(shape)
        return low + (high - low) * (0.5 + 0.5 * torch.sin(1.7 * i + 0.3))

    points, deltas = constant(-1.0, 1.0, faces, count * samples, 3), constant(
        0.1, 0.5, faces, count, samples
    )
    number = torch.arange(deltas.numel()).reshape(deltas.shape)
    some = torch.where((number < samples) | (number % 4 == 1), 0.0, 1.0).to(torch.float64)

    def field(kept, *parts):
        def layer(i, x):
            weight, scale, demodulation, bias = parts[4 * i : 4 * i + 4]
            return torch.sin(x @ (demodulation * weight * scale).transpose(1, 2) + bias)

        encoding = torch.cat([points, points.sin(), points.cos()], -1)
        x = layer(1, torch.cat([encoding, layer(0, encoding)], -1))
        density = (
            F.softplus((x @ parts[12].T)[..., 0] + parts[13] - 1, threshold=1000.0).reshape(
                deltas.shape
            )
            * kept
        )
        depth = torch.cumsum(F.pad(density * deltas, (1, 0)), 2)
        transmittance = torch.exp(-depth)
        weights = transmittance[..., :-1] - transmittance[..., 1:]
        features = layer(2, x).reshape(faces, count, samples, width)
        return torch.cat(
            [weights, transmittance[..., -1:], (weights[..., None] * features).sum(2)], 2
        )

    shapes = [
        shape
        for inner in (9, 9 + width, width)
        for shape in ((1, width, inner), (faces, 1, inner), (faces, width, 1), (width,))
    ] + [(1, width), (1,)]
    inputs = [
        (
            uniform(*shape, low=0.5, high=1.5)
            if len(shape) == 3 and shape[0] == faces
            else uniform(*shape)
        )
        for shape in shapes
    ]
    for form, kept in {"every sample": torch.ones_like(deltas), "samples left out": some}.items():
        case(f"render_field/{form}", lambda *x, kept=kept: field(kept, *x), *inputs)


def features():
    def wave_in(low, high, *shape):
        i = torch.arange(math.prod(shape), dtype=torch.float64).reshape(shape)
        return low + (high - low) * (0.5 + 0.5 * torch.sin(1.7 * i + 0.3))

    def normalised(x):
        return x / (x.square().sum(-1, keepdim=True).sqrt() + 1e-10)

    def distance(x):
        return (
            (
                (normalised(x) - wave_in(-0.5, 0.5, *x.shape)).square()
                * wave_in(0.1, 1.0, x.shape[3])
            )
            .mean((1, 2))
            .sum(1)
        )

    for op in ("feature_distance", "feature_distance_reference"):
        case(f"{op}/images", distance, uniform(2, 2, 3, 4))

    def blur_upsampled(x, detail):
        b, h, w, c = x.shape
        fine = detail.reshape(b, h, w, 2, 2, c) + x[:, :, :, None, None, :]
        fine = nchw(fine.permute(0, 1, 3, 2, 4, 5).reshape(b, 2 * h, 2 * w, c))
        taps = torch.tensor([0.25, 0.5, 0.25], dtype=x.dtype)
        kernel = torch.outer(taps, taps).expand(c, 1, 3, 3)
        return nhwc(F.conv2d(F.pad(fine, (1, 1, 1, 1), mode="reflect"), kernel, groups=c))

    for op in ("blur_upsampled", "blur_upsampled_reference"):
        case(f"{op}/images", blur_upsampled, uniform(2, 2, 3, 2), uniform(2, 2, 3, 8))
    case(
        "blur_upsampled/vectors and a rest",
        blur_upsampled,
        uniform(1, 3, 1, 19),
        uniform(1, 3, 1, 76),
    )


def nchw(x):
    return x.permute(0, 3, 1, 2)


def nhwc(x):
    return x.permute(0, 2, 3, 1)


def convolutions():
    forms = {
        "3x3, padding 1": ((2, 4, 3, 2), (3, 3, 3, 2), (1, 1, 1)),
        "3x3, stride 2 with a rest": ((1, 6, 5, 2), (2, 3, 3, 2), (2, 1, 1)),
        "2x3, no padding": ((1, 4, 4, 2), (2, 2, 3, 2), (1, 0, 1)),
        "1x1": ((2, 2, 3, 3), (4, 1, 1, 3), (1, 0, 1)),
        "1x1, stride 2": ((1, 4, 3, 2), (2, 1, 1, 2), (2, 0, 1)),
        "3x3, 2 groups": ((1, 4, 3, 4), (4, 3, 3, 2), (1, 1, 2)),
        "3x3, depthwise, stride 2": ((1, 5, 4, 3), (3, 3, 3, 1), (2, 1, 3)),
        "4x4, padding 2": ((1, 3, 3, 2), (1, 4, 4, 2), (1, 2, 1)),
    }
    for form, (x_shape, w_shape, (stride, padding, groups)) in forms.items():

        def conv(x, w, s=stride, p=padding, g=groups):
            return nhwc(F.conv2d(nchw(x), nchw(w), stride=s, padding=p, groups=g))

        def transpose(dy, w, conv=conv, shape=x_shape):
            x = torch.zeros(shape, dtype=dy.dtype, requires_grad=True)
            return torch.autograd.grad(conv(x, w), x, dy, create_graph=True)[0]

        def weight_grad(dy, x, conv=conv, shape=w_shape):
            w = torch.zeros(shape, dtype=dy.dtype, requires_grad=True)
            return torch.autograd.grad(conv(x, w), w, dy, create_graph=True)[0]

        y_shape = conv(torch.zeros(x_shape), torch.zeros(w_shape)).shape
        case(f"conv2d/{form}", conv, uniform(*x_shape), uniform(*w_shape))
        case(f"conv2d_transpose/{form}", transpose, uniform(*y_shape), uniform(*w_shape))
        case(f"conv2d_weight_grad/{form}", weight_grad, uniform(*y_shape), uniform(*x_shape))
    for form, (slope, stride) in {
        "bias": (1.0, 1),
        "bias and leaky relu": (0.2, 1),
        "bias and relu, stride 2": (0.0, 2),
    }.items():
        case(
            f"conv2d/{form}",
            lambda x, w, b, slope=slope, s=stride: F.leaky_relu(
                nhwc(F.conv2d(nchw(x), nchw(w), b, stride=s, padding=1)), slope
            ),
            uniform(2, 4, 3, 2, low=-0.2, high=0.2),
            uniform(3, 3, 3, 2, low=-0.2, high=0.2),
            uniform(3, spacing=2.0, offset=1.0),
        )


def channels():
    def unit(x):
        squared = x.square().sum(-1, keepdim=True)
        return x / (torch.where(squared == 0, torch.ones_like(squared), squared).sqrt() + 0.01)

    for op in ("unit_channels", "unit_channels_reference"):
        case(f"{op}/image", unit, uniform(2, 3, 2, 5))
    case(
        "mean_squared_difference/image",
        lambda a, b: (a - b).square().mean((1, 2), keepdim=True),
        uniform(2, 3, 2, 5),
        uniform(2, 3, 2, 5),
    )


def pooling():
    forms = {
        "2x2": ((2, 4, 6, 2), (2, 2, False)),
        "3x3, stride 2 with a rest": ((1, 6, 7, 2), (3, 2, False)),
        "3x3, stride 2, ceil": ((1, 6, 7, 2), (3, 2, True)),
        "2x2, stride 3, ceil": ((1, 4, 6, 1), (2, 3, True)),
    }
    for form, (shape, (kernel, stride, ceil)) in forms.items():
        case(
            f"max_pool2d/{form}",
            lambda x, k=kernel, s=stride, c=ceil: nhwc(F.max_pool2d(nchw(x), k, s, ceil_mode=c)),
            uniform(*shape, low=-500.0, high=500.0),
        )
    case(
        "max_pool2d/3x3, stride 1, squared",
        lambda x: nhwc(F.max_pool2d(nchw(x), 3, 1)).square(),
        uniform(1, 4, 4, 2, low=-500.0, high=500.0),
    )


def arbitrary_matrix(length):
    matrix = torch.zeros(length + 1, length, dtype=torch.float64)
    for output in range(length + 1):
        if output != 1:
            matrix[output, (3 * output + 1) % length] += 0.5 + 0.25 * (output % 3)
            matrix[output, output % length] -= 0.75
    return matrix


def upfirdn(x, taps, up, down, before, after):
    batch, height, width, channels = x.shape
    spread = torch.zeros(up, up, dtype=x.dtype)
    spread[0, 0] = 1.0
    x = nchw(x)
    x = (x[:, :, :, None, :, None] * spread[:, None, :]).reshape(
        batch, channels, height * up, width * up
    )
    taps = torch.tensor(taps, dtype=x.dtype).flip(0)
    kernel = torch.outer(taps, taps).expand(channels, 1, len(taps), len(taps))
    return nhwc(
        F.conv2d(F.pad(x, [before, after, before, after]), kernel, stride=down, groups=channels)
    )


def blur(x):
    channels = x.shape[3]
    taps = torch.tensor([0.25, 0.5, 0.25], dtype=x.dtype)
    kernel = torch.outer(taps, taps).expand(channels, 1, 3, 3)
    return nhwc(F.conv2d(F.pad(nchw(x), [1, 1, 1, 1], mode="reflect"), kernel, groups=channels))


def resampling():
    case(
        "resample/arbitrary matrices",
        lambda x: torch.einsum("ih,jw,bhwc->bijc", arbitrary_matrix(3), arbitrary_matrix(4), x),
        uniform(2, 3, 4, 2),
    )
    filters = {
        "up 2": ((0.25, 0.75, 0.75, 0.25), 2, 1, 2, 1, (1, 3, 2, 2)),
        "down 2": ((0.125, 0.375, 0.375, 0.125), 1, 2, 1, 1, (1, 4, 5, 2)),
        "asymmetric filter": ((0.1, 0.2, 0.7), 1, 1, 2, 0, (1, 3, 4, 1)),
        "up 2, down 3": ((0.3, 0.5, 0.1, 0.1), 2, 3, 3, 2, (1, 4, 3, 2)),
    }
    for form, (*arguments, shape) in filters.items():
        case(f"upfirdn2d/{form}", lambda x, a=tuple(arguments): upfirdn(x, *a), uniform(*shape))
    case("blur/image", blur, uniform(1, 4, 3, 2))

    def resized(mode, antialias, numerator, denominator):
        return lambda x: nhwc(
            F.interpolate(
                nchw(x),
                mode=mode,
                align_corners=False,
                antialias=antialias,
                size=[x.shape[1] * numerator // denominator, x.shape[2] * numerator // denominator],
            )
        )

    case("resize_bilinear/twice the size", resized("bilinear", False, 2, 1), uniform(1, 3, 2, 2))
    case("resize_bilinear/two thirds", resized("bilinear", False, 2, 3), uniform(1, 6, 3, 1))
    case("resize_bilinear/five thirds", resized("bilinear", False, 5, 3), uniform(1, 3, 3, 1))
    case("resize_bicubic/half", resized("bicubic", True, 1, 2), uniform(1, 8, 6, 1))
    case("resize_bicubic/two thirds", resized("bicubic", True, 2, 3), uniform(1, 6, 3, 2))
    case("resize_bicubic/five thirds", resized("bicubic", True, 5, 3), uniform(1, 3, 3, 1))
    case("resize_box/half", lambda x: nhwc(F.avg_pool2d(nchw(x), 2)), uniform(1, 4, 2, 2))
    case("resize_box/third", lambda x: nhwc(F.avg_pool2d(nchw(x), 3)), uniform(1, 6, 3, 1))
    case("pixel_shuffle/image", lambda x: nhwc(F.pixel_shuffle(nchw(x), 2)), uniform(2, 2, 1, 8))
    case(
        "pixel_shuffle_onto/image",
        lambda x, y: nhwc(F.pixel_shuffle(nchw(y), 2) + F.interpolate(nchw(x), scale_factor=2)),
        uniform(2, 2, 1, 2),
        uniform(2, 2, 1, 8),
    )
    case(
        "pixel_unshuffle/image", lambda x: nhwc(F.pixel_unshuffle(nchw(x), 2)), uniform(2, 2, 4, 2)
    )


def wave(function, x, shift):
    return function(torch.arange(x.numel(), dtype=torch.float64) + shift).reshape(x.shape)


def gradients(y, xs, dL_dy):
    """As torch.autograd.grad, with zeros where y does not depend on an x."""
    if not y.requires_grad:
        return [torch.zeros_like(x) for x in xs]
    return torch.autograd.grad(y, xs, dL_dy, create_graph=True, materialize_grads=True)


def main():
    for family in (
        elementwise,
        activations,
        shapes,
        reductions,
        indexing,
        products,
        convolutions,
        channels,
        pooling,
        resampling,
        rays,
        features,
    ):
        family()
    tensors = {}
    for name, (function, specs) in CASES.items():
        rng = np.random.default_rng(zlib.crc32(name.encode()))
        xs = [draw(rng, spec).requires_grad_() for spec in specs]
        y = function(*xs)
        first = gradients(y, xs, wave(torch.cos, y, 1))
        contracted = sum((g * wave(torch.sin, g, 1 + k)).sum() for k, g in enumerate(first))
        second = gradients(contracted, xs, torch.ones_like(contracted))
        tensors[f"{name}/y"] = y
        for k in range(len(xs)):
            tensors |= {
                f"{name}/x{k}": xs[k],
                f"{name}/dx{k}": first[k],
                f"{name}/ddx{k}": second[k],
            }
    path = Path(__file__).with_name("op_vectors.safetensors")
    save_file(
        {
            key: np.array(value.detach().numpy(force=True), order="C")
            for key, value in tensors.items()
        },
        path,
    )
    print(f"{path.name}: {len(CASES)} cases, {path.stat().st_size} bytes")


if __name__ == "__main__":
    main()
