#pragma once

#include <string>

#include "core/io/onnx_file.h"
#include "core/io/tensor_file.h"

namespace stymo {

struct NamedIresnet {
    std::string name;  ///< "iresnet50"
    TensorFile file;   ///< with the names and the layout of insightface's PyTorch files
};

/// Whether the graph begins with the operations of an iresnet, which few other networks do:
/// convolution, PReLU, batch norm, convolution, where another batch norm may follow the first
/// convolution.
[[nodiscard]] bool begins_like_iresnet(const OnnxGraph& graph);

/// The weights of an iresnet in ONNX, the format in which insightface publishes its networks, with
/// their names in PyTorch. Tensors are identified by the order of the operations; their names in
/// ONNX do not matter. If a batch norm was folded into the convolution before it, the result has a
/// batch norm that only adds the bias. Throws FileError, which names `source` and the first
/// operation that differs from an iresnet, or the numbers of blocks if they are not those of
/// iresnet18, 34, 50, 100 or 200.
[[nodiscard]] NamedIresnet iresnet_from_onnx(const OnnxGraph& graph, const std::string& source);

}  // namespace stymo
