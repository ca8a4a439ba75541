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
    Parameters,
    Philox,
    SmallConv,
    code_loss,
    code_norm,
    depth_variance,
    numbers,
    opacity_loss,
    photometric_loss,
)

POSES = torch.tensor([[0.2, -0.1, 0.05, 0.9, 0.6, 5.1], [-0.3, 0.15, -0.1, -1.4, -0.7, 5.4]], dtype=torch.float64)
FOLD = 32


@dataclasses.dataclass
class Case:
    """One set of sizes; the same numbers stand in tests/train/agreement_case.h."""

    decoder: DecoderSize
    stage: DecoderSize
    samples: int
    head_width: int


SMALL = Case(
    decoder=DecoderSize(16, 8, 4, 6, 2, (5, 4), 3, 2, rays_per_side=4),
    stage=DecoderSize(64, 8, 2, 8, 3, (6,), 2, 2),
    samples=5,
    head_width=8,
)
FULL = Case(
    decoder=DecoderSize(64, 256, 8, 256, 10, (128,), 16, 4),
    stage=DecoderSize(64, 256, 8, 256, 10, (128,), 16, 4),
    samples=8,
    head_width=512,
)


def channels_last(x):
    return x.permute(0, 2, 3, 1)


def picture(name, side, channels=3):
    """(B, C, H, W) in [-1, 1]; the C++ side makes (B, H, W, C)."""
    return (numbers(name, len(POSES), side, side, channels) / 1.75).float().double().permute(0, 3, 1, 2)


def codes(prefix):
    return {group: numbers(f"{prefix}.{group}", len(POSES), size) for group, size in CODES.items()}


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
    parameters = Parameters()
    decoder = Decoder(parameters, "decoder", case.decoder)
    z = {group: value.requires_grad_() for group, value in codes("decoder.z").items()}
    out = decoder(z, POSES, case.samples)
    shown = {f"image{i}": channels_last(image) for i, image in enumerate(out["images"])}
    shown |= {"feature_map": channels_last(out["feature_map"]), "mask_logit": channels_last(out["mask_logit"])}
    results.put_all("decoder/output", shown)
    loss = sum(value.square().mean() for value in shown.values())
    results.put_all("decoder/gradient", gradients(loss, parameters.tensors | {f"z.{group}": z[group] for group in CODES}))


def stage1_case(results, case):
    """Every term of the first stage's loss, and one step of Adam on all of encoder and decoder."""
    parameters = Parameters()
    encoder = Encoder(parameters, "encoder", SmallConv(parameters, "encoder.backbone"), 256, case.head_width)
    decoder = Decoder(parameters, "decoder", case.stage)
    rays = case.stage.rays_per_side
    uniforms = Philox(1).split("stage1.jitter").uniform(len(POSES), rays * rays, case.samples + 1)
    z = encoder(picture("stage1.input", 64))
    out = decoder(z, POSES, case.samples, uniforms)
    mask = (picture("stage1.mask", 64, 1) + 1.0) / 2.0
    mask_32 = (picture("stage1.mask_32", rays, 1) + 1.0) / 2.0
    present = torch.tensor([1.0, 0.0], dtype=torch.float64)
    code_weights = {"id": 0.001, "expr": 0.1, "tex": 0.001, "light": 0.01}
    terms = {
        "reconstruction": photometric_loss(out["images"], [picture("stage1.target0", 64)], [0.7]),
        "code": code_loss(z, codes("stage1.code"), present, code_weights),
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


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", type=pathlib.Path, help="folder for the vectors of the full width")
    folder = parser.parse_args().out
    results = Results(folded=folder is None)
    case = SMALL if folder is None else FULL
    decoder_case(results, case)
    stage1_case(results, case)
    folder = folder or pathlib.Path(__file__).parent
    folder.mkdir(parents=True, exist_ok=True)
    save_file(results.tensors, folder / "agreement_vectors.safetensors")


if __name__ == "__main__":
    main()
