"""Writes what PyTorch makes of whole networks and whole training steps, in float64, for the C++ tests named "agreement".

Without arguments: small networks, agreement_vectors.safetensors beside this script; every tensor is folded to at most 32 numbers.
With --out DIR: networks of the paper's width, cut at 64 pixels, into DIR/agreement_vectors.safetensors, unfolded.
Needs torch, numpy and safetensors. All weights and inputs are functions of their names (torch_model.numbers), so that they need not
be stored: the C++ side makes the same ones.
"""

import argparse
import dataclasses
import pathlib

import torch
import torch.nn.functional as F
from safetensors.torch import save_file

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
)

FOLD = 32


@dataclasses.dataclass
class Case:
    """The sizes of one comparison; tests/train/test_agreement.cpp has the same."""

    size: DecoderSize
    batch: int
    samples: int
    head_width: int
    numbers: Numbers

    def picture(self, name, side, channels=3):
        """(B, C, H, W) in [-1, 1]; the C++ side makes (B, H, W, C)."""
        return (self.numbers(name, self.batch, side, side, channels) / 1.75).float().double().permute(0, 3, 1, 2)

    def codes(self, prefix):
        return {group: self.numbers(f"{prefix}.{group}", self.batch, size) for group, size in CODES.items()}

    def poses(self):
        scale = torch.tensor([0.25, 0.125, 0.0625, 0.5, 0.5, 0.125], dtype=torch.float64)
        return self.numbers("poses", self.batch, 6) * scale + torch.tensor([0, 0, 0, 0, 0, 5.25], dtype=torch.float64)

    def uniforms(self, name):
        return self.numbers.random.split(name).uniform(self.batch, self.size.rays_per_side**2, self.samples + 1)


# Where a leaky ReLU or the L1 loss sees a number that is zero within float32's rounding, its gradient is either of two. Seeds of the
# small cases keep clear of that; `nearest_kink` prints by how much.
SMALL = {
    "decoder": Case(DecoderSize(16, 8, 4, 6, 2, (5, 4), 3, 2, rays_per_side=4), 2, 5, 8, Numbers(9)),
    "stage1": Case(DecoderSize(64, 8, 2, 8, 3, (6,), 2, 2), 2, 5, 8, Numbers(11)),
}
PAPER = DecoderSize(64, 256, 8, 256, 10, (128,), 16, 4)
FULL = {
    "decoder": Case(PAPER, 8, 8, 512, Numbers(1)),
    "stage1": Case(PAPER, 8, 8, 512, Numbers(1)),
}


def channels_last(x):
    return x.permute(0, 2, 3, 1)


class Results:
    def __init__(self, folded):
        self.tensors, self.folded = {}, folded

    def put(self, name, value):
        value = torch.as_tensor(value, dtype=torch.float64).detach().clone().contiguous()
        if self.folded:
            value = value.flatten() * torch.cos(torch.arange(value.numel(), dtype=torch.float64))
            value = F.pad(value, (0, -len(value) % FOLD)).reshape(-1, FOLD).sum(0)
        self.tensors[name] = value

    def put_all(self, prefix, values):
        for name, value in values.items():
            self.put(f"{prefix}/{name}", value)


def gradients(loss, parameters):
    found = torch.autograd.grad(loss, list(parameters.values()), allow_unused=True)
    return {name: torch.zeros_like(p) if g is None else g for (name, p), g in zip(parameters.items(), found)}


def adam_step(parameters, gradient_of, **options):
    """Values after one step from a fresh optimiser."""
    for name, parameter in parameters.items():
        parameter.grad = gradient_of[name].clone()
    torch.optim.Adam(list(parameters.values()), eps=1e-8, **options).step()


def decoder_case(results, case):
    parameters = Parameters(case.numbers)
    decoder = Decoder(parameters, "decoder", case.size)
    z = {group: value.requires_grad_() for group, value in case.codes("decoder.z").items()}
    out = decoder(z, case.poses(), case.samples)
    shown = {f"image{i}": channels_last(image) for i, image in enumerate(out["images"])}
    shown |= {"feature_map": channels_last(out["feature_map"]), "mask_logit": channels_last(out["mask_logit"])}
    results.put_all("decoder/output", shown)
    loss = sum(value.square().mean() for value in shown.values())
    results.put_all("decoder/gradient", gradients(loss, parameters.tensors | {f"z.{group}": z[group] for group in CODES}))


def stage1_case(results, case):
    """Every term of the first stage's loss, and one step of Adam on all of encoder and decoder."""
    parameters = Parameters(case.numbers)
    encoder = Encoder(parameters, "encoder", SmallConv(parameters, "encoder.backbone"), 256, case.head_width)
    decoder = Decoder(parameters, "decoder", case.size)
    rays = case.size.rays_per_side
    z = encoder(case.picture("stage1.input", 64))
    out = decoder(z, case.poses(), case.samples, case.uniforms("stage1.jitter"))
    mask = (case.picture("stage1.mask", 64, 1) + 1.0) / 2.0
    mask_32 = (case.picture("stage1.mask_32", rays, 1) + 1.0) / 2.0
    present = 1.0 - torch.arange(case.batch, dtype=torch.float64) % 2
    code_weights = {"id": 0.001, "expr": 0.1, "tex": 0.001, "light": 0.01}
    terms = {
        "reconstruction": photometric_loss(out["images"], [case.picture("stage1.target0", 64)], [0.7]),
        "code": code_loss(z, case.codes("stage1.code"), present, code_weights),
        "mask": F.binary_cross_entropy_with_logits(out["mask_logit"], mask),
        "opacity": opacity_loss(out["transmittance"], mask_32),
        "depth_variance": depth_variance(out["weights"], out["depths"]),
        "code_norm": code_norm(z),
    }
    weights = {"reconstruction": 1.0, "code": 1.0, "mask": 0.01, "opacity": 0.2, "depth_variance": 0.3, "code_norm": 0.1}
    terms["total"] = sum(weight * terms[name] for name, weight in weights.items())
    results.put_all("stage1/loss", terms)
    gradient_of = gradients(terms["total"], parameters.tensors)
    results.put_all("stage1/gradient", gradient_of)
    adam_step(parameters.tensors, gradient_of, lr=1e-4, betas=(0.9, 0.999))
    results.put_all("stage1/stepped", parameters.tensors)


CASES = {"decoder": decoder_case, "stage1": stage1_case}


def nearest_kink(case, results, settings):
    """Runs a case and returns the smallest magnitude that a kinked function saw."""
    nearest = []
    functions = {"leaky_relu": lambda x, *_: x, "relu": lambda x, *_: x, "l1_loss": lambda x, target: x - target}
    originals = {name: getattr(F, name) for name in functions}
    for name, argument in functions.items():

        def observed(*args, name=name, argument=argument, **options):
            nearest.append(argument(*args).detach().abs().min().item())
            return originals[name](*args, **options)

        setattr(F, name, observed)
    case(results, settings)
    for name, original in originals.items():
        setattr(F, name, original)
    return min(nearest)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", type=pathlib.Path, help="folder for the vectors of the full width")
    folder = parser.parse_args().out
    results = Results(folded=folder is None)
    for name, case in CASES.items():
        print(f"{name}: nearest kink {nearest_kink(case, results, (FULL if folder else SMALL)[name]):.1e}")
    folder = folder or pathlib.Path(__file__).parent
    folder.mkdir(parents=True, exist_ok=True)
    save_file(results.tensors, folder / "agreement_vectors.safetensors")


if __name__ == "__main__":
    main()
