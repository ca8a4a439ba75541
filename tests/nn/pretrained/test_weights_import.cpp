#include <catch2/catch.hpp>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "core/error.h"
#include "core/io/file.h"
#include "core/io/scratch_folder.h"
#include "nn/pretrained/backbones/mobilefacenet.h"
#include "nn/pretrained/weights_import.h"

using namespace stymo;
using Catch::Matchers::Contains;

namespace {

using Tensors = std::map<std::string, Tensor>;
using nlohmann::json;

std::string golden(const std::string& name) {
    return std::string(STYMO_SOURCE_DIR) + "/tests/golden/weights/" + name;
}

const json& published() {
    static const json names = json::parse(read_file(golden("published_names.json")));
    return names;
}

/// The tensors of a network, their values left open.
Tensors network(const std::string& name) {
    Tensors tensors;
    for (const auto& [tensor, extents] : published().at(name).items())
        tensors[tensor] = Tensor(Shape(extents.get<std::vector<std::int64_t>>()));
    return tensors;
}

/// iresnet18 with other numbers of blocks: all but the first of a stage are alike.
Tensors iresnet(const std::vector<int>& blocks) {
    const Tensors smallest = network("iresnet18");
    Tensors tensors = smallest;
    for (std::size_t stage = 0; stage < blocks.size(); ++stage) {
        const std::string layer = "layer" + std::to_string(stage + 1) + ".";
        for (const auto& [name, tensor] : smallest)
            for (int i = 2; name.starts_with(layer + "1.") && i < blocks[stage]; ++i)
                tensors[layer + std::to_string(i) + name.substr(layer.size() + 1)] = tensor;
    }
    return tensors;
}

Tensors prefixed(const Tensors& tensors, const std::string& prefix) {
    Tensors result;
    for (const auto& [name, tensor] : tensors) result[prefix + name] = tensor;
    return result;
}

ImportedWeights recognised(const Tensors& tensors) {
    return recognise_weights({tensors, {{"origin", "elsewhere"}}});
}

Tensors heads(const std::vector<std::int64_t>& channels) {
    Tensors tensors;
    for (std::size_t i = 0; i < channels.size(); ++i)
        tensors["lin" + std::to_string(i) + ".model.1.weight"] =
            Tensor(Shape{1, channels[i], 1, 1});
    return tensors;
}

}  // namespace

TEST_CASE("the published MobileFaceNet is recognised and embeds as from a file in its own names") {
    // As its training writes it: wrapped, and with the counters of the batch norms.
    ParameterStore store;
    Rng rng(3);
    const auto imported = make_backbone("mobilefacenet", store, "imported.", rng);
    const auto direct = make_backbone("mobilefacenet", store, "direct.", rng);
    Tensors names;
    for (const auto& [name, shape] : mobilefacenet_tensors())
        names[name] = name.ends_with("running_var") ? rng.uniform(shape, 0.5, 2.0)
                                                    : rng.normal(shape, 0.0, 0.2);
    Tensors published = names;
    for (const auto& [name, tensor] : names)
        if (name.ends_with("running_mean"))
            published[name.substr(0, name.size() - 12) + "num_batches_tracked"] = Tensor::zeros({});
    CHECK(published.size() == 307);
    const Tensor photo = rng.uniform({1, 64, 64, 3}, -1.0, 1.0);
    direct->load_pretrained({names, {}}, "direct");
    for (const char* wrapper : {"", "module.", "state_dict.module."}) {
        const ImportedWeights weights = recognised(prefixed(published, wrapper));
        CHECK(weights.recognised == "foamliu mobilefacenet");
        CHECK(weights.file.tensors.size() == names.size());
        imported->load_pretrained(weights.file, "imported");
        CHECK((*imported)(Variable(photo)).value().to_vector() ==
              (*direct)(Variable(photo)).value().to_vector());
    }
    // Other programs' MobileFaceNets have PReLU, which is another network.
    const ImportedWeights other = recognised({{"module.conv1.prelu.weight", Tensor({64})},
                                              {"module.conv_6_dw.conv.weight", Tensor({64})}});
    CHECK_THAT(other.recognised, Contains("no backbone here reads"));
    CHECK(other.file.tensors.contains("conv1.prelu.weight"));
}

TEST_CASE("torchvision's networks are recognised and keep their features") {
    const std::vector<std::pair<std::string, std::size_t>> networks = {
        {"vgg16", 26}, {"alexnet", 10}, {"squeezenet1_1", 50}};
    for (const auto& [name, count] : networks) {
        const ImportedWeights weights = recognised(network(name));
        CHECK(weights.recognised == "torchvision " + name);
        CHECK(weights.file.tensors.size() == count);
        CHECK(weights.file.tensors.contains("features.0.weight"));
        CHECK(weights.file.metadata.at("origin") == "elsewhere");
    }
}

