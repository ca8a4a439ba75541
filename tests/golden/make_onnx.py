"""Writes weights/*.onnx with the package onnx (1.23): each way to store a tensor, each kind of
attribute that is read."""

import pathlib

import numpy as np
import onnx
from onnx import TensorProto, helper, numpy_helper

folder = pathlib.Path(__file__).parent / "weights"
folder.mkdir(exist_ok=True)


def stored(name, kind, shape, values):
    """Values in the lists of the message (float_data, int32_data...), not as raw bytes."""
    return helper.make_tensor(name, kind, shape, values)


tensors = [
    numpy_helper.from_array(
        np.arange(36, dtype=np.float32).reshape(2, 2, 3, 3) - 0.5, "conv.weight"
    ),
    numpy_helper.from_array(np.array([1.5, -65504.0, 2.0**-24], np.float16), "f16_raw"),
    numpy_helper.from_array(np.array([-1, 1 << 40], np.int64), "i64_raw"),
    numpy_helper.from_array(np.array(4.25), "f64_scalar"),
    numpy_helper.from_array(np.zeros((0, 3), np.float32), "empty"),
    stored("f32", TensorProto.FLOAT, [2, 1], [0.25, -3.0]),
    stored("f64", TensorProto.DOUBLE, [1], [np.pi]),
    stored("f16", TensorProto.FLOAT16, [2], np.array([1.5, -0.5], np.float16)),
    stored("bf16", TensorProto.BFLOAT16, [2], [1.0, -2.5]),
    stored("i8", TensorProto.INT8, [2], [-128, 127]),
    stored("u8", TensorProto.UINT8, [2], [0, 255]),
    stored("i16", TensorProto.INT16, [1], [-32768]),
    stored("i32", TensorProto.INT32, [2], [-2147483648, 7]),
    stored("i64", TensorProto.INT64, [2], [-5, 1 << 40]),
    stored("u64", TensorProto.UINT64, [1], [1 << 63]),
    stored("bool", TensorProto.BOOL, [2], [True, False]),
]
nodes = [
    helper.make_node(
        "Constant", [], ["shape"], value=numpy_helper.from_array(np.array([1, -1], np.int64))
    ),
    helper.make_node(
        "Conv",
        ["image", "conv.weight"],
        ["a"],
        name="first",
        kernel_shape=[3, 3],
        strides=[2, 2],
        group=1,
        auto_pad="NOTSET",
    ),
    helper.make_node("LeakyRelu", ["a"], ["b"], alpha=0.25),
    helper.make_node("Transpose", ["b"], ["c"], perm=[0, 2, 3, 1]),
    helper.make_node("Reshape", ["c", "shape"], ["out"], allowzero=-1),
]


def model(nodes, tensors):
    image = helper.make_tensor_value_info("image", TensorProto.FLOAT, [1, 2, 8, 8])
    out = helper.make_tensor_value_info("out", TensorProto.FLOAT, [1, None])
    return helper.make_model(helper.make_graph(nodes, "graph", [image], [out], tensors))


onnx.save(model(nodes, tensors), folder / "small.onnx")
onnx.save(
    model(nodes[2:3], [helper.make_tensor("words", TensorProto.STRING, [1], [b"text"])]),
    folder / "string.onnx",
)

large = model(
    nodes[1:2], [numpy_helper.from_array(np.ones((2, 2, 3, 3), np.float32), "conv.weight")]
)
onnx.save(
    large,
    folder / "external.onnx",
    save_as_external_data=True,
    location="external.bin",
    size_threshold=0,
)
(folder / "external.bin").unlink()
