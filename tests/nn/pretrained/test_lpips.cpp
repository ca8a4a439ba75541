#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <iostream>
#include <map>
#include <nlohmann/json.hpp>

#include "core/autograd/grad.h"
#include "core/io/file.h"
#include "core/io/image.h"
#include "core/io/scratch_folder.h"
#include "core/io/tensor_file.h"
#include "core/ops/ops.h"
#include "nn/pretrained/perceptual/lpips.h"
#include "nn/pretrained/perceptual/trunk.h"
#include "shared_data.h"
#include "support/check_close.h"
#include "support/check_grad.h"
#include "support/error_message.h"

using namespace stymo;
using namespace stymo::test;
namespace fs = std::filesystem;

namespace {

constexpr const char* off_switch = "loss.weight = 0";

Lpips random_lpips(const std::string& network) {
    return {{.network = network, .trunk = "random", .heads = "random"}, off_switch};
}

/// The same, made once for all tests that only read it.
const Lpips& shared_lpips(const std::string& network) {
    static std::map<std::string, Lpips> made;
    const auto found = made.find(network);
    return found != made.end() ? found->second
                               : made.emplace(network, random_lpips(network)).first->second;
}

/// Numbers in [low, high) as tests/golden/make_lpips_vectors.py makes them: a finaliser of the
/// index.
Tensor formula(std::uint32_t stream, const Shape& shape, double low, double high) {
    Tensor result(shape, DType::float64);
    std::uint32_t index = stream << 24U;
    for (double& value : result.mutable_values<double>()) {
        std::uint32_t x = index++;
        x = (x ^ (x >> 16U)) * 0x85EBCA6BU;
        x = (x ^ (x >> 13U)) * 0xC2B2AE35U;
        x ^= x >> 16U;
        value = low + (high - low) * std::ldexp(static_cast<double>(x), -32);
    }
    return result;
}

/// In PyTorch's order of elements.
Tensor formula_weight(std::uint32_t stream, const Shape& shape, bool head) {
    if (head) return formula(stream, shape, 0.0, 1.0);
    if (shape.rank() != 4) return formula(stream, shape, -0.1, 0.1);
    const double bound = std::sqrt(6.0 / static_cast<double>(shape.product(1, 4)));
    const Tensor published =
        formula(stream, {shape[0], shape[3], shape[1], shape[2]}, -bound, bound);
    return permute(published, {0, 2, 3, 1}).value();
}

Lpips formula_lpips(const std::string& network) {
    Lpips lpips = random_lpips(network);
    std::uint32_t stream = 0;
    lpips.parameters().convert(DType::float64);
    for (const Parameter& parameter : lpips.parameters().all())
        parameter.set_value(formula_weight(stream++, parameter.variable().shape(),
                                           parameter.name().starts_with("lpips.heads.")));
    return lpips;
}

void compare_with_pytorch(const Lpips& lpips, DType dtype, double tolerance) {
    const std::string& network = lpips.config().network;
    INFO(network << ", " << dtype);
    const TensorFile file =
        read_tensor_file(STYMO_SOURCE_DIR "/tests/golden/lpips_vectors.safetensors");
    const Tensor& dL_da = file.tensors.at(network + ".dL_da");
    const Tensor& expected = file.tensors.at(network + ".terms");
    const Variable a = Variable::leaf(formula(254, dL_da.shape(), -1.0, 1.0).to(dtype));
    const Variable b(formula(255, dL_da.shape(), -1.0, 1.0).to(dtype));
    const Lpips::Features features = lpips.features(a);
    const Lpips::Features target = lpips.features(b);
    const std::vector<Variable> terms = lpips.terms(features, target);
    REQUIRE(static_cast<std::int64_t>(terms.size()) == expected.shape(0));
    for (std::size_t k = 0; k < terms.size(); ++k) {
        const auto row = static_cast<std::int64_t>(k);
        const CloseReport report = check_close(
            terms[k].value(),
            slice(expected, 0, row, row + 1).value().reshaped({expected.shape(1)}), tolerance);
        INFO("term " << k << ": " << report.message);
        CHECK(report.passed);
    }
    const CloseReport report =
        check_close(grad(sum(lpips.distance(features, target)), a).value(), dL_da, tolerance);
    INFO(report.message);
    CHECK(report.passed);
}

Tensor image_batch(const fs::path& path) {
    const Tensor image = read_image(path);
    return affine(image.reshaped({1, image.shape(0), image.shape(1), 3}), 2.0, -1.0).value();
}

}  // namespace

