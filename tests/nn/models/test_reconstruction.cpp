#include <catch2/catch.hpp>

#include "core/autograd/grad.h"
#include "core/ops/ops.h"
#include "nn/losses.h"
#include "nn/models/reconstruction.h"
#include "support/check_close.h"
#include "support/error_message.h"

using namespace stymo;
using namespace stymo::test;

namespace {

ReconstructionConfig config_with(double perceptual_weight) {
    ReconstructionConfig config;
    config.resolution_weights = {0.5, 2.0};
    config.photometric_weight = 3.0;
    config.perceptual_weight = perceptual_weight;
    config.perceptual = {.network = "squeezenet1_1", .trunk = "random", .heads = "random"};
    return config;
}

std::vector<Tensor> random_images(std::uint64_t seed) {
    Rng rng(seed);
    return {rng.uniform({2, 20, 20, 3}, -1.0, 1.0), rng.uniform({2, 40, 40, 3}, -1.0, 1.0)};
}

std::vector<Variable> leaves(const std::vector<Tensor>& tensors) {
    std::vector<Variable> result;
    for (const Tensor& tensor : tensors) result.push_back(Variable::leaf(tensor));
    return result;
}

}  // namespace

TEST_CASE(
    "The reconstruction loss is the weighted sum of the photometric loss and of LPIPS at the "
    "largest image",
    "[reconstruction]") {
    const ReconstructionLoss loss(config_with(0.25));
    const std::vector<Tensor> photos = random_images(1);
    const std::vector<Variable> images = leaves(random_images(2));
    const ReconstructionLoss::Terms terms = loss(images, loss.target(photos));
    const double photometric =
        photometric_loss(images, photos, config_with(0.25).resolution_weights).value().item();
    const Lpips& lpips = *loss.lpips();
    const double perceptual =
        mean(lpips.distance(lpips.features(images.back()), lpips.features(photos.back())))
            .value()
            .item();
    CHECK(terms.photometric.value().item() == Approx(photometric));
    CHECK(terms.perceptual.value().item() == Approx(perceptual));
    CHECK(terms.total.value().item() == Approx(3.0 * photometric + 0.25 * perceptual));
    for (const Variable& gradient : grad(terms.total, images)) CHECK(gradient.value().all_finite());
}

TEST_CASE("In place of unknown pixels both terms see the rendered image, as a constant",
          "[reconstruction][unknown]") {
    const ReconstructionLoss loss(config_with(0.25));
    const std::vector<Tensor> photos = random_images(1);
    const std::vector<Variable> images = leaves(random_images(2));
    Tensor known = Tensor::full({2, 40, 40, 1}, 1.0);
    std::ranges::fill(known.mutable_values<float>().first(40 * 15), 0.0F);
    const ReconstructionLoss::Target target = loss.target(photos, 0, known);
    const ReconstructionLoss::Terms terms = loss(images, target);
    std::vector<Tensor> filled, others;
    for (std::size_t i = 0; i < photos.size(); ++i) {
        filled.push_back(where(target.known[i], photos[i], images[i].detach()).value());
        others.push_back(where(target.known[i], photos[i], Variable(photos[i]) * -0.5).value());
    }
    const ReconstructionLoss::Terms expected = loss(images, loss.target(filled));
    CHECK(identical(terms.total.value(), expected.total.value()));
    CHECK(
        identical(terms.total.value(), loss(images, loss.target(others, 0, known)).total.value()));
    CHECK(identical(terms.total.value(),
                    loss(images, loss.kept_target(photos, known)).total.value()));
    for (std::size_t i = 0; i < images.size(); ++i) {
        const Variable all = grad(expected.total, images[i]);
        const Tensor nothing = Tensor::zeros(all.value().shape());
        CHECK(identical(grad(terms.total, images[i]).value(),
                        where(target.known[i], all, nothing).value()));
    }
    const Tensor photometric = grad(terms.photometric, images.back()).value();
    const Tensor all = grad(loss(images, loss.target(photos)).photometric, images.back()).value();
    for (std::size_t i = 0; i < static_cast<std::size_t>(photometric.size()); ++i)
        REQUIRE(photometric.values<float>()[i] ==
                (i < 3 * 40 * 15 ? 0.0F : all.values<float>()[i]));
}

