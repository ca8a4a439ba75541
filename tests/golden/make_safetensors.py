"""Writes safetensors/types.safetensors with the packages safetensors (0.8) and numpy: a tensor of
every element type."""

import pathlib

import numpy as np
from safetensors import TensorSpec, serialize_file

# 0, -1.5, the largest and the smallest half, infinity, and 1/3 rounded to a half.
halves = np.array([0x0000, 0xBE00, 0x7BFF, 0x0001, 0x7C00, 0x3555], np.uint16)
# 1, -2.5, pi rounded to bfloat16.
brain_floats = np.array([0x3F80, 0xC020, 0x4049], np.uint16)
tensors = {
    "f32": ("float32", np.arange(6, dtype=np.float32).reshape(2, 3) - 2.5),
    "f64": ("float64", np.array([np.pi, -1e300])),
    "f16": ("float16", halves),
    "bf16": ("bfloat16", brain_floats),
    "i8": ("int8", np.array([-128, 127], np.int8)),
    "i16": ("int16", np.array([-32768, 32767], np.int16)),
    "i32": ("int32", np.array([-2147483648, 7], np.int32)),
    "i64": ("int64", np.array([-1, 1 << 40], np.int64)),
    "u8": ("uint8", np.array([0, 255], np.uint8)),
    "u16": ("uint16", np.array([0, 65535], np.uint16)),
    "u32": ("uint32", np.array([0, 4294967295], np.uint32)),
    "u64": ("uint64", np.array([0, 1 << 63], np.uint64)),
    "bool": ("bool", np.array([True, False])),
    "scalar": ("float32", np.array(4.25, np.float32)),
    "empty": ("float32", np.zeros((0, 3), np.float32)),
}
folder = pathlib.Path(__file__).parent / "safetensors"
folder.mkdir(exist_ok=True)
described = {
    name: TensorSpec(
        dtype=dtype, shape=list(array.shape), data_ptr=array.ctypes.data, data_len=array.nbytes
    )
    for name, (dtype, array) in tensors.items()
}
serialize_file(
    described, str(folder / "types.safetensors"), {"origin": "safetensors", "note": "caf\u00e9"}
)
