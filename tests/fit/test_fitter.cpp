#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>

#include "core/ops/ops.h"
#include "fit/fitter.h"
#include "nn/realtime/view.h"
#include "support/check_close.h"
#include "support/error_message.h"
#include "support/tiny_model.h"

using namespace stymo;
using namespace stymo::test;

namespace {

constexpr std::int64_t samples = 4;

Model frozen_model() {
    Model model = tiny_model(1);
    model.parameters().convert(DType::float64);
    model.parameters().set_trainable("", false);
    return model;
}

/// What the model itself makes of known codes: a fit can reach a loss of zero. The encoder sees
/// noise.
FaceBatch target_of(const Model& model, const Codes& codes) {
    FaceBatch target;
    Rng rng(4);
    target.input = rng.uniform({codes.batch(), 16, 16, 3}, -1.0, 1.0, DType::float64);
    for (std::int64_t i = 0; i < codes.batch(); ++i)
        target.cameras.push_back(
            model_camera(model, 0.2 * static_cast<double>(i) - 0.1, 0.05, 0.0));
    for (const Variable& image :
         model.decoder()(codes, target.cameras, {.samples_per_ray = samples}).images)
        target.targets.push_back(image.value());
    return target;
}

FaceBatch row(const FaceBatch& target, std::int64_t index) {
    const auto part = [&](const Tensor& tensor) {
        return slice(Variable(tensor), 0, index, index + 1).value();
    };
    FaceBatch result{part(target.input), {}, {target.cameras[static_cast<std::size_t>(index)]}};
    for (const Tensor& image : target.targets) result.targets.push_back(part(image));
    return result;
}

ReconstructionLoss loss_of(const Model& model) {
    return ReconstructionLoss(model.config().reconstruction);
}

double offset_length(const FitResult& result) {
    double total = 0.0;
    for (std::size_t group = 0; group < code_names.size(); ++group)
        total +=
            sum(square(result.fitted.groups[group] - result.initial.groups[group])).value().item();
    return std::sqrt(total);
}

}  // namespace

TEST_CASE("fitting finds codes that give the images of known codes", "[fitter]") {
    const Model model = frozen_model();
    const FaceBatch target = target_of(model, random_codes(1, 7, 1.0, DType::float64));
    std::int64_t calls = 0;
    const FitOptions options{.steps = 150,
                             .learning_rate = 0.03,
                             .decay = 0.98,
                             .weights = {.regularizer = 0.0, .depth = 0.25},
                             .on_step = [&](const FitStep& step) { CHECK(step.steps == ++calls); }};
    const FitResult result = fit_codes(model, loss_of(model), target, options);
    REQUIRE(result.losses.size() == 150);
    CHECK(calls == 150);
    CHECK(result.losses.back() < 0.1 * result.losses.front());
    // Each twentieth is better than the one before, whatever single steps do.
    for (std::size_t i = 20; i < 100; i += 20) {
        const auto mean = [&](std::size_t first) {
            double total = 0.0;
            for (std::size_t k = first; k < first + 20; ++k) total += result.losses[k];
            return total / 20.0;
        };
        CHECK(mean(i) < mean(i - 20));
    }
    const Decoded decoded =
        model.decoder()(result.fitted, target.cameras, {.samples_per_ray = samples});
    CHECK(mean(abs(decoded.images.back() - Variable(target.targets.back()))).value().item() <
          0.1 * result.losses.front());
}

