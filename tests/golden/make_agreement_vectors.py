"""Writes what PyTorch makes of whole networks and whole training steps, in float64, for the C++
tests named "agreement".

Without arguments: small networks, agreement_vectors.safetensors beside this script; every tensor is
folded to 16 numbers. With --out DIR: networks of the paper's width, cut at 64 pixels, into
DIR/agreement_float{64,32}.safetensors, unfolded; for runs in float32 the samples along the rays are
rounded to it. Needs torch, numpy and safetensors. All weights and inputs are functions of a seed
and their names (torch_model.Numbers), so that they need not be stored: the C++ side makes the same
ones.
"""

import argparse
import dataclasses
import functools
import pathlib

import torch
import torch.nn.functional as F
from safetensors.torch import load_file, save_file

import make_lpips_vectors
from torch_discriminator import Discriminator, discriminator_loss, faded, generator_loss, r1_penalty
from torch_model import (
    CODES,
    Decoder,
    DecoderSize,
    Encoder,
    Numbers,
    Parameters,
    SmallConv,
    code_loss,
    code_norm,
    depth_variance,
    opacity_loss,
    photometric_loss,
    sample_rays,
)


@dataclasses.dataclass
class Case:
    """The sizes of one comparison; tests/train/test_agreement.cpp has the same."""

    size: DecoderSize
    batch: int
    samples: int
    head_width: int
    perceptual: str
    numbers: Numbers
    ray_type: torch.dtype = torch.float64

    def image(self, name, side, channels=3):
        """(B, C, H, W) in [-1, 1]; the C++ side makes (B, H, W, C)."""
        values = self.numbers(name, self.batch, side, side, channels).double() / 1.75
        return values.float().to(self.numbers.dtype).permute(0, 3, 1, 2)

    def codes(self, prefix):
        return {
            group: self.numbers(f"{prefix}.{group}", self.batch, size)
            for group, size in CODES.items()
        }

    def masks(self):
        return [
            (self.image(f"mask{side}", side, 1) + 1.0) / 2.0
            for side in (self.size.resolution, self.size.rays_per_side)
        ]

    def targets(self):
        """At every resolution, from coarse to fine."""
        side, result = 2 * self.size.rays_per_side, []
        while side <= self.size.resolution:
            result.append(self.image(f"target{side}", side))
            side *= 2
        return result

    def poses(self):
        scale = torch.tensor([0.25, 0.125, 0.0625, 0.5, 0.5, 0.125], dtype=torch.float64)
        return self.numbers("poses", self.batch, 6).double() * scale + torch.tensor(
            [0, 0, 0, 0, 0, 5.25], dtype=torch.float64
        )

    def rays(self, jitter=None):
        """Samples along the rays, stratified with `jitter`. With ray_type float32 rounded as in
        float32 runs: what the encoding's highest frequency makes of this rounding is no error of
        the network."""
        side, uniforms = self.size.rays_per_side, None
        if jitter is not None:
            uniforms = jitter.uniform(self.batch, side**2, self.samples + 1)
        return [
            x.to(self.ray_type).to(self.numbers.dtype)
            for x in sample_rays(self.poses(), side, self.samples, uniforms)
        ]

    def jitter(self):
        return self.numbers.random.split("jitter")


