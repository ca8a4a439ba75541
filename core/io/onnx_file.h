#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <string>
#include <vector>

#include "core/tensor.h"

namespace stymo {

/// One operation of an ONNX graph.
struct OnnxNode {
    std::string operation;  ///< "Conv", "PRelu", ...
    std::string name;
    std::vector<std::string> inputs;
    std::vector<std::string> outputs;
    std::map<std::string, double> numbers;  ///< attributes that are an integer or a float
    /// Attributes that are lists of integers.
    std::map<std::string, std::vector<std::int64_t>> integers;
};

/// The parts of a model from which weights are read: operations in topological order and constant
/// tensors by name.
struct OnnxGraph {
    std::vector<OnnxNode> nodes;
    std::map<std::string, Tensor> tensors;
};

/// Tensors may be kept in files beside the model. Throws FileError for a file that is truncated or
/// not an ONNX model, and if a file with its weights is missing.
[[nodiscard]] OnnxGraph read_onnx_file(const std::filesystem::path& path);

/// A model as OpenCV 4.6 computes it: with its weights inside, float32 instead of float16, bfloat16
/// and float64, axes of reductions and bounds of Clip as attributes, one axis in each Unsqueeze, a
/// reciprocal instead of a divisor that varies, and sums whose broadcast operands have become
/// equal.
struct PlainOnnx {
    std::string bytes;
    std::vector<std::int64_t> input;  ///< extents of the only input; 0 where any number will do
};

/// Throws like read_onnx_file, for a graph in which an operation takes what none before it gives,
/// and for one without a single input.
[[nodiscard]] PlainOnnx read_plain_onnx(const std::filesystem::path& path);

}  // namespace stymo