TEST_CASE("L-BFGS needs fewer evaluations than Adam to the same loss", "[fitter]") {
    const Model model = frozen_model();
    const FaceBatch target = target_of(model, random_codes(1, 7, 1.0, DType::float64));
    FitOptions options{.steps = 100,
                       .learning_rate = 0.03,
                       .decay = 0.98,
                       .weights = {.regularizer = 1e-4, .depth = 0.25},
                       .tolerance = 0.0};
    const FitResult adam = fit_codes(model, loss_of(model), target, options);
    options.optimizer = FitOptimizer::lbfgs;
    options.steps = 60;
    std::int64_t last = 0;
    Codes codes;
    options.on_step = [&](const FitStep& step) {
        CHECK(step.steps > last);
        last = step.steps;
        codes = step.codes;
    };
    const FitResult lbfgs = fit_codes(model, loss_of(model), target, options);
    CHECK(last == std::ssize(lbfgs.losses));
    CHECK(last <= 60);
    CHECK(lbfgs.losses.front() == adam.losses.front());
    CHECK(lbfgs.losses.back() < adam.losses.back());
    CHECK(std::ranges::is_sorted(lbfgs.losses, std::greater<>()));
    for (std::size_t group = 0; group < code_names.size(); ++group)
        CHECK(identical(codes.groups[group].value(), lbfgs.fitted.groups[group].value()));
}

TEST_CASE("L-BFGS repeats no evaluation if no sample is left out", "[fitter]") {
    const Model model = frozen_model();
    const FaceBatch target = target_of(model, random_codes(1, 7, 1.0, DType::float64));
    const auto losses = [&](std::int64_t selection_interval) {
        return fit_codes(model, loss_of(model), target,
                         {.optimizer = FitOptimizer::lbfgs,
                          .steps = 30,
                          .tolerance = 0.0,
                          .selection_interval = selection_interval})
            .losses;
    };
    CHECK(losses(1) == losses(1000));
}

TEST_CASE("L-BFGS fits poses and several photos of one person, and stops where nothing is lower",
          "[fitter]") {
    const Model model = frozen_model();
    FaceBatch target = target_of(model, random_codes(2, 7, 1.0, DType::float64));
    const Pose truth = pose_from_camera(target.cameras[0]);
    target.cameras[0] = model_camera(model, truth.yaw + 0.1, truth.pitch - 0.05, 0.0);
    const FitOptions options{.optimizer = FitOptimizer::lbfgs,
                             .steps = 40,
                             .weights = {.regularizer = 1e-4, .depth = 0.25},
                             .tolerance = 1e-4,
                             .selection_interval = 4,
                             .one_person = true,
                             .refine_pose = true};
    const FitResult result = fit_codes(model, loss_of(model), target, options);
    CHECK(result.losses.size() == 40);
    CHECK(result.losses.back() < 0.8 * result.losses.front());
    CHECK(pose_from_camera(result.cameras[0]).yaw != Approx(truth.yaw + 0.1));
    CHECK(identical(slice(result.fitted.identity(), 0, 0, 1).value(),
                    slice(result.fitted.identity(), 0, 1, 2).value()));
    // What the encoder says of its own image cannot be improved by much.
    FaceBatch own = row(target, 1);
    const Codes codes = detached(model.encoder()(Variable(own.input)));
    own.targets = {
        model.decoder()(codes, own.cameras, {.samples_per_ray = samples}).images.back().value()};
    const FitResult arrived =
        fit_codes(model, loss_of(model), own, {.optimizer = FitOptimizer::lbfgs, .tolerance = 0.0});
    CHECK(arrived.converged);
    CHECK(arrived.losses.size() < 200);
    own.targets[0].mutable_values<double>()[5] = std::nan("");
    CHECK_THROWS_AS(fit_codes(model, loss_of(model), own, {.optimizer = FitOptimizer::lbfgs}),
                    NumericError);
}

namespace {

/// A face of 32 pixels with its smaller images.
FaceBatch target_of_all_sides(const Model& model, Rng& rng) {
    FaceBatch target;
    target.input = rng.uniform({1, 32, 32, 3}, -1.0, 1.0);
    target.cameras = {model_camera(model, 0.1, 0.0, 0.0)};
    for (const Variable& image :
         model.decoder()(random_codes(1, 7), target.cameras, {.samples_per_ray = samples}).images)
        target.targets.push_back(image.value());
    return target;
}

}  // namespace

