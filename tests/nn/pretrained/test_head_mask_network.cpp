#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>

#include "core/autograd/grad.h"
#include "core/error.h"
#include "core/io/image.h"
#include "core/io/scratch_folder.h"
#include "core/io/tensor_file.h"
#include "nn/optim/adam.h"
#include "nn/pretrained/head_mask_network.h"

using namespace stymo;
using Catch::Matchers::Contains;

namespace head_mask_network_tests {

Tensor random_images(std::int64_t count, std::int64_t side) {
    Rng rng(3);
    return rng.uniform({count, side, side, 3}, 0.0, 1.0);
}

TEST_CASE("The head-mask network has 0.66 million parameters and answers for each pixel") {
    const HeadMaskModel model = make_head_mask_model(Rng(1));
    CHECK(model.store->element_count() == 656'256);
    CHECK(model.network(random_images(2, 64)).shape() == Shape{2, 64, 64, 1});
    CHECK_THROWS_AS(model.network(random_images(1, 48)), ShapeError);
}

TEST_CASE("The loss of head masks is a mean over the known pixels, with the right gradient") {
    Rng rng(5);
    const Shape shape{2, 3, 3, 1};
    const Tensor logit = rng.normal(shape, 0.0, 2.0, DType::float64);
    const Tensor mask = rng.uniform(shape, 0.0, 1.0, DType::float64);
    Tensor known = Tensor::full(shape, 1.0, DType::float64);
    known.mutable_values<double>()[4] = 0.0;
    double sum = 0.0;
    for (std::size_t i = 0; i < 18; ++i) {
        const double p = 1.0 / (1.0 + std::exp(-logit.values<double>()[i]));
        const double t = mask.values<double>()[i];
        if (i != 4) sum -= t * std::log(p) + (1.0 - t) * std::log(1.0 - p);
    }
    CHECK(known_mask_loss(logit, mask, known).value().item() == Approx(sum / 17.0).epsilon(1e-6));
    const Variable x = Variable::leaf(logit);
    const Tensor slope = grad(known_mask_loss(x, mask, known), x).value();
    for (std::size_t i = 0; i < 18; ++i) {
        constexpr double step = 1e-5;
        Tensor more = logit, less = logit;
        more.mutable_values<double>()[i] += step;
        less.mutable_values<double>()[i] -= step;
        const double change = known_mask_loss(more, mask, known).value().item() -
                              known_mask_loss(less, mask, known).value().item();
        CHECK(slope.values<double>()[i] == Approx(change / (2.0 * step)).margin(1e-8));
    }
    CHECK(known_mask_loss(logit, mask, Tensor::zeros(shape, DType::float64)).value().item() == 0.0);
}

TEST_CASE("The head-mask network learns four images by heart") {
    const HeadMaskModel model = make_head_mask_model(Rng(1));
    const std::vector<Parameter> parameters = model.store->trainable();
    const Tensor images = random_images(4, 32);
    // The mask of each image is a disc of another size.
    Tensor masks({4, 32, 32, 1});
    for (int i = 0; i < 4 * 32 * 32; ++i) {
        const double x = i % 32 - 16.0, y = i / 32 % 32 - 16.0;
        masks.mutable_values<float>()[static_cast<std::size_t>(i)] =
            std::hypot(x, y) < 5.0 + 2.0 * (i / 1024) ? 1.0F : 0.0F;
    }
    const Tensor known = Tensor::full(masks.shape(), 1.0);
    Adam adam;
    double loss = 0.0;
    for (int step = 0; step < 150; ++step) {
        const Variable value = known_mask_loss(model.network(images), masks, known);
        adam.step(parameters, grad(value, variables_of(parameters)), 2e-3);
        loss = value.value().item();
    }
    CHECK(loss < 0.02);
}

TEST_CASE("A head-mask network is the same after writing and reading, but for 16 bits") {
    const ScratchFolder folder;
    const HeadMaskModel model = make_head_mask_model(Rng(1));
    write_head_mask_model(folder / "a.safetensors", model);
    CHECK(std::filesystem::file_size(folder / "a.safetensors") < 1'500'000);
    const HeadMaskModel read = read_head_mask_model(folder / "a.safetensors");
    CHECK(read.store->trainable().empty());
    const Tensor images = random_images(1, 32);
    const std::vector<double> before = model.network(images).value().to_vector();
    const std::vector<double> after = read.network(images).value().to_vector();
    for (std::size_t i = 0; i < before.size(); ++i)
        CHECK(after[i] == Approx(before[i]).margin(0.01));

    TensorFile other = read_tensor_file(folder / "a.safetensors");
    other.metadata["format"] = "stymo head-mask network 2";
    write_tensor_file(folder / "b.safetensors", other);
    CHECK_THROWS_WITH(read_head_mask_model(folder / "b.safetensors"),
                      Contains("is a \"stymo head-mask network 2\""));
    other.metadata["format"] = "something else";
    write_tensor_file(folder / "c.safetensors", other);
    CHECK_THROWS_WITH(read_head_mask_model(folder / "c.safetensors"),
                      Contains("not a head-mask network of stymo"));
    std::filesystem::resize_file(folder / "a.safetensors", 100'000);
    CHECK_THROWS_AS(read_head_mask_model(folder / "a.safetensors"), FileError);
}

TEST_CASE("The mirror image of a photo has the mirror image of its mask, at the photo's size") {
    const HeadMaskModel model = make_head_mask_model(Rng(1));
    const Tensor photo = Rng(2).uniform({64, 64, 3}, 0.0, 1.0);
    const Tensor mask = head_probability(model, photo);
    REQUIRE(mask.shape() == Shape{64, 64, 1});
    const std::vector<double> turned =
        mirror_image(head_probability(model, mirror_image(photo))).to_vector();
    const std::vector<double> found = mask.to_vector();
    for (std::size_t i = 0; i < found.size(); ++i)
        CHECK(turned[i] == Approx(found[i]).margin(1e-3));
}

}  // namespace head_mask_network_tests
