#pragma once

#include <filesystem>
#include <string>

#include "core/io/tensor_file.h"

namespace stymo {

struct ImportedWeights {
    TensorFile file;         ///< with the names and the layout that the encoder and LPIPS read
    std::string recognised;  ///< "torchvision vgg16", "insightface iresnet50", "LPIPS heads (vgg)",
                             ///< "foamliu mobilefacenet", ...; empty if the network is not known
};

/// Reads a .safetensors, .onnx or PyTorch .pth file. The format is recognised by content, not by
/// name. Tensors keep their names; the tensors of ONNX are its initializers. Throws FileError.
[[nodiscard]] TensorFile read_weight_file(const std::filesystem::path& path);

/// Recognises published networks by their tensors: torchvision's vgg16, alexnet and squeezenet1_1,
/// LPIPS' linear heads, insightface's iresnets, foamliu's mobilefacenet. Of a known network only
/// the tensors that the encoder and LPIPS read are kept, in PyTorch's layout (out, in, height,
/// width), and wrappers ("state_dict", "module.") are removed from the names. Tensors of other
/// files keep their names.
[[nodiscard]] ImportedWeights recognise_weights(TensorFile file);

/// Reads and recognises a weight file. The tensors of an iresnet in ONNX, as insightface publishes
/// it, get the names of PyTorch. Throws FileError, also for an ONNX network that begins like an
/// iresnet but differs later.
[[nodiscard]] ImportedWeights import_weights(const std::filesystem::path& path);

}  // namespace stymo
