#pragma once

#include <filesystem>
#include <string>

#include "core/io/tensor_file.h"

namespace stymo {

struct ImportedWeights {
    TensorFile file;         ///< in the names and layout that the encoder and LPIPS read
    std::string recognised;  ///< "torchvision vgg16", "insightface iresnet50", "LPIPS heads (vgg)",
                             ///< "foamliu mobilefacenet", ...; empty: names as they were
};

/// Reads .safetensors, .onnx or PyTorch's .pth by what the file holds, not by its name. Tensors are
/// called as in the file; those of ONNX are its initializers. Throws FileError.
[[nodiscard]] TensorFile read_weight_file(const std::filesystem::path& path);

/// Recognises published networks by their tensors: torchvision's vgg16, alexnet and squeezenet1_1,
/// LPIPS' linear heads, insightface's iresnets, foamliu's mobilefacenet. Of these the tensors that
/// the encoder and LPIPS read are kept, in PyTorch's layout (out, in, height, width). Wrappers
/// ("state_dict", "module.") are removed. Other files keep their names.
[[nodiscard]] ImportedWeights recognise_weights(TensorFile file);

/// recognise_weights of read_weight_file; an iresnet in ONNX, as insightface ships it, gets the
/// names that it has in PyTorch. Throws FileError, also for an ONNX network that begins like an
/// iresnet and goes on otherwise.
[[nodiscard]] ImportedWeights import_weights(const std::filesystem::path& path);

}  // namespace stymo
