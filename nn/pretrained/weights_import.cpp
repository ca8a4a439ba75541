#include "nn/pretrained/weights_import.h"

#include <algorithm>
#include <array>
#include <cstdint>
#include <optional>
#include <utility>
#include <vector>

#include "core/error.h"
#include "core/io/file.h"
#include "core/io/onnx_file.h"
#include "core/io/torch_file.h"
#include "nn/pretrained/backbones/iresnet.h"
#include "nn/pretrained/backbones/iresnet_onnx.h"
#include "nn/pretrained/backbones/mobilefacenet.h"
#include "nn/pretrained/perceptual/trunk.h"

namespace stymo {
namespace {

namespace fs = std::filesystem;
using Tensors = std::map<std::string, Tensor>;

/// A published network: the tensors by which it is recognised, and those that are kept.
struct Network {
    std::string title;
    std::map<std::string, Shape> tensors{};
    std::string other_prefix{};    ///< with another tensor of this name the file holds a larger
                                   ///< network of the same kind
    std::string written_prefix{};  ///< put before the names

    void conv(const std::string& name, std::int64_t out, std::int64_t in, std::int64_t kernel) {
        tensors[name + ".weight"] = {out, in, kernel, kernel};
        tensors[name + ".bias"] = {out};
    }
    void batch_norm(const std::string& name, std::int64_t channels) {
        for (const char* part : {".weight", ".bias", ".running_mean", ".running_var"})
            tensors[name + part] = {channels};
    }
};

Network trunk(const TrunkDescription& description) {
    Network network{.title = "torchvision " + description.name, .other_prefix = "features."};
    std::int64_t in = 3;
    for (const TrunkLayer& layer : description.layers) {
        const std::string name = "features." + std::to_string(layer.index);
        if (layer.kind == TrunkLayer::Kind::max_pool) continue;
        if (layer.kind == TrunkLayer::Kind::convolution) {
            network.conv(name, layer.out, in, layer.kernel);
        } else {
            network.conv(name + ".squeeze", layer.squeezed, in, 1);
            network.conv(name + ".expand1x1", layer.out / 2, layer.squeezed, 1);
            network.conv(name + ".expand3x3", layer.out / 2, layer.squeezed, 3);
        }
        in = layer.out;
    }
    return network;
}

Network lpips_heads(const TrunkDescription& description) {
    const std::vector<std::int64_t> channels = tap_channels(description);
    Network network{.title = "LPIPS heads (" + description.heads_name + ")",
                    .other_prefix = "lin" + std::to_string(channels.size()) + ".",
                    .written_prefix = description.heads_name + "."};
    for (std::size_t i = 0; i < channels.size(); ++i)
        network.tensors["lin" + std::to_string(i) + ".model.1.weight"] = {1, channels[i], 1, 1};
    return network;
}

Network iresnet(const IresnetDepth& depth) {
    Network network{.title = std::string("insightface ") + depth.name, .other_prefix = "layer"};
    const auto conv = [&](const std::string& name, std::int64_t out, std::int64_t in,
                          std::int64_t kernel) {
        network.tensors[name + ".weight"] = {out, in, kernel, kernel};
    };
    conv("conv1", 64, 3, 3);
    network.batch_norm("bn1", 64);
    network.tensors["prelu.weight"] = {64};
    std::int64_t in = 64;
    for (std::size_t stage = 0; stage < depth.blocks.size(); ++stage) {
        const std::int64_t out = std::int64_t{64} << stage;
        for (int i = 0; i < depth.blocks[stage]; ++i) {
            const std::string block =
                "layer" + std::to_string(stage + 1) + "." + std::to_string(i) + ".";
            network.batch_norm(block + "bn1", in);
            conv(block + "conv1", out, in, 3);
            network.batch_norm(block + "bn2", out);
            network.tensors[block + "prelu.weight"] = {out};
            conv(block + "conv2", out, out, 3);
            network.batch_norm(block + "bn3", out);
            if (i == 0) {
                conv(block + "downsample.0", out, in, 1);
                network.batch_norm(block + "downsample.1", out);
            }
            in = out;
        }
    }
    constexpr std::int64_t embedding = 512;
    network.batch_norm("bn2", in);
    network.tensors["fc.weight"] = {embedding, in * 7 * 7};
    network.tensors["fc.bias"] = {embedding};
    network.batch_norm("features", embedding);
    return network;
}

std::vector<Network> described_networks() {
    std::vector<Network> networks;
    for (const TrunkDescription& description : trunk_descriptions()) {
        networks.push_back(trunk(description));
        networks.push_back(lpips_heads(description));
    }
    for (const IresnetDepth& depth : iresnet_depths) networks.push_back(iresnet(depth));
    networks.push_back({.title = "foamliu mobilefacenet",
                        .tensors = mobilefacenet_tensors(),
                        .other_prefix = "features."});
    return networks;
}

/// Described once: for the names of foamliu's the network is built.
const std::vector<Network>& published_networks() {
    static const std::vector<Network> networks = described_networks();
    return networks;
}

bool fits(const Network& network, const Tensors& tensors) {
    const bool complete = std::ranges::all_of(network.tensors, [&](const auto& expected) {
        const auto found = tensors.find(expected.first);
        return found != tensors.end() && found->second.shape() == expected.second;
    });
    return complete && std::ranges::none_of(tensors, [&](const auto& item) {
               const std::string& name = item.first;
               return name.starts_with(network.other_prefix) && name.ends_with(".weight") &&
                      !network.tensors.contains(name);
           });
}

/// The tensors whose names begin with `prefix`, without it.
Tensors below(const Tensors& tensors, const std::string& prefix) {
    Tensors result;
    for (auto item = tensors.lower_bound(prefix);
         item != tensors.end() && item->first.starts_with(prefix); ++item)
        if (item->first.size() > prefix.size())
            result.emplace(item->first.substr(prefix.size()), item->second);
    return result;
}

/// Prefixes that training programs add to a network's names.
constexpr std::array<const char*, 7> wrappers{
    "state_dict.",          "module.",   "model.", "net.", "model_state_dict.",
    "state_dict_backbone.", "_orig_mod."};
constexpr int deepest_wrapper = 4;

/// The published network in a file, which may also have prefixes and other tensors.
std::optional<ImportedWeights> recognised(const Tensors& tensors,
                                          const std::vector<Network>& networks, int depth = 0) {
    for (const Network& network : networks) {
        if (!fits(network, tensors)) continue;
        ImportedWeights result{.file = {}, .recognised = network.title};
        for (const auto& [name, shape] : network.tensors)
            result.file.tensors[network.written_prefix + name] = tensors.at(name);
        return result;
    }
    if (depth == deepest_wrapper) return std::nullopt;
    for (const char* wrapper : wrappers) {
        const Tensors wrapped = below(tensors, wrapper);
        if (wrapped.empty()) continue;
        if (auto result = recognised(wrapped, networks, depth + 1)) return result;
    }
    return std::nullopt;
}

/// Removes prefixes that all tensors share. Those of a state dict are removed even if there are
/// other tensors, which belong to the optimiser or to a classifier.
Tensors unwrapped(Tensors tensors) {
    for (int depth = 0; depth < deepest_wrapper; ++depth) {
        for (const char* wrapper : wrappers) {
            Tensors wrapped = below(tensors, wrapper);
            const bool takes_part =
                std::string_view(wrapper).find("state_dict") != std::string_view::npos;
            if (!wrapped.empty() && (takes_part || wrapped.size() == tensors.size()))
                tensors = std::move(wrapped);
        }
    }
    return tensors;
}

bool is_tensor_file(std::string_view beginning) {
    // A .safetensors file begins with the length of its JSON header (8 bytes).
    constexpr std::size_t header = 8;
    return beginning.size() > header && beginning[header] == '{';
}

bool is_onnx_file(std::string_view beginning) {
    // ONNX begins with the field ir_version, a number with the tag 1. The header length of a
    // .safetensors file may begin with the same byte.
    return beginning.starts_with('\x08') && !is_tensor_file(beginning);
}

}  // namespace

TensorFile read_weight_file(const fs::path& path) {
    const std::string beginning = read_beginning(path, torch_file_beginning);
    if (is_torch_file(beginning)) return read_torch_file(path);
    if (is_tensor_file(beginning)) return read_tensor_file(path);
    if (is_onnx_file(beginning)) return {read_onnx_file(path).tensors, {}};
    fail<FileError>(path.string(), ": not a weight file (",
                    beginning.empty() ? "zero bytes" : "neither safetensors, ONNX nor PyTorch",
                    ")");
}

ImportedWeights recognise_weights(TensorFile file) {
    if (auto result = recognised(file.tensors, published_networks())) {
        result->file.metadata = std::move(file.metadata);
        return *std::move(result);
    }
    file.tensors = unwrapped(std::move(file.tensors));
    std::string title;
    if (file.tensors.contains("conv1.prelu.weight") &&
        (file.tensors.contains("conv_6_dw.conv.weight") ||
         file.tensors.contains("linear7.conv.weight")))
        title = "a MobileFaceNet with PReLU, which no backbone here reads, names as they were";
    return {.file = std::move(file), .recognised = std::move(title)};
}

ImportedWeights import_weights(const fs::path& path) {
    if (!is_onnx_file(read_beginning(path, torch_file_beginning)))
        return recognise_weights(read_weight_file(path));
    const OnnxGraph graph = read_onnx_file(path);
    return recognise_weights(begins_like_iresnet(graph)
                                 ? iresnet_from_onnx(graph, path.string()).file
                                 : TensorFile{graph.tensors, {}});
}

}  // namespace stymo