# Where a leaky ReLU or the L1 loss sees a number that is zero within float32's rounding, its
# gradient is either of two. Seeds of the small cases were chosen with that in mind; `nearest_kink`
# says how near it is.
SMALL = {
    "decoder": Case(
        DecoderSize(16, 8, 4, 6, 2, (5, 4), 3, 2, rays_per_side=4), 2, 5, 8, "", Numbers(9)
    ),
    "stage1": Case(
        DecoderSize(64, 8, 2, 8, 3, (6, 5), 2, 2, rays_per_side=16),
        2,
        5,
        8,
        "squeezenet1_1",
        Numbers(3),
    ),
    "stage2": Case(DecoderSize(64, 8, 2, 8, 3, (6,), 2, 2), 4, 5, 8, "squeezenet1_1", Numbers(3)),
    "stage2_fading": Case(DecoderSize(128, 8, 2, 8, 3, (6, 5), 2, 2), 4, 5, 8, "", Numbers(271)),
}
PAPER = DecoderSize(64, 256, 8, 256, 10, (128,), 16, 4)
FULL = {
    "decoder": Case(PAPER, 8, 8, 512, "", Numbers(1)),
    "stage1": Case(PAPER, 8, 8, 512, "vgg16", Numbers(1)),
    "stage2": Case(PAPER, 8, 8, 512, "vgg16", Numbers(1)),
    "stage2_fading": Case(
        dataclasses.replace(PAPER, resolution=128, block_channels=(128, 64)),
        4,
        8,
        512,
        "",
        Numbers(1),
    ),
}
PHOTOMETRIC_WEIGHTS = [0.3, 0.7]


def channels_last(x):
    return x.permute(0, 2, 3, 1)


class Results:
    def __init__(self, folded, fold=32):
        self.tensors, self.fold = {}, fold if folded else None

    def put(self, name, value):
        value = torch.as_tensor(value, dtype=torch.float64).detach().clone().contiguous()
        if self.fold:
            value = value.flatten() * torch.cos(torch.arange(value.numel(), dtype=torch.float64))
            value = F.pad(value, (0, -len(value) % self.fold)).reshape(-1, self.fold).sum(0)
        self.tensors[name] = value

    def put_all(self, prefix, values):
        for name, value in values.items():
            self.put(f"{prefix}/{name}", value)


def gradients(loss, parameters):
    found = torch.autograd.grad(loss, list(parameters.values()), allow_unused=True)
    return {
        name: torch.zeros_like(p) if g is None else g
        for (name, p), g in zip(parameters.items(), found)
    }


def step(optimizer, parameters, gradient_of):
    for name, parameter in parameters.items():
        parameter.grad = gradient_of[name].clone()
    optimizer.step()


def decoder_case(results, name, case, network=Decoder):
    parameters = Parameters(case.numbers)
    decoder = network(parameters, "decoder", case.size)
    z = {group: value.requires_grad_() for group, value in case.codes("z").items()}
    out = decoder(z, case.rays())
    shown = {f"image{i}": channels_last(image) for i, image in enumerate(out["images"])}
    shown |= {
        "feature_map": channels_last(out["feature_map"]),
        "mask_logit": channels_last(out["mask_logit"]),
    }
    results.put_all(f"{name}/output", shown)
    loss = sum(value.square().mean() for value in shown.values())
    results.put_all(
        f"{name}/gradient",
        gradients(loss, parameters.tensors | {f"z.{group}": z[group] for group in CODES}),
    )


class Perceptual:
    """LPIPS with trunk and heads of our numbers; a plain 0 without a network."""

    def __init__(self, case):
        self.network = None
        if not case.perceptual:
            return
        self.network, self.taps = getattr(make_lpips_vectors, case.perceptual)()
        self.network.to(case.numbers.dtype).requires_grad_(False)
        for name, parameter in self.network.named_parameters():
            name = f"trunk.features.{name}"
            if parameter.dim() == 1:
                parameter.copy_(0.25 * case.numbers(name, *parameter.shape))
                continue
            outputs, inputs, height, width = parameter.shape
            value = (
                case.numbers(name, outputs, height, width, inputs).double()
                * (2.0 / (inputs * height * width)) ** 0.5
            )
            parameter.copy_(value.float().permute(0, 3, 1, 2))
        self.numbers = case.numbers

    def __call__(self, image, target):
        if self.network is None:
            return 0.0
        distance = 0.0
        both = [make_lpips_vectors.features(self.network, self.taps, x) for x in (image, target)]
        for k, (f, g) in enumerate(zip(*both)):
            head = self.numbers(f"heads.lin{k}", 1, 1, 1, f.shape[1]).abs().reshape(1, -1, 1, 1)
            distance = distance + (head * (f - g).square()).sum(1).mean()
        return distance


