"""Writes what PyTorch makes of the discriminator and of R1, in float64, for the C++ tests tagged
"agreement".

Without arguments: small ones, discriminator_vectors.safetensors beside this script; every tensor is
folded to at most 32 numbers. With --out DIR [--side 256]: one of the paper's width, into
DIR/discriminator_vectors.safetensors, unfolded. Needs torch, numpy and safetensors. All weights and
images are functions of their names (torch_model.Numbers), so that they need not be stored: the C++
side makes the same ones.
"""

import argparse
import pathlib

import torch
from safetensors.torch import save_file

from make_agreement_vectors import Results, gradients, print_errors
from torch_discriminator import Discriminator, discriminator_loss, faded, r1_penalty
from torch_model import Numbers, Parameters


def image(numbers, name, batch, side):
    """(B, C, H, W) in [-1, 1]; the C++ side makes (B, H, W, C)."""
    return (
        (numbers(name, batch, side, side, 3).double() / 1.75)
        .float()
        .to(numbers.dtype)
        .permute(0, 3, 1, 2)
    )


def case(results, name, resolution, side, batch, fade, dtype=torch.float64, **size):
    numbers = Numbers(1, dtype)
    parameters = Parameters(numbers)
    discriminator = Discriminator(parameters, "discriminator", resolution, **size)
    real = (
        faded(image(numbers, "discriminator.real", batch, side), fade).detach().requires_grad_()
    )
    fake = faded(image(numbers, "discriminator.fake", batch, side), fade)
    real_logits, fake_logits = discriminator(real, fade), discriminator(fake, fade)
    (dlogits_dx,) = torch.autograd.grad(real_logits.sum(), real, retain_graph=True)
    loss = discriminator_loss(real_logits, fake_logits)
    first_order = gradients(loss, parameters.tensors) | {
        "dlogits_dx": dlogits_dx.permute(0, 2, 3, 1)
    }
    results.put_all(f"{name}/loss_gradient", first_order)
    # The graph of the loss is gone before that of R1 is made.
    real, real_logits, fake_logits, loss = (
        value.detach() for value in (real, real_logits, fake_logits, loss)
    )
    penalty = r1_penalty(lambda images: discriminator(images, fade), real)
    results.put_all(
        f"{name}/value",
        {
            "images": real.permute(0, 2, 3, 1),
            "real_logits": real_logits,
            "fake_logits": fake_logits,
            "loss": loss,
            "r1": penalty,
        },
    )
    results.put_all(f"{name}/r1_gradient", gradients(penalty, parameters.tensors))


def main():
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--out", type=pathlib.Path, help="folder for the vectors of the full width")
    parser.add_argument("--side", type=int, default=256, help="resolution of the full one")
    parser.add_argument(
        "--float32",
        action="store_true",
        help="print the errors of PyTorch's own float32 against those vectors",
    )
    arguments = parser.parse_args()
    results = Results(folded=arguments.out is None)
    if arguments.out is None:
        case(results, "side64", 128, 64, 4, 1.0, max_channels=8, group_size=2)
        case(results, "side128", 128, 128, 4, 0.3, max_channels=8, group_size=4)
    else:
        dtype = torch.float32 if arguments.float32 else torch.float64
        case(results, "full", arguments.side, arguments.side, 2, 1.0, dtype)
        if arguments.float32:
            print_errors(results, arguments.out / "discriminator_vectors.safetensors")
            return
    folder = arguments.out or pathlib.Path(__file__).parent
    folder.mkdir(parents=True, exist_ok=True)
    save_file(results.tensors, folder / "discriminator_vectors.safetensors")


if __name__ == "__main__":
    main()