TEST_CASE(
    "the first steps of a fit from coarse to fine compare small images, and the loss of the last "
    "ones is the usual one",
    "[fitter]") {
    ModelConfig config = tiny_model_config();
    config.decoder.resolution = 32;
    config.decoder.block_channels = {6, 4};
    config.reconstruction.resolution_weights = {0.5, 2.0};
    Rng rng(1);
    Model model(config, rng);
    model.parameters().set_trainable("", false);
    const FaceBatch target = target_of_all_sides(model, rng);
    REQUIRE(target.targets.size() == 2);
    FaceBatch small = target;
    small.targets.pop_back();
    ReconstructionConfig as_the_largest = config.reconstruction;
    as_the_largest.resolution_weights = {2.0};
    for (const FitOptimizer optimizer : {FitOptimizer::adam, FitOptimizer::lbfgs}) {
        FitOptions options{.optimizer = optimizer,
                           .steps = 12,
                           .weights = {.regularizer = 1e-3, .depth = 0.25},
                           .coarse_steps = 6};
        const FitResult mixed = fit_codes(model, loss_of(model), target, options);
        options.coarse_steps = 0;
        const FitResult coarse =
            fit_codes(model, ReconstructionLoss(as_the_largest), small, options);
        for (std::size_t i = 0; i < 6; ++i)
            CHECK(mixed.losses[i] == Approx(coarse.losses[i]).epsilon(1e-5));
        const FitResult fine = fit_codes(model, loss_of(model), target, options);
        CHECK(mixed.losses.back() < fine.losses.front());
        CHECK(mixed.losses[8] != Approx(coarse.losses[8]));
    }
}

TEST_CASE("a fit from coarse to fine of a model with a ray for each pixel", "[fitter]") {
    ModelConfig config = tiny_model_config();
    config.decoder.resolution = 32;
    config.decoder.block_channels = {6, 4};
    config.decoder.conditioning = "concatenation";
    config.decoder.render = "none";
    config.decoder.mapping_layers = 0;
    config.reconstruction.resolution_weights = {0.5, 2.0};
    Rng rng(1);
    Model model(config, rng);
    model.parameters().set_trainable("", false);
    const FaceBatch target = target_of_all_sides(model, rng);
    // The image grows at a step after which the samples would stay for another two.
    const FitOptions options{.steps = 8,
                             .weights = {.regularizer = 0.0, .depth = 0.0},
                             .selection_interval = 4,
                             .coarse_steps = 6};
    const FitResult result = fit_codes(model, loss_of(model), target, options);
    CHECK(result.losses.size() == 8);
    CHECK(result.final_loss < result.initial_loss);
}

TEST_CASE("faces fitted together come out as each alone", "[fitter]") {
    const Model model = frozen_model();
    const FaceBatch target = target_of(model, random_codes(3, 8, 1.0, DType::float64));
    const FitOptions options{
        .steps = 15, .learning_rate = 0.03, .weights = {.regularizer = 1e-3, .depth = 0.25}};
    const FitResult together = fit_codes(model, loss_of(model), target, options);
    double loss = 0.0;
    for (std::int64_t i = 0; i < 3; ++i) {
        const FitResult alone = fit_codes(model, loss_of(model), row(target, i), options);
        loss += alone.losses.back() / 3.0;
        for (std::size_t group = 0; group < code_names.size(); ++group) {
            const CloseReport report =
                check_close(slice(together.fitted.groups[group], 0, i, i + 1).value(),
                            alone.fitted.groups[group].value(), 1e-5);
            INFO(report.message);
            CHECK(report.passed);
        }
    }
    CHECK(together.losses.back() == Approx(loss).epsilon(1e-8));
}