TEST_CASE("LPIPS and its gradient agree with PyTorch for every trunk", "[lpips][torch]") {
    for (const std::string& network : lpips_networks()) {
        Lpips lpips = formula_lpips(network);
        compare_with_pytorch(lpips, DType::float64, 1e-8);
        lpips.parameters().convert(DType::float32);
        compare_with_pytorch(lpips, DType::float32, 1e-4);
    }
}

TEST_CASE("The multiply-adds of a trunk are the published ones of its convolutions", "[lpips]") {
    CHECK(trunk_multiply_adds("vgg16", 224) == 15'346'630'656);
    CHECK(trunk_multiply_adds("alexnet", 224) == 655'566'528);
}

TEST_CASE("LPIPS with the published SqueezeNet and heads gives the published numbers", "[lpips]") {
    const auto folder = shared_data();
    if (!folder) return;
    const fs::path shared = *folder;
    const fs::path trunk = shared / "weights/squeezenet1_1.safetensors";
    const Lpips lpips({.network = "squeezenet1_1",
                       .trunk = trunk.string(),
                       .heads = (shared / "weights/lpips_heads_v0.1.safetensors").string()},
                      off_switch);
    CHECK_FALSE(lpips.random());
    CHECK(lpips.label() == "squeezenet1_1");
    const nlohmann::json reference =
        nlohmann::json::parse(read_file(shared / "data/reference.json"))["lpips_squeeze"];
    const Lpips::Features target =
        lpips.features(image_batch(shared / "data/lpips_example/ex_ref.png"));
    for (const auto& [name, total] : {std::pair{"ex_p0", 0.711211}, std::pair{"ex_p1", 0.147935}}) {
        const Lpips::Features features = lpips.features(
            image_batch(shared / "data/lpips_example" / (std::string(name) + ".png")));
        const std::vector<double> expected =
            reference[std::string("ex_ref/") + name].get<std::vector<double>>();
        const std::vector<Variable> terms = lpips.terms(target, features);
        REQUIRE(terms.size() == expected.size());
        for (std::size_t k = 0; k < terms.size(); ++k)
            CHECK(terms[k].value().item() == Approx(expected[k]).margin(1e-6));
        CHECK(lpips.distance(target, features).value().item() == Approx(total).margin(1e-6));
    }
}

TEST_CASE("Equal images are at distance 0, whatever they show, and the gradient is finite",
          "[lpips]") {
    for (const std::string& network : lpips_networks()) {
        const Lpips& lpips = shared_lpips(network);
        const Shape shape{1, 33, 33, 3};
        for (const Tensor& image : {Tensor::full(shape, -1.0), Tensor::full(shape, 1.0),
                                    Rng(3).uniform(shape, -1.0, 1.0)}) {
            INFO(network);
            const Variable x = Variable::leaf(image);
            const Variable distance =
                lpips.distance(lpips.features(x), lpips.features(Variable(image)));
            CHECK(distance.value().item() == 0.0);
            CHECK(grad(distance, x).value().all_finite());
        }
    }
}

TEST_CASE("Where no channel answers, the feature is 0 and the gradient is finite", "[lpips]") {
    Lpips lpips = random_lpips("alexnet");
    const Shape shape{1, 31, 31, 3};
    const Lpips::Features target = lpips.features(Rng(4).uniform(shape, -1.0, 1.0));
    // Biases far below 0 silence every channel of the first layer, and with biases of 0 all that
    // follow.
    for (const Parameter& parameter : lpips.parameters().all())
        if (parameter.name() == "lpips.trunk.features.0.bias")
            parameter.set_value(Tensor::full({64}, -1e3));
    const Variable x = Variable::leaf(Rng(5).uniform(shape, -1.0, 1.0));
    const Lpips::Features features = lpips.features(x);
    for (const Variable& feature : features) CHECK(sum(abs(feature)).value().item() == 0.0);
    const Variable distance = lpips.distance(features, target);
    // Normalised target features against nothing, with heads of 1: each term is 1 where the target
    // answers.
    CHECK(distance.value().item() == Approx(5.0).epsilon(0.1));
    CHECK(grad(distance, x).value().all_finite());
}

TEST_CASE("A target's features that were kept give the same bits as those computed again",
          "[lpips]") {
    const Lpips& lpips = shared_lpips("squeezenet1_1");
    const Tensor target = Rng(6).uniform({2, 32, 32, 3}, -1.0, 1.0);
    const Lpips::Features kept = lpips.features(target);
    for (const Variable& feature : kept) CHECK_FALSE(feature.tracked());
    for (const std::uint64_t seed : {7U, 8U}) {
        const Variable x = Variable::leaf(Rng(seed).uniform(target.shape(), -1.0, 1.0));
        const Variable with_kept = lpips.distance(lpips.features(x), kept);
        const Variable with_new = lpips.distance(lpips.features(x), lpips.features(target));
        CHECK(identical(with_kept.value(), with_new.value()));
        CHECK(identical(grad(sum(with_kept), x).value(), grad(sum(with_new), x).value()));
    }
}

TEST_CASE(
    "The distance to a constant target is that between features, with its gradient, also where no "
    "channel answers",
    "[lpips]") {
    for (const bool silent : {false, true}) {
        Lpips lpips = random_lpips("alexnet");
        lpips.parameters().convert(DType::float64);
        const Shape shape{2, 31, 31, 3};
        const Lpips::Features target =
            lpips.features(Rng(4).uniform(shape, -1.0, 1.0, DType::float64));
        for (const Parameter& parameter : lpips.parameters().all()) {
            if (silent && parameter.name() == "lpips.trunk.features.0.bias")
                parameter.set_value(Tensor::full({64}, -1e3, DType::float64));
        }
        const Variable x = Variable::leaf(Rng(5).uniform(shape, -1.0, 1.0, DType::float64));
        const Variable fused = lpips.distance_to(x, target),
                       composed = lpips.distance(lpips.features(x), target);
        CHECK(check_close(fused.value(), composed.value(), 1e-12).passed);
        CHECK(
            check_close(grad(sum(fused), x).value(), grad(sum(composed), x).value(), 1e-10).passed);
    }
}

TEST_CASE("Images of a batch do not see each other", "[lpips]") {
    const Lpips& lpips = shared_lpips("squeezenet1_1");
    const Variable a(Rng(1).uniform({3, 32, 32, 3}, -1.0, 1.0)),
        b(Rng(2).uniform({3, 32, 32, 3}, -1.0, 1.0));
    const Tensor together = lpips.distance(lpips.features(a), lpips.features(b)).value();
    for (std::int64_t i = 0; i < 3; ++i) {
        const Tensor alone = lpips
                                 .distance(lpips.features(slice(a, 0, i, i + 1)),
                                           lpips.features(slice(b, 0, i, i + 1)))
                                 .value();
        CHECK(together.to_vector()[static_cast<std::size_t>(i)] ==
              Approx(alone.item()).epsilon(1e-5));
    }
}

TEST_CASE("No gradient of LPIPS goes to its weights", "[lpips]") {
    Lpips lpips = random_lpips("vgg16");
    CHECK(lpips.parameters().trainable().empty());
    CHECK(lpips.parameters().element_count("lpips.trunk.") == 14714688);
    CHECK(lpips.parameters().element_count("lpips.heads.") == 1472);
}

TEST_CASE("An image that is too small for the network is refused by its size", "[lpips]") {
    for (const auto& [network, side] :
         {std::pair{"vgg16", 16}, std::pair{"alexnet", 31}, std::pair{"squeezenet1_1", 17}}) {
        const Lpips& lpips = shared_lpips(network);
        INFO(network);
        CHECK(lpips.smallest_side() == side);
        CHECK(lpips.features(Tensor::zeros({1, side, side, 3})).back().shape(1) == 1);
        const std::string message = error_message<ShapeError>([&, side = side] {
            static_cast<void>(lpips.features(Tensor::zeros({1, side - 1, side, 3})));
        });
        CHECK(is_one_line(message));
        CHECK_THAT(message, Catch::Contains(network) && Catch::Contains(std::to_string(side)));
    }
    CHECK_THROWS_AS(shared_lpips("vgg16").features(Tensor::zeros({1, 32, 32, 1})), ShapeError);
}

TEST_CASE("A missing file of LPIPS is told by where to get it and how to do without", "[lpips]") {
    const auto refusal = [](const LpipsConfig& config) {
        std::string message = error_message<Error>([&] { const Lpips lpips(config, off_switch); });
        CHECK(is_one_line(message));
        CHECK_THAT(message, Catch::Contains(off_switch));
        return message;
    };
    CHECK_THAT(refusal({}),
               Catch::Contains("vgg16-397923af.pth") && Catch::Contains("stymo-weights import"));
    CHECK_THAT(refusal({.network = "alexnet"}), Catch::Contains("alexnet-owt-7be5be79.pth"));
    CHECK_THAT(refusal({.network = "squeezenet1_1", .trunk = "random"}),
               Catch::Contains("squeeze.pth"));
    CHECK_THAT(refusal({.trunk = "gone.safetensors", .heads = "random"}),
               Catch::Contains("gone.safetensors") && Catch::Contains("--lpips-trunk"));
    CHECK_THAT(error_message<Error>([] {
                   const Lpips lpips({.trunk = "gone.safetensors", .heads = "random"},
                                     "reconstruction.perceptual_weight = 0");
               }),
               !Catch::Contains("--"));
    CHECK_THAT(
        error_message<ConfigError>([] { const Lpips lpips({.network = "resnet"}, off_switch); }),
        Catch::Contains("resnet") && Catch::Contains("squeezenet1_1"));
}

TEST_CASE(
    "Weights are read under the published names, and a wrong file is told by its first wrong "
    "tensor",
    "[lpips]") {
    const ScratchFolder folder;
    Lpips lpips = random_lpips("alexnet");
    TensorFile trunk;
    TensorFile heads;
    for (const Parameter& parameter : lpips.parameters().all()) {
        const Tensor& value = parameter.variable().value();
        if (parameter.name().starts_with("lpips.heads.")) {
            heads.tensors[parameter.name().substr(12) + ".model.1.weight"] =
                value.reshaped({1, value.size(), 1, 1});
        } else {
            trunk.tensors[parameter.name().substr(12)] =
                value.rank() == 4 ? permute(value, {0, 3, 1, 2}).value() : value;
        }
    }
    const std::string trunk_path = (folder / "trunk.safetensors").string();
    const std::string heads_path = (folder / "heads.safetensors").string();
    const auto read = [&] {
        return Lpips({.network = "alexnet", .trunk = trunk_path, .heads = heads_path}, off_switch);
    };
    const auto refusal = [&] {
        return error_message<FileError>([&] { static_cast<void>(read()); });
    };
    write_tensor_file(trunk_path, trunk);
    write_tensor_file(heads_path, heads);
    Lpips again = read();
    for (std::size_t i = 0; i < lpips.parameters().all().size(); ++i)
        CHECK(identical(again.parameters().all()[i].variable().value(),
                        lpips.parameters().all()[i].variable().value()));

    heads.tensors["lin3.model.1.weight"] = Tensor::zeros({1, 512, 1, 1});
    write_tensor_file(heads_path, heads);
    CHECK_THAT(refusal(),
               Catch::Contains("heads.safetensors") && Catch::Contains("lin3.model.1.weight"));
    trunk.tensors.erase("features.6.bias");
    write_tensor_file(trunk_path, trunk);
    CHECK_THAT(refusal(),
               Catch::Contains("trunk.safetensors") && Catch::Contains("features.6.bias"));
}

TEST_CASE("Random weights are always the same ones, and a report says what they are", "[lpips]") {
    Lpips one = random_lpips("squeezenet1_1");
    Lpips two = random_lpips("squeezenet1_1");
    CHECK(one.random());
    CHECK(one.label() == "squeezenet1_1, random weights");
    for (std::size_t i = 0; i < one.parameters().all().size(); ++i)
        CHECK(identical(one.parameters().all()[i].variable().value(),
                        two.parameters().all()[i].variable().value()));
}
