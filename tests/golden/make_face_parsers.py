"""Writes onnx/face_parser_*.onnx with the package onnx (1.23): parsers that take each part of a
head for the one whose colour it has.

The n-th part of CelebAMask-HQ has the n-th of the colours below; each network gives the parts in
its own convention's order, by name.
"""

import pathlib

import numpy
import onnx
from onnx import TensorProto, helper, numpy_helper

CELEBAMASK = (
    "background skin nose glasses l_eye r_eye l_brow r_brow l_ear r_ear mouth u_lip l_lip hair hat "
    "earring necklace neck cloth"
).split()
BISENET = (
    "background skin l_brow r_brow l_eye r_eye glasses l_ear r_ear earring nose mouth u_lip l_lip "
    "neck necklace cloth hair hat"
).split()
IMAGENET = numpy.array([[0.485, 0.456, 0.406], [0.229, 0.224, 0.225]])
folder = pathlib.Path(__file__).parent / "onnx"


def color(name):
    """Three levels of each channel, as tests/fit/photo/test_face_parser.cpp has them."""
    n = CELEBAMASK.index(name)
    return numpy.array([n // 9, n // 3 % 3, n % 3]) / 2


def parser(names, side, mean, deviation, outputs):
    """Logits 2 c.x - c.c of the mean x of each block of 16 pixels: largest for the nearest colour
    c."""
    blocks = side // 16
    colors = numpy.stack([color(name) for name in names])
    weight = 2 * colors * deviation
    bias = 2 * colors @ mean - (colors * colors).sum(1)
    tensors = [
        numpy_helper.from_array(numpy.float32(weight)[:, :, None, None], "weight"),
        numpy_helper.from_array(numpy.float32(bias), "bias"),
        numpy_helper.from_array(numpy.array([1, len(names), blocks, blocks]), "extents"),
    ]
    nodes = [
        helper.make_node(
            "AveragePool", ["image"], ["mean"], kernel_shape=[16, 16], strides=[16, 16]
        ),
        helper.make_node("Conv", ["mean", "weight", "bias"], ["logits"], kernel_shape=[1, 1]),
        # The extents are constants, as in networks that were exported for one size.
        helper.make_node("Reshape", ["logits", "extents"], ["out"]),
    ]
    nodes += [helper.make_node("Relu", ["out"], [f"out{i}"]) for i in range(1, outputs)]
    results = ["out"] + [f"out{i}" for i in range(1, outputs)]
    image = helper.make_tensor_value_info("image", TensorProto.FLOAT, [1, 3, side, side])
    extents = [1, len(names), blocks, blocks]
    graph = helper.make_graph(
        nodes,
        "graph",
        [image],
        [helper.make_tensor_value_info(name, TensorProto.FLOAT, extents) for name in results],
        tensors,
    )
    return helper.make_model(graph, opset_imports=[helper.make_opsetid("", 13)], ir_version=8)


half = numpy.array([0.5, 0.5, 0.5])
onnx.save(parser(CELEBAMASK, 256, half, half, 1), folder / "face_parser_celebamask.onnx")
onnx.save(parser(BISENET, 512, *IMAGENET, 1), folder / "face_parser_bisenet.onnx")
onnx.save(parser(BISENET[:18], 512, *IMAGENET, 1), folder / "face_parser_18_classes.onnx")


def opset18(model):
    """Plus nothing, by a reduction whose axes are an input."""
    graph = model.graph
    graph.node[-1].output[0] = "logits of blocks"
    graph.initializer.append(numpy_helper.from_array(numpy.array([2, 3]), "axes"))
    graph.node.append(helper.make_node("ReduceMax", ["logits of blocks", "axes"], ["largest"]))
    graph.node.append(helper.make_node("Sub", ["largest", "largest"], ["zero"]))
    graph.node.append(helper.make_node("Add", ["logits of blocks", "zero"], ["out"]))
    model.opset_import[0].version = 18
    return model


def noop(model):
    """The same, where a reduction over no axis comes before, and both have
    noop_with_empty_axes."""
    model = opset18(model)
    graph = model.graph
    for node in graph.node:
        if node.op_type == "ReduceMax":
            node.attribute.append(helper.make_attribute("noop_with_empty_axes", 1))
    graph.node[0].output[0] = "mean of blocks"
    graph.node.insert(
        1, helper.make_node("ReduceSum", ["mean of blocks"], ["mean"], noop_with_empty_axes=1)
    )
    return model


def broadcast(model):
    """Then operations that keep the order of the classes and that OpenCV 4.6 does not know, or
    computes wrongly: the mean of the classes minus the logits, subtracted from the largest of
    each column; its logarithm by a narrow dividend; bounds that are inputs."""
    graph = model.graph
    graph.node[-1].output[0] = "logits of blocks"
    for name, value in [
        ("classes", numpy.array([1])),
        ("classes and rows", numpy.array([1, 2])),
        ("low", numpy.float32(0)),
        ("high", numpy.float32(1e9)),
    ]:
        graph.initializer.append(numpy_helper.from_array(numpy.asarray(value), name))
    graph.node.extend(
        [
            helper.make_node("ReduceMean", ["logits of blocks", "classes"], ["mean of classes"]),
            helper.make_node("Sub", ["mean of classes", "logits of blocks"], ["negative"]),
            helper.make_node(
                "ReduceMax", ["negative", "classes and rows"], ["largest"], keepdims=0
            ),
            helper.make_node("Unsqueeze", ["largest", "classes and rows"], ["of columns"]),
            helper.make_node("Sub", ["negative", "of columns"], ["lower"]),
            helper.make_node("Exp", ["lower"], ["powers"]),
            helper.make_node("Exp", ["of columns"], ["dividend"]),
            helper.make_node("Div", ["dividend", "powers"], ["quotient"]),
            helper.make_node("Clip", ["quotient", "low", "high"], ["clipped"]),
            helper.make_node("Min", ["clipped", "high"], ["out"]),
        ]
    )
    model.opset_import[0].version = 18
    return model


def float16(model):
    """With float16 weights, input and output."""
    for tensor in model.graph.initializer:
        if tensor.data_type == TensorProto.FLOAT:
            narrow = numpy_helper.to_array(tensor).astype(numpy.float16)
            tensor.CopyFrom(numpy_helper.from_array(narrow, tensor.name))
    for value in [*model.graph.input, *model.graph.output]:
        value.type.tensor_type.elem_type = TensorProto.FLOAT16
    return model


onnx.save(opset18(parser(CELEBAMASK, 256, half, half, 1)), folder / "face_parser_opset18.onnx")
onnx.save(noop(parser(CELEBAMASK, 256, half, half, 1)), folder / "face_parser_noop.onnx")
onnx.save(broadcast(parser(CELEBAMASK, 256, half, half, 1)), folder / "face_parser_broadcast.onnx")
onnx.save(float16(parser(CELEBAMASK, 256, half, half, 1)), folder / "face_parser_float16.onnx")
onnx.save(
    parser(CELEBAMASK, 256, half, half, 1),
    folder / "face_parser_external.onnx",
    save_as_external_data=True,
    location="face_parser_external.onnx.data",
    size_threshold=0,
)