TEST_CASE("the regularizer holds the offsets near zero, the more the bigger it is", "[fitter]") {
    const Model model = frozen_model();
    const FaceBatch target = target_of(model, random_codes(1, 9, 1.0, DType::float64));
    std::vector<double> lengths;
    for (const double regularizer : {0.0, 1e-3, 1e-1}) {
        lengths.push_back(
            offset_length(fit_codes(model, loss_of(model), target,
                                    {.steps = 60,
                                     .learning_rate = 0.03,
                                     .decay = 0.97,
                                     .weights = {.regularizer = regularizer, .depth = 0.25}})));
    }
    CHECK(lengths[1] < 0.9 * lengths[0]);
    CHECK(lengths[2] < 0.5 * lengths[1]);
    // The model's own weight is the paper's 1.
    const FitOptions own{.steps = 5};
    FitOptions one = own;
    one.weights = {.regularizer = 1.0, .depth = 0.25};
    CHECK(fit_codes(model, loss_of(model), target, own).losses ==
          fit_codes(model, loss_of(model), target, one).losses);
}

TEST_CASE("the first learning rate is the model's own unless one is given", "[fitter]") {
    ModelConfig config = tiny_model_config();
    config.reconstruction.fit_learning_rate = 0.05;
    Rng rng(1);
    Model model(config, rng);
    model.parameters().convert(DType::float64);
    model.parameters().set_trainable("", false);
    const FaceBatch target = target_of(model, random_codes(1, 9, 1.0, DType::float64));
    for (const FitOptimizer optimizer : {FitOptimizer::adam, FitOptimizer::lbfgs}) {
        const auto losses = [&](double learning_rate) {
            return fit_codes(model, loss_of(model), target,
                             {.optimizer = optimizer, .steps = 4, .learning_rate = learning_rate})
                .losses;
        };
        CHECK(losses(0.0) == losses(0.05));
        CHECK_FALSE(losses(0.0) == losses(0.01));
    }
}

TEST_CASE("fitting lowers the perceptual term if it has a weight", "[fitter]") {
    ModelConfig larger = tiny_model_config();
    larger.decoder.resolution = 32;
    larger.decoder.rays.rays_per_side = 16;
    Rng rng(1);
    Model model(larger, rng);
    model.parameters().set_trainable("", false);
    ReconstructionConfig config = larger.reconstruction;
    config.photometric_weight = 0.0;
    config.perceptual_weight = 1.0;
    config.perceptual = {.network = "squeezenet1_1", .trunk = "random", .heads = "random"};
    const ReconstructionLoss loss(config);
    FaceBatch target;
    target.input = rng.uniform({1, 32, 32, 3}, -1.0, 1.0);
    target.cameras = {model_camera(model, 0.1, 0.0, 0.0)};
    target.targets = {
        model.decoder()(random_codes(1, 7), target.cameras, {.samples_per_ray = samples})
            .images.back()
            .value()};
    const FitResult result = fit_codes(model, loss, target,
                                       {.steps = 40,
                                        .learning_rate = 0.03,
                                        .decay = 0.97,
                                        .weights = {.regularizer = 0.0, .depth = 0.25}});
    CHECK(result.losses.back() < 0.5 * result.losses.front());

    const Decoded decoded =
        model.decoder()(random_codes(1, 8), target.cameras, {.samples_per_ray = samples});
    const ReconstructionLoss::Target kept = loss.kept_target(target.targets);
    const FitComparison seen{.decoded = decoded, .reconstruction = &loss, .photos = &kept};
    const double factor = 3.0;
    const FitLoss once = fit_loss(seen, {.regularizer = 0.0});
    const FitLoss more = fit_loss(seen, {.regularizer = 0.0, .perceptual = factor});
    CHECK(more.total.value().item() == Approx(factor * once.total.value().item()));
    CHECK(more.terms == once.terms);
}

