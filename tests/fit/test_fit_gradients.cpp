// Whole objectives of fits and of tuning against central differences in float64.
#include <catch2/catch.hpp>
#include <optional>
#include <span>
#include <vector>

#include "core/ops/ops.h"
#include "fit/fit_problem.h"
#include "fit/tuning.h"
#include "nn/models/identity_network.h"
#include "nn/models/significant_rows.h"
#include "nn/realtime/view.h"
#include "render/morphable/builtin_head.h"
#include "support/check_grad.h"
#include "support/tiny_model.h"

namespace fit_gradient_tests {

using namespace stymo;
using namespace stymo::test;

namespace {

constexpr std::int64_t samples = 16;
constexpr double tolerance = 0.001;  // the default of fits and of tuning

/// A model whose rays end within the field, so that their last samples are insignificant.
Model dense_model(std::uint64_t seed, DType dtype) {
    ModelConfig config = tiny_model_config();
    config.encoder.identity_backbone = "small_conv";
    Rng rng(seed);
    Model model(config, rng);
    for (const Parameter& parameter : model.parameters().all())
        if (parameter.name() == "decoder.field.density.bias")
            parameter.set_value(Tensor::full({1}, 4.0));
    model.parameters().convert(dtype);
    model.parameters().set_trainable("", false);
    return model;
}

/// A photo of another model's face, with the code of a linear head and a mask.
struct Photo {
    DType dtype;
    Model model = dense_model(1, dtype);
    Codes codes = random_codes(1, 7, 1.0, dtype);
    Camera camera = model_camera(model, 0.1, 0.0, 0.0);
    FaceBatch faces{};
    ReconstructionLoss loss{model.config().reconstruction};
    HeadDepth heads;
    ReconstructionLoss::Target target;

    explicit Photo(DType type)
        : dtype(type), faces(photographed()), heads(&builtin_head_once(), faces) {
        target = loss.kept_target(faces.targets);
    }
    static const MorphableHead& builtin_head_once() {
        static const MorphableHead head = builtin_head();
        return head;
    }

    [[nodiscard]] FaceBatch photographed() const {
        FaceBatch batch;
        batch.cameras = {camera};
        batch.targets = {
            dense_model(2, dtype)
                .decoder()(random_codes(1, 8, 1.0, dtype), {camera}, {.samples_per_ray = samples})
                .images.back()
                .value()};
        batch.has_mask = {true};
        batch.mask = Rng(4).uniform({1, 16, 16, 1}, 0.0, 1.0).to(dtype);
        for (std::size_t group = 0; group < code_sizes.size(); ++group)
            batch.codes[group] = Tensor::full({1, code_sizes[group]}, group == 0 ? 0.5 : 0.0);
        batch.code_present = Tensor::full({1}, 1.0);
        return batch;
    }

