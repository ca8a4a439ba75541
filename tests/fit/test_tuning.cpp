#include <catch2/catch.hpp>

#include "core/error.h"
#include "core/ops/ops.h"
#include "fit/tuning.h"
#include "nn/losses.h"
#include "nn/realtime/view.h"
#include "support/check_close.h"
#include "support/thread_count.h"
#include "support/tiny_model.h"

using namespace stymo;
using namespace stymo::test;

namespace {

Model frozen_model(std::uint64_t seed) {
    Model model = tiny_model(seed);
    model.parameters().set_trainable("", false);
    return model;
}

Tensor image_of(const Model& model, const Codes& codes, const Camera& camera) {
    return model.decoder()(codes, {camera}, {.samples_per_ray = 4}).images.back().value();
}

double distance(const Tensor& a, const Tensor& b) {
    return mean(abs(Variable(a) - Variable(b))).value().item();
}

/// A photo that the model does not know: another model's face.
struct Case {
    Model original = frozen_model(1);
    Codes codes = random_codes(1, 7);
    Camera camera = model_camera(original, 0.1, 0.0, 0.0);
    FaceBatch face{};
    ReconstructionLoss loss{original.config().reconstruction};

    Case() {
        face.cameras = {camera};
        face.targets = {image_of(frozen_model(2), random_codes(1, 8), camera)};
    }

    Model tuned(const TuningOptions& options, TuningResult* result = nullptr) const {
        Model model = frozen_model(1);
        TuningResult done = tune_decoder(original, model, loss, face, codes, {camera}, options);
        if (result != nullptr) *result = std::move(done);
        return model;
    }
};

}  // namespace

TEST_CASE("tuning brings the decoder's image to the photo", "[tuning]") {
    const Case given;
    TuningResult result;
    std::int64_t calls = 0;
    const Model tuned =
        given.tuned({.steps = 60,
                     .learning_rate = 0.02,
                     .weights = {.regularizer = 0.0, .locality = 0.0, .depth = 1.0, .mask = 0.05},
                     .on_step = [&](const TuningStep& step) { CHECK(step.steps == ++calls); }},
                    &result);
    REQUIRE(result.losses.size() == 60);
    CHECK(calls == 60);
    const double before =
        distance(image_of(given.original, given.codes, given.camera), given.face.targets.back());
    const double after =
        distance(image_of(tuned, given.codes, given.camera), given.face.targets.back());
    CHECK(after < 0.5 * before);
    for (const Parameter& parameter : tuned.parameters().all()) CHECK_FALSE(parameter.trainable());
}

TEST_CASE("Short tunings have a smaller usual learning rate", "[tuning]") {
    CHECK(usual_tuning_rate(100.0) == Approx(0.09));
    CHECK(usual_tuning_rate(400.0) == Approx(0.09));
    CHECK(usual_tuning_rate(25.0) == Approx(0.045));
    CHECK(usual_tuning_rate(1.0) == Approx(0.009));
}

TEST_CASE("A tuning without a learning rate has the usual one of its steps", "[tuning]") {
    const Case given;
    TuningResult usual, named;
    static_cast<void>(given.tuned({.steps = 25}, &usual));
    static_cast<void>(given.tuned({.steps = 25, .learning_rate = 0.045}, &named));
    CHECK(usual.losses == named.losses);
    TuningResult larger;
    static_cast<void>(given.tuned({.steps = 25, .learning_rate = 0.09}, &larger));
    CHECK(usual.losses.back() != Approx(larger.losses.back()).epsilon(0.01));
}

TEST_CASE("A tuning without time for a step does one that changes the decoder", "[tuning]") {
    const Case given;
    for (const std::int64_t steps : {0, 100}) {
        TuningResult result;
        const Model tuned = given.tuned({.seconds = 1e-9, .steps = steps}, &result);
        CHECK(result.losses.size() == 1);
        CHECK(distance(image_of(tuned, given.codes, given.camera),
                       image_of(given.original, given.codes, given.camera)) > 0.0);
    }
}

TEST_CASE("the locality term keeps other faces as they were", "[tuning]") {
    const Case given;
    const Codes other = random_codes(1, 11);
    const Camera side = model_camera(given.original, -0.5, 0.1, 0.0);
    const auto moved = [&](double weight) {
        const Model tuned = given.tuned(
            {.steps = 60,
             .learning_rate = 0.02,
             .weights = {.regularizer = 0.0, .locality = weight, .depth = 1.0, .mask = 0.05}});
        return distance(image_of(tuned, other, side), image_of(given.original, other, side));
    };
    CHECK(moved(10.0) < 0.7 * moved(0.0));
}

TEST_CASE("tuning changes all but the mapping networks of the decoder", "[tuning]") {
    const Case given;
    const Model tuned = given.tuned({.steps = 2});
    for (std::size_t i = 0; i < tuned.parameters().all().size(); ++i) {
        const Parameter& parameter = tuned.parameters().all()[i];
        const bool learns = parameter.name().starts_with("decoder.") &&
                            !parameter.name().starts_with("decoder.mapping.");
        const bool same = identical(parameter.variable().value(),
                                    given.original.parameters().all()[i].variable().value());
        INFO(parameter.name());
        if (!learns) CHECK(same);
        if (parameter.name() == "decoder.field.layer0.weight") CHECK_FALSE(same);
    }
}

