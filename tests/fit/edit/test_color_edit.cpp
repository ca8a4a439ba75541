#include <catch2/catch.hpp>
#include <cmath>

#include "core/ops/ops.h"
#include "fit/edit/color_edit.h"
#include "nn/realtime/view.h"
#include "support/check_close.h"
#include "support/check_grad.h"
#include "support/error_message.h"
#include "support/tiny_model.h"

using namespace stymo;
using namespace stymo::test;

namespace {

constexpr std::int64_t side = 16;

Model frozen_model() {
    Model model = tiny_model(1);
    model.parameters().convert(DType::float64);
    model.parameters().set_trainable("", false);
    return model;
}

Codes codes_of(std::uint64_t seed) {
    return random_codes(1, seed, 1.0, DType::float64);
}

/// 1 in the left half.
Tensor left_half() {
    Tensor mask({side, side, 1});
    const std::span<float> values = mask.mutable_values<float>();
    for (std::size_t i = 0; i < values.size(); ++i) values[i] = i % side < side / 2 ? 1.0F : 0.0F;
    return mask;
}

Tensor plain_image(double red, double green, double blue) {
    Tensor image({side, side, 3});
    const std::span<float> values = image.mutable_values<float>();
    for (std::size_t i = 0; i < values.size(); ++i)
        values[i] = static_cast<float>(i % 3 == 0 ? red : i % 3 == 1 ? green : blue);
    return image;
}

double squared_mean(const Tensor& image, const Eigen::Vector3d& color, const Tensor& mask) {
    const std::vector<double> pixels = image.to_vector();
    const std::vector<double> weights = mask.to_vector();
    double total = 0.0;
    double area = 0.0;
    for (std::size_t i = 0; i < weights.size(); ++i) {
        area += weights[i];
        for (std::size_t c = 0; c < 3; ++c)
            total += weights[i] * std::pow(2.0 * (pixels[3 * i + c] - color[c]), 2.0);
    }
    return total / area;
}

}  // namespace

TEST_CASE("editing a colour moves the part towards it and keeps all codes but the texture",
          "[color_edit]") {
    const Model model = frozen_model();
    const Codes codes = codes_of(7);
    const Camera camera = model_camera(model, 0.1, 0.0, 0.0);
    const Tensor part = left_half();
    // A colour that some texture gives the part.
    Codes other = codes;
    other.groups[2] = codes_of(9).texture();
    const Eigen::Vector3d wanted =
        mean_color(render_view(model, other, 0, camera, {.samples_per_ray = 4}).image, part);
    const ColorEdit edit = edit_color(model, codes, camera, part, wanted,
                                      {.steps = 100,
                                       .learning_rate = 0.03,
                                       .decay = 0.98,
                                       .regularizer = 0.0,
                                       .rest_weight = 0.0});
    REQUIRE(edit.losses.size() == 100);
    CHECK(edit.losses.back() < edit.losses.front());
    const Eigen::Vector3d before = mean_color(edit.before, part);
    CHECK(share_of_way(before, mean_color(edit.after, part), wanted) > 0.8);
    for (const std::size_t group : {0U, 1U, 3U})
        CHECK(identical(edit.codes.groups[group].value(), codes.groups[group].value()));
    // The images are those that a renderer gives of the codes.
    CHECK(check_close(edit.before,
                      render_view(model, codes, 0, camera, {.samples_per_ray = 4}).image, 1e-9)
              .passed);
    CHECK(check_close(edit.after,
                      render_view(model, edit.codes, 0, camera, {.samples_per_ray = 4}).image, 1e-9)
              .passed);
}

TEST_CASE(
    "as the paper has it, the first loss of an edit is the mean squared distance of the part from "
    "the colour",
    "[color_edit]") {
    const Model model = frozen_model();
    const Eigen::Vector3d wanted{0.9, 0.1, 0.3};
    const ColorEdit edit = edit_color(model, codes_of(3), model_camera(model, 0.0, 0.0, 0.0),
                                      left_half(), wanted, {.term = ColorTerm::pixels, .steps = 1});
    CHECK(edit.losses.front() ==
          Approx(squared_mean(edit.before, wanted, left_half())).epsilon(1e-9));
}

TEST_CASE(
    "of the mean of a part the first loss is the squared distance of the means, and its shade need "
    "not go",
    "[color_edit]") {
    const Model model = frozen_model();
    const Eigen::Vector3d wanted{0.9, 0.1, 0.3};
    const ColorEdit edit = edit_color(model, codes_of(3), model_camera(model, 0.0, 0.0, 0.0),
                                      left_half(), wanted, {.term = ColorTerm::mean, .steps = 1});
    const Eigen::Vector3d mean = mean_color(edit.before, left_half());
    CHECK(edit.losses.front() == Approx(4.0 * (mean - wanted).squaredNorm()).epsilon(1e-9));
}