TEST_CASE("networks that resemble them are not taken for them") {
    for (const std::string name : {"vgg19", "squeezenet1_0"}) {
        const ImportedWeights weights = recognised(network(name));
        CHECK(weights.recognised.empty());
        CHECK(weights.file.tensors.size() == network(name).size());
    }
    Tensors narrow = network("vgg16");
    narrow["features.28.weight"] = Tensor(Shape{256, 512, 3, 3});
    CHECK(recognised(narrow).recognised.empty());
    CHECK(recognised(iresnet({3, 5, 14, 3})).recognised.empty());
}

TEST_CASE(
    "insightface's networks are recognised by their blocks, and counters of batches dropped") {
    const ImportedWeights smallest = recognised(network("iresnet18"));
    CHECK(smallest.recognised == "insightface iresnet18");
    CHECK(smallest.file.tensors.contains("layer4.0.downsample.1.running_var"));
    for (const auto& [name, tensor] : smallest.file.tensors)
        CHECK_THAT(name, !Contains("num_batches_tracked"));
    for (const auto& [name, tensor] : network("iresnet18"))
        CHECK(smallest.file.tensors.contains(name) ==
              (name.find("num_batches_tracked") == std::string::npos));
    for (const auto& [name, blocks] : published().at("blocks").items())
        CHECK(recognised(iresnet(blocks.get<std::vector<int>>())).recognised ==
              "insightface " + name);
}

TEST_CASE("LPIPS' heads are recognised by their widths and get the name of their network") {
    CHECK(recognised(heads({64, 128, 256, 512, 512})).recognised == "LPIPS heads (vgg)");
    CHECK(recognised(heads({64, 192, 384, 256, 256})).recognised == "LPIPS heads (alex)");
    Tensors whole = heads({64, 128, 256, 384, 384, 512, 512});
    whole["net.slice1.0.weight"] = Tensor(Shape{64, 3, 3, 3});
    whole["lins.0.model.1.weight"] = Tensor(Shape{1, 64, 1, 1});
    const ImportedWeights weights = recognised(whole);
    CHECK(weights.recognised == "LPIPS heads (squeeze)");
    CHECK(weights.file.tensors.size() == 7);
    CHECK(weights.file.tensors.contains("squeeze.lin6.model.1.weight"));
}

TEST_CASE("wrappers are taken off, whether the network is known or not") {
    for (const std::string prefix :
         {"state_dict.", "module.", "model.module.", "net.", "state_dict.model.",
          "state_dict_backbone.", "_orig_mod.module."}) {
        Tensors tensors = prefixed(network("alexnet"), prefix);
        tensors["optimizer.state.0.exp_avg"] = Tensor(Shape{3});
        CHECK(recognised(tensors).recognised == "torchvision alexnet");
    }
    const Tensors unknown = {{"a.weight", Tensor(Shape{2})}, {"b", Tensor(Shape{3})}};
    Tensors checkpoint = prefixed(unknown, "state_dict.module.");
    checkpoint["optimizer.state.0.exp_avg"] = Tensor(Shape{3});
    CHECK(recognised(checkpoint).file.tensors.size() == 2);
    CHECK(recognised(checkpoint).file.tensors.contains("a.weight"));
    checkpoint = prefixed(unknown, "state_dict_backbone.");
    checkpoint["state_dict_softmax_fc.weight"] = Tensor(Shape{3});
    CHECK(recognised(checkpoint).file.tensors.size() == 2);
    CHECK(recognised(prefixed(unknown, "module.")).file.tensors.contains("b"));
    Tensors beside = prefixed(unknown, "net.");
    beside["head.weight"] = Tensor(Shape{1});
    CHECK(recognised(beside).file.tensors.contains("net.b"));
}

TEST_CASE("a safetensors file is not taken for ONNX whatever the length of its header") {
    const ScratchFolder folder;
    for (std::size_t letters = 1; letters < 300; letters += 8) {
        const std::string name(letters, 'w');
        write_tensor_file(folder / std::to_string(letters), {{{name, Tensor::zeros({1})}}, {}});
        CHECK(import_weights(folder / std::to_string(letters)).file.tensors.contains(name));
    }
}

TEST_CASE("the format of a weight file is told by what it holds") {
    CHECK(import_weights(golden("views.pth")).file.tensors.contains("whole"));
    CHECK(read_weight_file(golden("views_legacy.pth")).tensors.contains("state_dict.whole"));
    CHECK(import_weights(golden("small.onnx")).file.tensors.contains("conv.weight"));
    CHECK(import_weights(golden("../onnx/iresnet_folded.onnx"))
              .file.tensors.contains("layer4.1.bn3.running_var"));
    CHECK(import_weights(golden("../safetensors/types.safetensors")).file.tensors.contains("f32"));
    CHECK_THROWS_WITH(import_weights(golden("plain.pkl")),
                      Contains("plain.pkl: not a weight file (neither"));
    CHECK_THROWS_WITH(import_weights(golden("published_names.json")),
                      Contains("not a weight file"));
}