TEST_CASE(
    "samples without weight are left out of a fit, and a tolerance above all weights leaves "
    "nothing",
    "[fitter]") {
    const Model model = frozen_model();
    const FaceBatch target = target_of(model, random_codes(1, 9, 1.0, DType::float64));
    const auto fitted = [&](double tolerance) {
        return fit_codes(model, loss_of(model), target,
                         {.steps = 12,
                          .learning_rate = 0.03,
                          .tolerance = tolerance,
                          .selection_interval = 4})
            .losses;
    };
    const std::vector<double> exact = fitted(0.0);
    const std::vector<double> close = fitted(1e-6);
    for (std::size_t i = 0; i < exact.size(); ++i)
        CHECK(close[i] == Approx(exact[i]).epsilon(1e-3));
    CHECK(fitted(0.999)[0] != Approx(exact[0]));
    CHECK_THROWS_AS(fit_codes(model, loss_of(model), target, {.steps = 1, .selection_interval = 0}),
                    ValueError);
}

TEST_CASE("a fit that keeps the field's arguments takes the same steps", "[fitter]") {
    const Model model = frozen_model();
    const FaceBatch target = target_of(model, random_codes(1, 9, 1.0, DType::float64));
    const auto fitted = [&](bool keep_field) {
        return fit_codes(
                   model, loss_of(model), target,
                   {.steps = 5, .learning_rate = 0.03, .tolerance = 0.0, .keep_field = keep_field})
            .losses;
    };
    const std::vector<double> recomputed = fitted(false), kept = fitted(true);
    for (std::size_t i = 0; i < kept.size(); ++i)
        CHECK(kept[i] == Approx(recomputed[i]).epsilon(1e-9));
}

TEST_CASE("zero steps return the encoder's codes", "[fitter]") {
    const Model model = frozen_model();
    const FaceBatch target = target_of(model, random_codes(2, 10, 1.0, DType::float64));
    const FitResult result = fit_codes(model, loss_of(model), target, {.steps = 0});
    const Codes encoded = model.encoder()(Variable(target.input));
    CHECK(result.losses.empty());
    for (std::size_t group = 0; group < code_names.size(); ++group) {
        CHECK(identical(result.initial.groups[group].value(), encoded.groups[group].value()));
        CHECK(identical(result.fitted.groups[group].value(), encoded.groups[group].value()));
        CHECK_FALSE(result.fitted.groups[group].tracked());
    }
}

TEST_CASE("targets that do not suit the model are refused, and so is what is not a number",
          "[fitter]") {
    const Model model = frozen_model();
    const FaceBatch target = target_of(model, random_codes(1, 11, 1.0, DType::float64));
    const auto refused = [&](const FaceBatch& bad) {
        return is_one_line(error_message<ShapeError>(
            [&] { static_cast<void>(fit_codes(model, loss_of(model), bad, {.steps = 1})); }));
    };
    FaceBatch bad = target;
    bad.targets.clear();
    CHECK(refused(bad));
    bad = target;
    bad.targets[0] = Tensor::zeros({1, 8, 8, 3}, DType::float64);
    CHECK_THAT(error_message<ValueError>(
                   [&] { static_cast<void>(fit_codes(model, loss_of(model), bad, {.steps = 1})); }),
               Catch::Contains("16, not 8"));
    bad = target;
    bad.cameras.push_back(bad.cameras.front());
    CHECK(refused(bad));

    bad = target;
    bad.targets[0].mutable_values<double>()[5] = std::nan("");
    const std::string message = error_message<NumericError>(
        [&] { static_cast<void>(fit_codes(model, loss_of(model), bad, {.steps = 3})); });
    CHECK_THAT(message, Catch::Contains("step 0") && Catch::Contains("not finite"));
}