def reconstruction_terms(case, out):
    """The terms that both stages share, each with its weight."""
    targets, (mask, ray_mask) = case.targets(), case.masks()
    photometric = photometric_loss(out["images"], targets, PHOTOMETRIC_WEIGHTS)
    return {
        "photometric": (photometric, 1.0),
        "perceptual": (Perceptual(case)(out["images"][-1], targets[-1]), 0.1),
        "mask": (F.binary_cross_entropy_with_logits(out["mask_logit"], mask), 0.01),
        "opacity": (opacity_loss(out["transmittance"], ray_mask), 0.2),
        "depth_variance": (depth_variance(out["weights"], out["depths"]), 0.3),
    }


def put_losses(results, name, terms):
    total = sum(weight * term for term, weight in terms.values())
    results.put_all(name, {"total": total} | {term: value for term, (value, _) in terms.items()})
    return total


def model(case):
    parameters = Parameters(case.numbers)
    encoder = Encoder(
        parameters, "encoder", SmallConv(parameters, "encoder.backbone"), 256, case.head_width
    )
    return encoder, Decoder(parameters, "decoder", case.size), parameters.tensors


def stage1_case(results, name, case):
    """Every term of the first stage's loss, and one step of Adam on all of encoder and decoder."""
    encoder, decoder, parameters = model(case)
    z = encoder(case.image("input", 64))
    out = decoder(z, case.rays(case.jitter()))
    present = 1.0 - torch.arange(case.batch, dtype=case.numbers.dtype) % 2
    code_weights = {"id": 0.001, "expr": 0.1, "tex": 0.001, "light": 0.01}
    terms = reconstruction_terms(case, out)
    terms["code"] = (code_loss(z, case.codes("code"), present, code_weights), 1.0)
    terms["code_norm"] = (code_norm(z), 0.1)
    gradient_of = gradients(put_losses(results, f"{name}/loss", terms), parameters)
    results.put_all(f"{name}/gradient", gradient_of)
    step(
        torch.optim.Adam(list(parameters.values()), lr=1e-4, betas=(0.9, 0.999), eps=1e-8),
        parameters,
        gradient_of,
    )
    results.put_all(f"{name}/stepped", parameters)


def stage2_case(results, name, case, fade, show_gradients):
    """One update of the discriminator, one of R1, one of the generator."""
    encoder, decoder, parameters = model(case)
    parameters = {key: value for key, value in parameters.items() if key.startswith("decoder.")}
    weights = Parameters(case.numbers)
    discriminator = Discriminator(weights, "discriminator", case.size.resolution, max_channels=8)
    weights = weights.tensors
    lazy = 16 / 17
    discriminator_adam = torch.optim.Adam(
        list(weights.values()), lr=1e-4 * lazy, betas=(0.0, 0.99**lazy), eps=1e-8
    )
    jitter = case.jitter()
    with torch.no_grad():
        z = encoder(case.image("input", 64))
        fake = faded(decoder(z, case.rays(jitter))["images"][-1], fade)
    real = faded(case.targets()[-1], fade)

    real_logits, fake_logits = discriminator(real, fade), discriminator(fake, fade)
    loss = discriminator_loss(real_logits, fake_logits)
    values = {"loss": loss, "real_logit": real_logits.mean(), "fake_logit": fake_logits.mean()}
    found = {"discriminator": gradients(loss, weights)}
    step(discriminator_adam, weights, found["discriminator"])
    penalty = r1_penalty(lambda images: discriminator(images, fade), real)
    found["r1"] = gradients(10.0 * 16 * penalty, weights)
    step(discriminator_adam, weights, found["r1"])
    results.put_all(f"{name}/discriminator_loss", values | {"r1": penalty})

    out = decoder(z, case.rays(jitter))
    terms = reconstruction_terms(case, out)
    terms["adversarial"] = (
        generator_loss(discriminator(faded(out["images"][-1], fade), fade)),
        0.1,
    )
    found["generator"] = gradients(put_losses(results, f"{name}/generator_loss", terms), parameters)
    groups = [
        {
            "params": [
                p for key, p in parameters.items() if key.startswith("decoder.mapping.") == mapping
            ],
            "lr": rate,
        }
        for mapping, rate in ((False, 2e-3), (True, 2e-3 * 0.01))
    ]
    step(torch.optim.Adam(groups, betas=(0.0, 0.99), eps=1e-8), parameters, found["generator"])
    results.put_all(f"{name}/stepped", weights | parameters)
    for which, gradient_of in found.items():
        if show_gradients:
            results.put_all(f"{name}/{which}_gradient", gradient_of)


