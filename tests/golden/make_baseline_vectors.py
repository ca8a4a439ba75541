"""Writes what PyTorch makes of the decoders that the paper compares with, in float64, to
baseline_vectors.safetensors beside this script; every tensor is folded to 16 numbers. Needs torch,
numpy and safetensors. Weights and inputs as in make_agreement_vectors.py.
"""

import functools
import pathlib

from safetensors.torch import save_file

import make_agreement_vectors as agreement
from torch_baselines import HeadNerf, PixelNerf
from torch_model import DecoderSize, Numbers

NETWORKS = {
    "head_nerf": (HeadNerf, DecoderSize(16, 8, 4, 6, 2, (5, 4), 3, 0, rays_per_side=4)),
    "pixel_nerf": (PixelNerf, DecoderSize(16, 8, 4, 6, 2, (5, 4), 3, 0, rays_per_side=16)),
}


def main():
    results = agreement.Results(folded=True, fold=16)
    for name, (network, size) in NETWORKS.items():
        agreement.CASES[name] = functools.partial(agreement.decoder_case, network=network)
        nearest = agreement.nearest_kink(
            name, results, agreement.Case(size, 2, 5, 8, "", Numbers(1))
        )
        print(f"{name}: nearest kink {nearest:.1e}")
    save_file(results.tensors, pathlib.Path(__file__).with_name("baseline_vectors.safetensors"))


if __name__ == "__main__":
    main()