TEST_CASE("a pose that is learnt comes nearer to the one of the image, and the image with it",
          "[fitter]") {
    const Model model = frozen_model();
    const Codes codes = random_codes(1, 7, 1.0, DType::float64);
    FaceBatch target = target_of(model, codes);
    const Pose truth = pose_from_camera(target.cameras[0]);
    target.cameras[0] = model_camera(model, truth.yaw + 0.1, truth.pitch - 0.05, 0.0);
    FitOptions options{.steps = 60,
                       .learning_rate = 0.03,
                       .decay = 0.98,
                       .weights = {.regularizer = 0.0, .depth = 0.25},
                       .tolerance = 0.0};
    const FitResult fixed = fit_codes(model, loss_of(model), target, options);
    CHECK(pose_from_camera(fixed.cameras[0]).yaw == Approx(truth.yaw + 0.1));
    options.refine_pose = true;
    options.pose_learning_rate_factor = 0.5;
    const FitResult refined = fit_codes(model, loss_of(model), target, options);
    CHECK(refined.losses.front() == Approx(fixed.losses.front()).epsilon(1e-9));
    CHECK(refined.losses.back() < fixed.losses.back());
    // Codes that are fitted beside it can make up for a pose; known ones cannot.
    options.initial = codes;
    options.fitted_groups = {};
    const Pose found =
        pose_from_camera(fit_codes(model, loss_of(model), target, options).cameras[0]);
    CHECK(std::abs(found.yaw - truth.yaw) < 0.03);
    CHECK(std::abs(found.pitch - truth.pitch) < 0.03);
}

TEST_CASE("several photos of one person share identity and texture, and nothing else", "[fitter]") {
    const Model model = frozen_model();
    const FaceBatch target = target_of(model, random_codes(2, 7, 1.0, DType::float64));
    const FitResult result = fit_codes(model, loss_of(model), target,
                                       {.steps = 30,
                                        .learning_rate = 0.02,
                                        .weights = {.regularizer = 0.0, .depth = 0.25},
                                        .one_person = true});
    const Codes apart = detached(model.encoder()(Variable(target.input)));
    for (std::size_t group = 0; group < code_names.size(); ++group) {
        const auto difference_of_rows = [&](const Codes& codes) {
            return sum(abs(slice(codes.groups[group], 0, 0, 1) -
                           slice(codes.groups[group], 0, 1, 2)))
                .value()
                .item();
        };
        const bool shared = group == 0 || group == 2;
        CHECK((difference_of_rows(result.fitted) == 0.0) == shared);
        CHECK(difference_of_rows(apart) > 0.0);
    }
    CHECK(result.losses.back() < result.losses.front());
}

TEST_CASE(
    "a fit starts from the target's codes if it has some, and a model without an encoder needs "
    "them",
    "[fitter]") {
    ModelConfig config = tiny_model_config();
    config.code_source = "morphable";
    for (const std::string conditioning : {"modulation", "concatenation"}) {
        config.decoder.conditioning = conditioning;
        config.decoder.render = conditioning == "modulation" ? "blocks" : "none";
        config.decoder.mapping_layers = conditioning == "modulation" ? 1 : 0;
        Rng rng(1);
        Model model(config, rng);
        model.parameters().set_trainable("", false);
        const ReconstructionLoss loss(config.reconstruction);
        FaceBatch target{.input = Tensor::zeros({1, 16, 16, 3}),
                         .targets = {},
                         .cameras = {model_camera(model, 0.0, 0.0, 0.0)}};
        target.targets = {
            model.decoder()(random_codes(1, 3), target.cameras, {.samples_per_ray = 4})
                .images.back()
                .value()};
        FitOptions options{.steps = 12,
                           .learning_rate = 0.05,
                           .weights = {.regularizer = 0.0, .depth = 0.25},
                           .selection_interval = 4};
        CHECK(is_one_line(error_message<ValueError>(
            [&] { static_cast<void>(fit_codes(model, loss, target, options)); })));
        options.initial = random_codes(1, 5);
        const FitResult result = fit_codes(model, loss, target, options);
        for (std::size_t group = 0; group < 4; ++group)
            CHECK(identical(result.initial.groups[group].value(),
                            options.initial->groups[group].value()));
        CHECK(result.losses.back() < result.losses.front());
    }
}
