"""Writes a tiny iresnet as PyTorch computes it: iresnet_vectors.safetensors (weights in
insightface's names, embedding, gradients) and the same network as two ONNX files, exported as
insightface ships its own (batch norms folded into convolutions) and unfolded.

    python tests/golden/make_iresnet_vectors.py                  the small files in this folder
    python tests/golden/make_iresnet_vectors.py --large FOLDER   iresnet50.safetensors at true size,
    0.7 GB, never committed

Written from the description of the network, independently of the C++ code. Needs torch, numpy,
safetensors and onnx.
"""

import argparse
import pathlib

import torch
from safetensors.torch import save_file
from torch import nn

here = pathlib.Path(__file__).parent
generator = torch.Generator().manual_seed(20261121)


def uniform(*shape, low=-1.0, high=1.0):
    """Float64 numbers that a float32 file holds exactly."""
    return (torch.rand(*shape, generator=generator) * (high - low) + low).double()


class Block(nn.Module):
    def __init__(self, inputs, outputs, stride):
        super().__init__()
        self.bn1 = nn.BatchNorm2d(inputs)
        self.conv1 = nn.Conv2d(inputs, outputs, 3, padding=1, bias=False)
        self.bn2 = nn.BatchNorm2d(outputs)
        self.prelu = nn.PReLU(outputs)
        self.conv2 = nn.Conv2d(outputs, outputs, 3, stride=stride, padding=1, bias=False)
        self.bn3 = nn.BatchNorm2d(outputs)
        if stride != 1 or inputs != outputs:
            self.downsample = nn.Sequential(
                nn.Conv2d(inputs, outputs, 1, stride=stride, bias=False), nn.BatchNorm2d(outputs)
            )
        else:
            self.downsample = None

    def forward(self, x):
        y = self.bn3(self.conv2(self.prelu(self.bn2(self.conv1(self.bn1(x))))))
        return y + (x if self.downsample is None else self.downsample(x))


class Iresnet(nn.Module):
    def __init__(self, blocks, widths, side, embedding):
        super().__init__()
        self.conv1 = nn.Conv2d(3, widths[0], 3, padding=1, bias=False)
        self.bn1 = nn.BatchNorm2d(widths[0])
        self.prelu = nn.PReLU(widths[0])
        inputs = widths[0]
        for stage, (count, width) in enumerate(zip(blocks, widths)):
            stage_blocks = []
            for i in range(count):
                stage_blocks.append(Block(inputs, width, 2 if i == 0 else 1))
                inputs = width
            self.add_module(f"layer{stage + 1}", nn.Sequential(*stage_blocks))
        self.bn2 = nn.BatchNorm2d(inputs)
        self.fc = nn.Linear(inputs * (side // 16) ** 2, embedding)
        self.features = nn.BatchNorm1d(embedding)
        self.features.weight.requires_grad_(False)

    def forward(self, x):
        x = self.prelu(self.bn1(self.conv1(x)))
        for stage in (self.layer1, self.layer2, self.layer3, self.layer4):
            x = stage(x)
        return self.features(self.fc(torch.flatten(self.bn2(x), 1)))


def lively(network, side):
    """Weights as after some training: statistics of real activations, slopes and affine parts that
    are not the first ones."""
    with torch.no_grad():
        for name, module in network.named_modules():
            if isinstance(module, nn.Conv2d):
                module.weight.copy_(torch.randn(module.weight.shape, generator=generator) * 0.1)
            elif isinstance(module, nn.Linear):
                module.weight.copy_(uniform(*module.weight.shape) / module.weight.shape[1] ** 0.5)
                module.bias.copy_(uniform(*module.bias.shape, low=-0.3, high=0.3))
            elif isinstance(module, nn.PReLU):
                module.weight.copy_(uniform(*module.weight.shape, low=0.1, high=0.4))
            elif isinstance(module, (nn.BatchNorm1d, nn.BatchNorm2d)):
                module.momentum = None  # the plain mean of all batches
                module.bias.copy_(uniform(*module.bias.shape, low=-0.3, high=0.3))
                if name != "features":
                    module.weight.copy_(uniform(*module.weight.shape, low=0.7, high=1.3))
        network.train()
        network(uniform(8, 3, side, side).float())
        for parameter in [*network.parameters(), *network.buffers()]:
            parameter.copy_(parameter.float())
    return network.eval()


def channels_last(name, gradient, side):
    """In the layout of the C++ code."""
    if name == "fc.weight":
        rows, columns = gradient.shape
        last = side // 16
        gradient = (
            gradient.reshape(rows, columns // last**2, last, last)
            .permute(0, 2, 3, 1)
            .reshape(rows, 1, 1, columns)
        )
    elif gradient.dim() == 4:
        gradient = gradient.permute(0, 2, 3, 1)
    return gradient.contiguous()


def vectors(network, side, batch):
    tensors = {
        name: value.detach().clone()
        for name, value in network.state_dict().items()
        if value.dim() > 0
    }
    network = network.double()
    x = uniform(batch, 3, side, side).requires_grad_()
    y = network(x)
    dL_dy = uniform(*y.shape)
    parameters = {name: value for name, value in network.named_parameters() if value.requires_grad}
    dL_dx, *gradients = torch.autograd.grad(y, [x, *parameters.values()], dL_dy)
    tensors["vectors.x"] = x.detach().permute(0, 2, 3, 1).contiguous()
    tensors["vectors.y"] = y.detach()
    tensors["vectors.dL_dy"] = dL_dy
    tensors["vectors.dL_dx"] = dL_dx.permute(0, 2, 3, 1).contiguous()
    for name, gradient in zip(parameters, gradients):
        tensors[f"vectors.dL_d.{name}"] = channels_last(name, gradient, side)
    network.float()
    return tensors


def small_files():
    side = 32
    network = lively(Iresnet((2, 2, 2, 2), (4, 6, 8, 10), side, 12), side)
    save_file(vectors(network, side, 2), here / "iresnet_vectors.safetensors")
    x = torch.zeros(1, 3, side, side)
    (here / "onnx").mkdir(exist_ok=True)
    for name, mode in {
        "folded": torch.onnx.TrainingMode.EVAL,
        "unfolded": torch.onnx.TrainingMode.PRESERVE,
    }.items():
        torch.onnx.export(
            network,
            (x,),
            here / f"onnx/iresnet_{name}.onnx",
            training=mode,
            opset_version=11,
            dynamo=False,
        )


parser = argparse.ArgumentParser()
parser.add_argument("--large", type=pathlib.Path)
arguments = parser.parse_args()
if arguments.large is None:
    small_files()
else:
    arguments.large.mkdir(parents=True, exist_ok=True)
    network = lively(Iresnet((3, 4, 14, 3), (64, 128, 256, 512), 112, 512), 112)
    save_file(vectors(network, 112, 1), arguments.large / "iresnet50.safetensors")
