"""Writes weights/published_names.json: names and shapes of the tensors of published networks, from
torchvision (0.29) and from insightface's recognition/arcface_torch/backbones, the folder that the
only argument names. Of further iresnets the number of blocks.
"""

import json
import pathlib
import re
import sys

import torch
import torchvision

sys.path.insert(0, sys.argv[1])
import iresnet  # noqa: E402


def shapes(network):
    return {name: list(value.shape) for name, value in network.state_dict().items()}


def blocks(network):
    found = [
        set(re.findall(rf"layer{stage}\.(\d+)\.", "\n".join(network.state_dict())))
        for stage in (1, 2, 3, 4)
    ]
    return [len(indices) for indices in found]


with torch.device("meta"):
    names = {
        name: shapes(getattr(torchvision.models, name)())
        for name in ("vgg16", "alexnet", "squeezenet1_1", "vgg19", "squeezenet1_0")
    }
    names["iresnet18"] = shapes(iresnet.iresnet18())
    names["blocks"] = {
        name: blocks(getattr(iresnet, name)()) for name in ("iresnet34", "iresnet50", "iresnet100")
    }
target = pathlib.Path(__file__).parent / "weights" / "published_names.json"
target.write_text(json.dumps(names, separators=(",", ":")) + "\n")