TEST_CASE(
    "Up to a resolution only the images that reach it count, and LPIPS compares the largest of "
    "them",
    "[reconstruction]") {
    const ReconstructionLoss loss(config_with(0.25));
    const std::vector<Tensor> photos = random_images(1);
    const ReconstructionLoss::Target target = loss.target(photos, 20);
    REQUIRE(target.images.size() == 1);
    CHECK(identical(target.images.front(), photos.front()));
    CHECK(target.features.empty());
    CHECK(loss.target(photos).images.size() == 2);
    CHECK_THROWS_AS(loss(leaves(random_images(2)), target), ShapeError);
}

TEST_CASE(
    "A target that stays the same keeps the features of its largest images, and the loss keeps its "
    "bits",
    "[reconstruction]") {
    const ReconstructionLoss loss(config_with(0.25));
    const std::vector<Tensor> photos = random_images(1);
    const ReconstructionLoss::Target kept = loss.kept_target(photos);
    REQUIRE(static_cast<std::int64_t>(kept.features.size()) == photos.back().shape(0));
    const Lpips::Features expected = loss.lpips()->features(slice(photos.back(), 0, 0, 1));
    for (std::size_t k = 0; k < expected.size(); ++k)
        CHECK(identical(kept.features.front()[k].value(), expected[k].value()));
    const std::vector<Variable> images = leaves(random_images(2));
    CHECK(identical(loss(images, kept).total.value(),
                    loss(images, loss.target(photos)).total.value()));
}

TEST_CASE("LPIPS compares images reduced by means where they are larger than its limit",
          "[reconstruction]") {
    ReconstructionConfig config = config_with(0.25);
    config.perceptual_resolution = 32;
    const ReconstructionLoss loss(config);
    Rng rng(1);
    const std::vector<Tensor> photos{rng.uniform({2, 64, 64, 3}, -1.0, 1.0)};
    const std::vector<Variable> images{Variable::leaf(rng.uniform({2, 64, 64, 3}, -1.0, 1.0))};
    const Lpips& lpips = *loss.lpips();
    const auto halved = [](const Variable& x) { return resize_box(x, 32, 32); };
    const Variable expected =
        mean(lpips.distance(lpips.features(halved(images[0])), lpips.features(halved(photos[0]))));
    for (const ReconstructionLoss::Target& target :
         {loss.target(photos), loss.kept_target(photos)}) {
        const ReconstructionLoss::Terms terms = loss(images, target);
        CHECK(terms.perceptual.value().item() == Approx(expected.value().item()));
        const CloseReport report = check_close(grad(terms.perceptual, images).front().value(),
                                               grad(expected, images).front().value(), 1e-4);
        INFO(report.message);
        CHECK(report.passed);
    }
    config.perceptual_resolution = 64;
    config.perceptual_weight = 0.25;
    const ReconstructionLoss unlimited(config_with(0.25)), limited(config);
    CHECK(identical(unlimited(images, unlimited.target(photos)).total.value(),
                    limited(images, limited.target(photos)).total.value()));
    config.perceptual_resolution = 48;
    CHECK_THAT(error_message<ConfigError>([&] { const ReconstructionLoss no_power(config); }),
               Catch::Contains("reconstruction.perceptual_resolution = 48"));
}

TEST_CASE("Without its weight the perceptual term needs no network", "[reconstruction]") {
    ReconstructionConfig config = config_with(0.0);
    config.perceptual = {};
    const ReconstructionLoss loss(config);
    CHECK(loss.lpips() == nullptr);
    const ReconstructionLoss::Target target = loss.target(random_images(1));
    CHECK(target.features.empty());
    const ReconstructionLoss::Terms terms = loss(leaves(random_images(2)), target);
    CHECK_FALSE(terms.perceptual.defined());
    CHECK(terms.total.value().item() == Approx(3.0 * terms.photometric.value().item()));
    config.perceptual_weight = 0.1;
    CHECK_THAT(error_message<ConfigError>([&] { const ReconstructionLoss without_files(config); }),
               Catch::Contains("reconstruction.perceptual_weight = 0"));
    CHECK_THAT(error_message<ConfigError>(
                   [&] { const ReconstructionLoss of_a_tool(config, "--perceptual-weight 0"); }),
               Catch::Contains("--perceptual-weight 0"));
}