CASES = {
    "decoder": decoder_case,
    "stage1": stage1_case,
    "stage2": functools.partial(stage2_case, fade=1.0, show_gradients=False),
    "stage2_fading": functools.partial(stage2_case, fade=0.3, show_gradients=True),
}


def nearest_kink(name, results, case):
    """Runs a case and returns the smallest magnitude that a kinked function saw, relative to the
    root of their mean square."""
    nearest = []
    arguments = {
        "leaky_relu": lambda x, *_: x,
        "relu": lambda x: x,
        "l1_loss": lambda x, target: x - target,
    }
    originals = {function: getattr(F, function) for function in arguments}

    def observed(function, *args, **options):
        x = arguments[function](*args)
        if x.requires_grad:
            nearest.append((x.detach().abs().min() / x.detach().square().mean().sqrt()).item())
        return originals[function](*args, **options)

    for function in arguments:
        setattr(F, function, functools.partial(observed, function))
    CASES[name](results, name, case)
    for function, original in originals.items():
        setattr(F, function, original)
    return min(nearest)


def write(path, cases, folded):
    results = Results(folded=folded, fold=16)
    for name, case in cases.items():
        print(
            f"{path.name}, {name}: nearest kink {nearest_kink(name, results, case):.1e}", flush=True
        )
    save_file(results.tensors, path)


def print_errors(results, path):
    """Of PyTorch's own float32, as the C++ tests print theirs."""
    worst = {}
    for name, expected in load_file(path).items():
        difference = results.tensors[name] - expected
        errors = worst.setdefault("/".join(name.split("/")[:2]), [0, 0.0, 0.0])
        errors[0] += 1
        errors[1] = max(
            errors[1], (difference.abs().max() / expected.abs().max().clamp(min=1e-6)).item()
        )
        errors[2] = max(errors[2], (difference.norm() / expected.norm().clamp(min=1e-6)).item())
    for group, (count, largest, norm) in worst.items():
        print(
            f"agreement | {group} | {count} | PyTorch's float32 | {largest:.6g} | {norm:.6g} |",
            flush=True,
        )


def main():
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--out", type=pathlib.Path, help="folder for the vectors of the full width")
    parser.add_argument(
        "--float32",
        action="store_true",
        help="print the errors of PyTorch's own float32 against those vectors",
    )
    arguments = parser.parse_args()
    folder = arguments.out
    if folder is None:
        write(pathlib.Path(__file__).with_name("agreement_vectors.safetensors"), SMALL, folded=True)
        return
    folder.mkdir(parents=True, exist_ok=True)
    rounded = {
        name: dataclasses.replace(case, ray_type=torch.float32) for name, case in FULL.items()
    }
    if arguments.float32:
        results = Results(folded=False)
        for name, case in rounded.items():
            CASES[name](results, name, dataclasses.replace(case, numbers=Numbers(1, torch.float32)))
        print_errors(results, folder / "agreement_float32.safetensors")
        return
    write(folder / "agreement_float64.safetensors", FULL, folded=False)
    write(folder / "agreement_float32.safetensors", rounded, folded=False)


if __name__ == "__main__":
    main()
