#pragma once

#include <string>

#include "core/io/onnx_file.h"
#include "core/io/tensor_file.h"

namespace stymo {

struct NamedIresnet {
    std::string name;  ///< "iresnet50"
    TensorFile file;   ///< in the names and layout of insightface's PyTorch files
};

/// Whether the graph begins as an iresnet does and few other networks do: a rectified convolution,
/// then a batch norm before the next one.
[[nodiscard]] bool begins_like_iresnet(const OnnxGraph& graph);

/// The weights of an iresnet that was exported to ONNX, as insightface ships its networks, under
/// their names in PyTorch. The names in the ONNX file do not matter: each tensor is identified by
/// its position in the order of the operations. Where a batch norm was folded into the convolution
/// before it, the file returned has one that only adds the bias. Throws FileError naming `source`
/// and the first operation that differs from an iresnet, or the numbers of blocks if they are not
/// those of iresnet18, 34, 50, 100 or 200.
[[nodiscard]] NamedIresnet iresnet_from_onnx(const OnnxGraph& graph, const std::string& source);

}  // namespace stymo
