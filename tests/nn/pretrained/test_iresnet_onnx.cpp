#include <algorithm>
#include <catch2/catch.hpp>
#include <filesystem>
#include <string>
#include <utility>
#include <vector>

#include "core/error.h"
#include "core/ops/shape_ops.h"
#include "nn/pretrained/backbones/iresnet.h"
#include "nn/pretrained/backbones/iresnet_onnx.h"
#include "support/check_close.h"
#include "support/error_message.h"

namespace iresnet_onnx_tests {

using namespace stymo;
using namespace stymo::test;

// The same tiny network in PyTorch's file and in ONNX: tests/golden/make_iresnet_vectors.py.
namespace {

std::filesystem::path golden() {
    return std::filesystem::path(STYMO_SOURCE_DIR) / "tests/golden";
}

OnnxGraph folded() {
    return read_onnx_file(golden() / "onnx/iresnet_folded.onnx");
}

Tensor embedding(const TensorFile& weights, const Tensor& image) {
    ParameterStore store;
    Rng rng(1);
    const auto backbone = make_iresnet(
        {.blocks = {2, 2, 2, 2}, .widths = {4, 6, 8, 10}, .input_side = 32, .embedding_size = 12},
        store, "backbone.", rng);
    backbone->load_pretrained(weights, "weights");
    return (*backbone)(Variable(image)).value();
}

/// Index of the n-th node with this operation.
std::size_t index_of(const OnnxGraph& graph, const std::string& operation, int n) {
    for (std::size_t i = 0; i < graph.nodes.size(); ++i) {
        if (graph.nodes[i].operation == operation && n-- == 0) return i;
    }
    throw std::runtime_error("no such node");
}

OnnxNode node(std::string operation, std::vector<std::string> inputs = {},
              std::vector<std::string> outputs = {}) {
    return {std::move(operation), "", std::move(inputs), std::move(outputs), {}, {}};
}

std::string refusal(const OnnxGraph& graph) {
    return error_message<FileError>([&] { static_cast<void>(iresnet_from_onnx(graph, "a.onnx")); });
}

}  // namespace

TEST_CASE(
    "an iresnet in ONNX, with batch norms folded into convolutions or not, gives the embedding of "
    "PyTorch") {
    const TensorFile vectors = read_tensor_file(golden() / "iresnet_vectors.safetensors");
    const Tensor image = vectors.tensors.at("vectors.x").to(DType::float32);
    for (const char* form : {"folded", "unfolded"}) {
        INFO(form);
        const NamedIresnet network = iresnet_from_onnx(
            read_onnx_file(golden() / ("onnx/iresnet_" + std::string(form) + ".onnx")), form);
        CHECK(network.name == "iresnet18");
        const CloseReport report =
            check_close(embedding(network.file, image),
                        vectors.tensors.at("vectors.y").to(DType::float32), 1e-5);
        INFO(report.message);
        CHECK(report.passed);
        for (const auto& [name, tensor] : network.file.tensors) {
            INFO(name);
            CHECK(tensor.shape() == vectors.tensors.at(name).shape());
        }
    }
}

TEST_CASE("tensors of an unfolded ONNX iresnet come through as they are in PyTorch's file") {
    const TensorFile vectors = read_tensor_file(golden() / "iresnet_vectors.safetensors");
    const NamedIresnet network =
        iresnet_from_onnx(read_onnx_file(golden() / "onnx/iresnet_unfolded.onnx"), "a.onnx");
    for (const auto& [name, tensor] : network.file.tensors) {
        INFO(name);
        CHECK(check_close(tensor, vectors.tensors.at(name), 1e-7).passed);
    }
}

TEST_CASE("names within the ONNX file and second names for the same constant do not matter") {
    OnnxGraph graph = folded();
    const auto expected = iresnet_from_onnx(graph, "a.onnx").file.tensors;
    OnnxNode& norm = graph.nodes.at(index_of(graph, "BatchNormalization", 0));
    graph.tensors["1234"] = graph.tensors.at(norm.inputs[1]);
    graph.tensors.erase(norm.inputs[1]);
    norm.inputs[1] = "5678";
    graph.nodes.insert(graph.nodes.begin(), node("Identity", {"1234"}, {"5678"}));
    const auto actual = iresnet_from_onnx(graph, "a.onnx").file.tensors;
    REQUIRE(actual.size() == expected.size());
    for (const auto& [name, tensor] : expected) CHECK(identical(actual.at(name), tensor));
}

TEST_CASE(
    "a fully connected layer that is stored the other way round, and another epsilon, mean the "
    "same network") {
    OnnxGraph graph = folded();
    const Tensor image = Rng(2).uniform({1, 32, 32, 3}, -1.0, 1.0);
    const Tensor expected = embedding(iresnet_from_onnx(graph, "a.onnx").file, image);
    OnnxNode& gemm = graph.nodes.at(index_of(graph, "Gemm", 0));
    gemm.numbers.erase("transB");
    Tensor& weight = graph.tensors.at(gemm.inputs[1]);
    weight = transpose(weight).value();
    OnnxNode& norm = graph.nodes.at(index_of(graph, "BatchNormalization", 1));
    norm.numbers["epsilon"] = 1e-3;
    for (float& variance : graph.tensors.at(norm.inputs[4]).mutable_values<float>())
        variance += 1e-5F - 1e-3F;
    const CloseReport report =
        check_close(embedding(iresnet_from_onnx(graph, "a.onnx").file, image), expected, 1e-6);
    INFO(report.message);
    CHECK(report.passed);
}

TEST_CASE(
    "an ONNX network that is no iresnet is refused in one line by the first operation that "
    "differs") {
    OnnxGraph other = folded();
    other.nodes.at(index_of(other, "PRelu", 1)).operation = "Relu";
    CHECK_THAT(refusal(other), Catch::StartsWith("a.onnx: ") && Catch::Contains("Relu") &&
                                   Catch::Contains("PRelu"));
    CHECK(is_one_line(refusal(other)));

    CHECK_THAT(refusal({}), Catch::Contains("the end") && Catch::Contains("Conv"));

    OnnxGraph longer = folded();
    longer.nodes.push_back(node("Softmax"));
    CHECK_THAT(refusal(longer), Catch::Contains("Softmax"));

    OnnxGraph computed = folded();
    computed.nodes.at(index_of(computed, "Gemm", 0)).inputs[1] = "elsewhere";
    CHECK_THAT(refusal(computed), Catch::Contains("Gemm") && Catch::Contains("not a constant"));

    CHECK(begins_like_iresnet(folded()));
    CHECK(begins_like_iresnet(other));
    CHECK_FALSE(begins_like_iresnet({}));

    // Without its second block, the third stage has one.
    OnnxGraph shallow = folded();
    const auto first_of = [&](int add) {
        return shallow.nodes.begin() + static_cast<std::ptrdiff_t>(index_of(shallow, "Add", add)) +
               1;
    };
    shallow.nodes.erase(first_of(4), first_of(5));
    CHECK_THAT(refusal(shallow), Catch::Contains("2, 2, 1, 2") && Catch::Contains("iresnet"));
}

}  // namespace iresnet_onnx_tests