TEST_CASE("tuning for a number of steps gives the same bits with any number of threads",
          "[tuning]") {
    const Case given;
    // Three selections of samples, and three anchors that are compared again with theirs.
    const TuningOptions options{.steps = 20, .anchors = 3};
    const Model one = given.tuned(options);
    const ThreadCount guard;
    for (const int threads : {1, 2, 5}) {
        set_thread_count(threads);
        const Model two = given.tuned(options);
        INFO(threads << " threads");
        for (std::size_t i = 0; i < one.parameters().all().size(); ++i)
            CHECK(identical(one.parameters().all()[i].variable().value(),
                            two.parameters().all()[i].variable().value()));
    }
}

TEST_CASE("tuning uses each photo in turn", "[tuning]") {
    const Case given;
    const Camera other = model_camera(given.original, -0.3, 0.0, 0.0);
    const Codes codes = split_codes(concat({joined(given.codes), joined(random_codes(1, 9))}, 0));
    FaceBatch faces;
    faces.cameras = {given.camera, other};
    faces.targets = {
        concat({given.face.targets.back(), image_of(frozen_model(3), random_codes(1, 10), other)},
               0)
            .value()};
    Model tuned = frozen_model(1);
    // Two selections of each photo's samples.
    const TuningResult result = tune_decoder(
        given.original, tuned, given.loss, faces, codes, faces.cameras,
        {.steps = 18,
         .learning_rate = 0.02,
         .weights = {.regularizer = 0.0, .locality = 0.0, .depth = 1.0, .mask = 0.05}});
    for (std::int64_t photo = 0; photo < 2; ++photo) {
        const auto loss_after = [&](const Model& model) {
            return distance(image_of(model, codes_of_face(codes, photo),
                                     faces.cameras[static_cast<std::size_t>(photo)]),
                            slice(Variable(faces.targets.back()), 0, photo, photo + 1).value());
        };
        CHECK(loss_after(tuned) < 0.9 * loss_after(given.original));
    }
    // The first step sees the first photo alone.
    TuningResult first;
    static_cast<void>(given.tuned({.steps = 1}, &first));
    CHECK(result.losses[0] == first.losses[0]);
    CHECK(result.losses[1] != first.losses[0]);
}

TEST_CASE("the mask branch learns each photo's own mask, and nothing of a photo without one",
          "[tuning]") {
    const Case given;
    const std::int64_t side = given.original.decoder().ladder().largest();
    const Camera other = model_camera(given.original, -0.3, 0.0, 0.0);
    const Codes codes = split_codes(concat({joined(given.codes), joined(random_codes(1, 9))}, 0));
    FaceBatch faces;
    faces.cameras = {given.camera, other};
    faces.targets = {concat({given.face.targets.back(), given.face.targets.back()}, 0).value()};
    // The left half is the head of one photo, the right half that of the other.
    faces.mask = Tensor::zeros({2, side, side, 1});
    const auto values = faces.mask.mutable_values<float>();
    for (std::size_t i = 0; i < values.size(); ++i) {
        const bool left = static_cast<std::int64_t>(i) % side < side / 2;
        values[i] = left == (i < values.size() / 2) ? 1.0F : 0.0F;
    }
    const auto mask_error = [&](const Model& model, std::int64_t row) {
        const Decoded decoded = model.decoder()(codes_of_face(codes, row),
                                                {faces.cameras[static_cast<std::size_t>(row)]},
                                                {.samples_per_ray = 4, .mask = true});
        return mask_loss(decoded.mask_logit, slice(Variable(faces.mask), 0, row, row + 1).value())
            .value()
            .item();
    };
    for (const bool has_mask : {true, false}) {
        faces.has_mask = {has_mask, has_mask};
        Model tuned = frozen_model(1);
        static_cast<void>(tune_decoder(
            given.original, tuned, given.loss, faces, codes, faces.cameras,
            {.steps = 200,
             .learning_rate = 0.06,
             .weights = {.regularizer = 0.0, .locality = 0.0, .depth = 1.0, .mask = 4.0}}));
        for (const std::int64_t row : {0, 1})
            CHECK((mask_error(tuned, row) < 0.9 * mask_error(given.original, row)) == has_mask);
    }
}

TEST_CASE("a tolerance of zero leaves out no sample", "[tuning]") {
    const Case given;
    const auto losses = [&](double tolerance) {
        TuningResult result;
        static_cast<void>(given.tuned(
            {.steps = 2,
             .weights = {.regularizer = 0.0, .locality = 0.0, .depth = 1.0, .mask = 0.05},
             .tolerance = tolerance},
            &result));
        return result.losses;
    };
    const std::vector<double> all = losses(0.0), some = losses(0.2);
    // The first comparison with a photo evaluates all samples in either case.
    CHECK(all[0] == some[0]);
    CHECK(all[1] < some[1]);
}

TEST_CASE("tuning ends when its time is over, and needs a limit", "[tuning]") {
    const Case given;
    TuningResult result;
    static_cast<void>(given.tuned({.seconds = 0.05}, &result));
    CHECK_FALSE(result.losses.empty());
    CHECK_THROWS_AS(given.tuned({}), ValueError);
}