    /// The head where the rendered face is now; constants of the loss.
    [[nodiscard]] std::optional<FaceSurface> surface_at(const Decoded& decoded) {
        const Tensor depths = expected_depth(decoded).value().to(DType::float32);
        heads.align(0, camera, depths.reshaped({8, 8, 1}));
        return heads.surface(0, camera, 8);
    }
    /// All terms that compare with the photo.
    [[nodiscard]] FitLoss compared(const Decoded& decoded, const Codes* offsets,
                                   const std::optional<FaceSurface>& surface,
                                   const FitWeights& weights) const {
        return fit_loss({.decoded = decoded,
                         .reconstruction = &loss,
                         .photos = &target,
                         .offsets = offsets,
                         .mask = decoded.mask_logit.defined() ? faces.mask : Tensor(),
                         .depths = expected_depth(decoded),
                         .embeddings = embedding(decoded.images.back()),
                         .photo_embeddings = embedding(faces.targets.back()).value(),
                         .surfaces = {&surface, 1},
                         .heads = &heads},
                        weights);
    }
    [[nodiscard]] Variable embedding(const Variable& image) const {
        return embedding(image, camera);
    }
    [[nodiscard]] Variable embedding(const Variable& image, const Camera& seen_by) const {
        return model.encoder().face_embedding(
            augmented(image, std::vector{ffhq_frame(seen_by, model.config().camera)}));
    }
};

double contracted(const Variable& gradient, const Tensor& direction) {
    return sum(gradient * Variable(direction)).value().item();
}

/// Central difference of fourth order, with a step so short that hardly any kink of L1 and leaky
/// ReLU lies in it.
template <class Value>
double derivative(Value value) {
    constexpr double h = 1e-7;
    return (8.0 * (value(h) - value(-h)) - (value(2.0 * h) - value(-2.0 * h))) / (12.0 * h);
}

}  // namespace

TEST_CASE("The gradient of a fit is that of its whole objective, samples left out included",
          "[fitter]") {
    Photo photo(DType::float64);
    const FitOptions options{.initial = photo.codes,
                             .weights = {.regularizer = 0.01, .depth = 0.25, .identity = 0.3},
                             .samples_per_ray = samples,
                             .head = &Photo::builtin_head_once()};
    REQUIRE(options.tolerance == tolerance);
    FitProblem problem(photo.model, photo.loss, photo.faces, options);
    static_cast<void>(problem.choose_images(0));
    for (const Parameter& offset : problem.offsets())
        offset.set_value(Rng(5)
                             .split(offset.name())
                             .normal(offset.variable().shape(), 0.0, 0.2, DType::float64));
    REQUIRE(problem.select_samples());
    const bool from_side = GENERATE(false, true);
    problem.choose_side(from_side ? 1 : 0);
    const FitProblem::Evaluation evaluation = problem.evaluate();
    REQUIRE(evaluation.terms.size() == (from_side ? 5U : 4U));

    const Camera left = turned_about_head(photo.camera, -0.5, 0.0);
    const auto significant_from = [&](const Camera& camera) {
        return significant_samples(
            photo.model.decoder().compositing_weights(problem.codes(), {camera}, samples),
            tolerance);
    };
    const Tensor significant = significant_from(photo.camera),
                 significant_on_side = significant_from(left);
    const double share = mean(Variable(significant)).value().item();
    CHECK(share > 0.2);
    CHECK(share < 0.95);
    const DecodeOptions decode{.samples_per_ray = samples, .significant_samples = significant};
    const auto decoded = [&](const Codes& codes) {
        return photo.model.decoder()(codes, photo.faces.cameras, decode);
    };
    const std::optional<FaceSurface> surface = photo.surface_at(decoded(problem.codes()));
    REQUIRE(surface);
    const auto value = [&] {
        Codes offsets;
        for (std::size_t group = 0; group < code_names.size(); ++group)
            offsets.groups[group] = problem.offsets()[group].variable();
        return photo
            .compared(decoded(add(photo.codes, offsets)), &offsets, surface, options.weights)
            .total.value()
            .item();
    };
    CHECK(value() == Approx(evaluation.loss).epsilon(1e-12));
    const Variable wanted(photo.embedding(photo.faces.targets.back()).value());
    const auto side_value = [&] {
        const Decoded side = photo.model.decoder()(
            problem.codes(), {left},
            {.samples_per_ray = samples, .significant_samples = significant_on_side});
        const Variable seen = photo.embedding(side.images.back(), left);
        return 2.0 * 0.3 * (1.0 - sum(seen * wanted).value().item());
    };
    for (std::size_t group = 0; group < code_names.size(); ++group) {
        INFO(code_names[group]);
        const Parameter& offset = problem.offsets()[group];
        const Tensor before = offset.variable().value();
        const Tensor direction =
            Rng(6).split(group).normal(before.shape(), 0.0, 1.0, DType::float64);
        const double measured = derivative([&](double along) {
            offset.set_value((Variable(before) + Variable(direction) * along).value());
            return value() + (from_side ? side_value() : 0.0);
        });
        offset.set_value(before);
        CHECK(contracted(evaluation.gradients[group], direction) ==
              Approx(measured).epsilon(1e-6).margin(1e-9));
    }
}

TEST_CASE("A side that planes fixed in the world cannot render is left out of a fit", "[fitter]") {
    Photo photo(DType::float32);
    REQUIRE(photo.model.config().decoder.depth_planes == "world_z");
    photo.faces.cameras = {model_camera(photo.model, 1.0, 0.0, 0.0)};
    FitProblem problem(
        photo.model, photo.loss, photo.faces,
        {.initial = photo.codes, .weights = {.identity = 0.3}, .samples_per_ray = samples});
    static_cast<void>(problem.choose_images(0));
    REQUIRE(problem.select_samples());
    const auto terms = [&](std::int64_t step) {
        problem.choose_side(step);
        return problem.evaluate().terms.size();
    };
    const std::size_t without = terms(0);
    CHECK(terms(1) == without + 1);  // from 0.5
    CHECK(terms(3) == without);      // from 1.5
}

TEST_CASE("A profile in a batch leaves the other faces' sides in the fit", "[fitter]") {
    Photo photo(DType::float32);
    const auto twice = [](const Variable& rows) { return concat({rows, rows}, 0); };
    photo.faces.cameras = {model_camera(photo.model, 1.0, 0.0, 0.0), photo.camera};
    photo.faces.targets.back() = twice(Variable(photo.faces.targets.back())).value();
    for (Variable& group : photo.codes.groups) group = twice(group);
    FitProblem problem(photo.model, photo.loss, photo.faces,
                       {.initial = photo.codes,
                        .weights = {.depth = 0.0, .identity = 0.3},
                        .samples_per_ray = samples});
    static_cast<void>(problem.choose_images(0));
    REQUIRE(problem.select_samples());
    problem.choose_side(0);
    const std::size_t without = problem.evaluate().terms.size();
    problem.choose_side(3);  // the profile would be seen from 1.5
    CHECK(problem.evaluate().terms.size() == without + 1);
}

namespace {

/// What tuning minimises in a step with the photo, and with an anchor.
struct TunedPhoto : Photo {
    FitWeights weights = TuningOptions{}.weights;
    /// Who the face is only counts from a side.
    FitWeights of_photo = [] {
        FitWeights all = TuningOptions{}.weights;
        all.identity = 0.0;
        return all;
    }();
    std::vector<Tensor> kept{Rng(9).uniform({1, 16, 16, 3}, -1.0, 1.0).to(dtype)};
    std::vector<double> kept_weights{1.0};
    Camera aside = model_camera(model, 0.5, 0.1, 0.0);

