#pragma once

#include <filesystem>
#include <string>

#include "core/io/tensor_file.h"

namespace stymo {

struct ImportedWeights {
    TensorFile file;  ///< in the names and layout that the encoder and LPIPS read
    std::string
        recognised;  ///< "torchvision vgg16", "insightface iresnet50", "LPIPS heads (vgg)", ...; empty: names as they were
};

/// Reads .safetensors, .onnx or PyTorch's .pth by what the file holds, not by its name, and recognises published networks by
/// their tensors: torchvision's vgg16, alexnet and squeezenet1_1, LPIPS' linear heads, insightface's iresnets (also as ONNX with
/// batch norms folded into convolutions). Wrappers ("state_dict", "module.") are removed. Other files keep their names.
/// Throws FileError.
[[nodiscard]] ImportedWeights import_weights(const std::filesystem::path& path);

}  // namespace stymo
