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

/// Throws FileError for a file that is truncated, not an ONNX model, or keeps its weights in other
/// files.
[[nodiscard]] OnnxGraph read_onnx_file(const std::filesystem::path& path);

}  // namespace stymo