TEST_CASE("what lies outside of a part changes the less the more it weighs", "[color_edit]") {
    const Model model = frozen_model();
    const Camera camera = model_camera(model, 0.0, 0.0, 0.0);
    const Tensor rest = affine(Variable(left_half()), -1.0, 1.0).value();
    std::vector<double> changes;
    for (const double weight : {0.0, 1.0, 100.0}) {
        const ColorEdit edit = edit_color(
            model, codes_of(7), camera, left_half(), {0.9, 0.2, 0.2},
            {.steps = 60, .learning_rate = 0.03, .regularizer = 0.0, .rest_weight = weight});
        changes.push_back(mean_difference(edit.before, edit.after, rest));
    }
    CHECK(changes[1] < changes[0]);
    CHECK(changes[2] < 0.5 * changes[1]);
}

TEST_CASE("a part without pixels, or of another size than the image, is refused", "[color_edit]") {
    const Model model = frozen_model();
    const Camera camera = model_camera(model, 0.0, 0.0, 0.0);
    const auto edit = [&](const Tensor& part) {
        return edit_color(model, codes_of(7), camera, part, {}, {.steps = 1});
    };
    CHECK_THAT(error_message<ValueError>([&] {
                   return edit(Tensor::zeros({side, side, 1}));
               }),
               Catch::Contains("no pixels"));
    CHECK_THROWS_AS(edit(Tensor::full({8, 8, 1}, 1.0)), ShapeError);
}

TEST_CASE("means and differences are those of the pixels under the mask", "[color_edit]") {
    const Tensor a = plain_image(0.25, 0.5, 0.75);
    const Tensor b = plain_image(0.5, 0.5, 0.5);
    const Eigen::Vector3d mean = mean_color((Variable(a) * left_half()).value(), left_half());
    CHECK((mean - Eigen::Vector3d(0.25, 0.5, 0.75)).norm() < 1e-6);
    CHECK(mean_difference(a, b, left_half()) == Approx(0.5 / 3.0));
    CHECK(mean_difference(a, b, Tensor::zeros({side, side, 1})) == 0.0);
    CHECK(share_of_way({0, 0, 0}, {0.3, 0.4, 0}, {0.6, 0.8, 0}) == Approx(0.5));
    CHECK(share_of_way({0, 0, 0}, {0, 0, 1}, {1, 0, 0}) == Approx(1.0 - std::sqrt(2.0)));
    CHECK(share_of_way({0.5, 0, 0}, {0.5, 0, 0}, {0.5, 0, 0}) == 1.0);
}

TEST_CASE("a part is where the parser gave one of its classes", "[color_edit]") {
    const Tensor classes = Tensor::from({1, 4, 1}, std::vector<float>{0, 11, 13, 12});
    ParsingClassSet lips{};
    lips[static_cast<std::size_t>(ParsingClass::upper_lip)] =
        lips[static_cast<std::size_t>(ParsingClass::lower_lip)] = true;
    CHECK(part_mask(classes, lips).to_vector() == std::vector<double>{0, 1, 0, 1});
    CHECK(part_mask(classes, head_of_parts()).to_vector() == std::vector<double>{0, 1, 1, 1});
}

TEST_CASE("The gradient of colour editing is that of its whole objective", "[color_edit]") {
    const Model model = frozen_model();
    const Codes codes = codes_of(7);
    const Camera camera = model_camera(model, 0.1, 0.0, 0.0);
    const Tensor offset = Rng(5).normal({1, code_sizes[2]}, 0.0, 0.3, DType::float64);
    for (const ColorTerm term : {ColorTerm::mean, ColorTerm::pixels}) {
        const ColorObjective objective(
            model, codes, camera, left_half(), {0.7, 0.2, 0.4},
            {.term = term, .regularizer = 0.01, .rest_weight = 2.0, .samples_per_ray = 4});
        const GradReport report =
            check_grad("colour editing",
                       [&](const std::vector<Variable>& x) { return objective.loss(x.front()); },
                       {offset}, {.order = 1, .step = 1e-4, .tolerance = 1e-6});
        INFO(report.message);
        CHECK(report.passed);
        // The field is rendered once; a decoder that renders it anew gives the same image.
        const Decoded whole =
            model.decoder()(objective.codes(offset), {camera}, {.samples_per_ray = 4});
        CHECK(check_close(objective.image(offset).value(), whole.images.back().value(), 1e-12)
                  .passed);
    }
}
