"""Writes weights/*.pth with PyTorch (2.15) and NumPy (2): what a checkpoint may hold, in both
formats, and what it must not."""

import argparse
import collections
import os
import pathlib
import pickle

import numpy as np
import torch

folder = pathlib.Path(__file__).parent / "weights"
folder.mkdir(exist_ok=True)


def save(name, value, legacy=False, **options):
    torch.save(value, folder / name, _use_new_zipfile_serialization=not legacy, **options)


types = {
    "f32": torch.tensor([[0.5, -2.0, 1e-3]]),
    "f64": torch.tensor([np.pi, -1e300], dtype=torch.float64),
    "f16": torch.tensor([1.5, -65504.0, 2.0**-24, float("inf")], dtype=torch.float16),
    "bf16": torch.tensor([1.0, -2.5, 3.140625], dtype=torch.bfloat16),
    "i8": torch.tensor([-128, 127], dtype=torch.int8),
    "i16": torch.tensor([-32768, 7], dtype=torch.int16),
    "i32": torch.tensor([-2147483648, 7], dtype=torch.int32),
    "i64": torch.tensor([-1, 1 << 40]),
    "u8": torch.tensor([0, 255], dtype=torch.uint8),
    "bool": torch.tensor([True, False]),
    "scalar": torch.tensor(4.25),
    "empty": torch.zeros(0, 3),
}

base = torch.arange(24, dtype=torch.float32)
state = collections.OrderedDict(
    whole=base.view(2, 3, 4),
    transposed=base.view(4, 6).t(),
    part=base.view(4, 6)[1:3, ::2],
    repeated=torch.tensor([7.0]).expand(2, 3),
    parameter=torch.nn.Parameter(torch.tensor([3.0, 4.0])),
)
state["tied"] = state["part"]
state._metadata = {"": {"version": 1}}
views = {
    "state_dict": state,
    "optimizer": {
        "state": {0: {"step": 12, "moment": torch.tensor([0.25])}},
        "groups": [{"lr": 1e-4, "params": [0, 1]}],
    },
    "list": [torch.tensor([1.0]), (torch.tensor([2.0]), "text")],
    "epoch": 3,
    "big": 1 << 80,
    "nothing": None,
    "flags": {True, 2},
    "shape": base.view(2, 12).shape,
    "type": torch.float16,
}

for legacy in (False, True):
    suffix = "_legacy.pth" if legacy else ".pth"
    save("types" + suffix, types, legacy)
    save("views" + suffix, views, legacy)
save("views_protocol4.pth", views, pickle_protocol=4)
save("views_legacy_protocol4.pth", views, True, pickle_protocol=4)


class Malicious:
    """Pickles as a call of any function."""

    def __init__(self, function, *arguments):
        self.call = (function, arguments)

    def __reduce__(self):
        return self.call


save("system.pth", {"weight": torch.ones(1), "more": Malicious(os.system, "touch executed")})
save(
    "system_legacy.pth",
    {"weight": torch.ones(1), "more": Malicious(os.system, "touch executed")},
    True,
)
save("eval.pth", {"weight": Malicious(eval, "open('executed', 'w')")}, pickle_protocol=4)
save("numpy_scalar.pth", {"weight": torch.ones(1), "loss": np.float64(0.5)})
save("numpy_array.pth", {"weight": torch.ones(1), "mean": np.zeros(2)})
trainer = {
    "weight": torch.ones(1),
    "best": np.float32(0.5),
    "epoch": np.int64(3),
    "args": argparse.Namespace(lr=0.1),
    "device": torch.device("cpu"),
    "milestones": collections.Counter([3, 5]),
}
save("trainer.pth", trainer)
save("trainer_legacy.pth", trainer, True)
save("module.pth", {"model": torch.nn.Linear(1, 1)})
(folder / "plain.pkl").write_bytes(pickle.dumps({"weight": [1.0, 2.0]}, protocol=2))