    using Photo::Photo;

    [[nodiscard]] DecodeOptions decoding(bool mask) const {
        return {.samples_per_ray = samples, .mask = mask, .keep_field = true};
    }
    [[nodiscard]] Decoded seen(const DecodeOptions& decode) const {
        return model.decoder()(codes, {camera}, decode);
    }
    [[nodiscard]] FitLoss anchored(const std::optional<FaceSurface>& surface) const {
        const Decoded decoded = model.decoder()(codes, {aside}, decoding(false));
        return fit_loss({.decoded = decoded,
                         .kept_images = kept,
                         .kept_weights = kept_weights,
                         .depths = expected_depth(decoded),
                         .side_embeddings = embedding(decoded.images.back(), aside),
                         .photo_embeddings = embedding(faces.targets.back()).value(),
                         .surfaces = {&surface, 1},
                         .heads = &heads},
                        weights);
    }
};

}  // namespace

TEST_CASE("The gradient of tuning is that of its terms, with the photo and with an anchor",
          "[tuning]") {
    TunedPhoto photo(DType::float64);
    for (const char* prefix : {"decoder.field.", "decoder.block", "decoder.mask."})
        photo.model.parameters().set_trainable(prefix, true);
    DecodeOptions decode = photo.decoding(true);
    decode.significant_samples =
        significant_samples(photo.seen(decode).weights.weights.value(), tolerance);
    const std::optional<FaceSurface> surface = photo.surface_at(photo.seen(decode));
    const std::optional<FaceSurface> turned = photo.heads.surface(0, photo.aside, 8);
    REQUIRE((surface && turned));
    const auto loss = [&] {
        FitLoss with_photo = photo.compared(photo.seen(decode), nullptr, surface, photo.of_photo);
        CHECK(with_photo.terms.size() == 3);
        return with_photo.total + photo.anchored(turned).total;
    };
    const std::vector<Parameter> parameters = photo.model.parameters().trainable();
    const std::vector<Variable> gradients = grad(loss(), variables_of(parameters));
    REQUIRE(parameters.size() > 10);
    for (std::size_t i = 0; i < parameters.size(); ++i) {
        INFO(parameters[i].name());
        const Tensor before = parameters[i].variable().value();
        const Tensor direction = Rng(6).split(i).normal(before.shape(), 0.0, 1.0, DType::float64);
        const double measured = derivative([&](double along) {
            parameters[i].set_value((Variable(before) + Variable(direction) * along).value());
            return loss().value().item();
        });
        parameters[i].set_value(before);
        CHECK(contracted(gradients[i], direction) == Approx(measured).epsilon(1e-5).margin(1e-8));
    }
}

TEST_CASE("The first loss of tuning is that of these terms", "[tuning]") {
    TunedPhoto photo(DType::float32);
    Model tuned = dense_model(1, DType::float32);
    const TuningResult result =
        tune_decoder(photo.model, tuned, photo.loss, photo.faces, photo.codes, {photo.camera},
                     {.steps = 1, .head = &Photo::builtin_head_once(), .samples_per_ray = samples});
    const Decoded decoded = photo.seen(photo.decoding(true));
    const FitLoss expected =
        photo.compared(decoded, nullptr, photo.surface_at(decoded), photo.of_photo);
    REQUIRE(result.terms.size() == expected.terms.size());
    for (std::size_t i = 0; i < expected.terms.size(); ++i) {
        INFO(expected.terms[i].first);
        CHECK(result.terms[i].first == expected.terms[i].first);
        CHECK(result.terms[i].second == Approx(expected.terms[i].second).epsilon(1e-4));
    }
    CHECK(result.losses.front() == Approx(expected.total.value().item()).epsilon(1e-4));
}

TEST_CASE("Tuning makes the face seen from aside more like the person", "[tuning]") {
    const Photo photo(DType::float32);
    const Tensor person = photo.embedding(photo.faces.targets.back()).value();
    const auto likeness = [&](double weight) {
        Model tuned = dense_model(1, DType::float32);
        static_cast<void>(tune_decoder(photo.model, tuned, photo.loss, photo.faces, photo.codes,
                                       {photo.camera},
                                       {.steps = 60,
                                        .weights = {.locality = 2.0, .identity = weight},
                                        .samples_per_ray = samples}));
        double sum = 0.0;
        for (const double yaw : {-0.5, 0.5}) {
            const Camera aside = model_camera(photo.model, yaw, 0.0, 0.0);
            const Decoded seen =
                tuned.decoder()(photo.codes, {aside}, {.samples_per_ray = samples});
            sum += stymo::sum(photo.embedding(seen.images.back(), aside) * Variable(person))
                       .value()
                       .item();
        }
        return sum;
    };
    CHECK(likeness(0.5) > likeness(0.0) + 0.02);
}

}  // namespace fit_gradient_tests
