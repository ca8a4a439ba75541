#include <catch2/catch.hpp>
#include <set>

#include "core/error.h"
#include "core/ops/ops.h"
#include "core/work_counts.h"
#include "fit/fit_objective.h"
#include "nn/losses.h"
#include "nn/realtime/view.h"
#include "support/tiny_model.h"

namespace fit_objective_tests {

using namespace stymo;
using namespace stymo::test;

namespace {

/// A comparison that every term takes part in, with their closed forms.
struct Case {
    Model model = tiny_model(1).copy();
    ReconstructionLoss loss{model.config().reconstruction};
    Codes codes = random_codes(1, 4);
    Decoded decoded = model.decoder()(codes, {model_camera(model, 0.0, 0.0, 0.0)},
                                      {.samples_per_ray = 4, .mask = true});
    std::vector<Tensor> grey{affine(decoded.images.back(), 0.0, 0.25).value()};
    ReconstructionLoss::Target photos = loss.kept_target(grey);
    std::vector<double> kept_weights{0.5};
    Variable frames = random_codes(2, 5).expression();
    Tensor mask = Tensor::full(decoded.mask_logit.shape(), 1.0);

    /// What the term of this name compares.
    [[nodiscard]] FitComparison comparison(const std::string& name) const {
        FitComparison seen{.decoded = decoded};
        if (name == "photometric") {
            seen.reconstruction = &loss;
            seen.photos = &photos;
        } else if (name == "regularizer") {
            seen.offsets = &codes;
        } else if (name == "locality") {
            seen.kept_images = grey;
            seen.kept_weights = kept_weights;
        } else if (name == "time") {
            seen.expressions = frames;
            seen.expression_before = codes.expression().value();
        } else if (name == "identity") {
            seen.embeddings = Variable(Tensor::from({1, 2}, std::vector{0.6, 0.8}));
            seen.photo_embeddings = Tensor::from({1, 2}, std::vector{0.0, 1.0});
        } else if (name == "side_identity") {
            seen.side_embeddings = Variable(Tensor::from({1, 2}, std::vector{0.8, 0.6}));
            seen.photo_embeddings = Tensor::from({1, 2}, std::vector{0.0, 1.0});
        } else if (name == "mask") {
            seen.mask = mask;
        }
        return seen;
    }
    [[nodiscard]] double value(const std::string& name) const {
        const auto difference = [&] {
            return mean(abs(decoded.images.back() - Variable(grey.front()))).value().item();
        };
        if (name == "photometric") return photos.weights.front() * difference();
        if (name == "regularizer") return squared_length(codes).value().item();
        if (name == "locality") return kept_weights.front() * difference();
        if (name == "time") {
            const Variable first = slice(frames, 0, 0, 1), second = slice(frames, 0, 1, 2);
            return (sum(square(first - codes.expression())) + sum(square(second - first)))
                .value()
                .item();
        }
        if (name == "identity") return 0.2;
        if (name == "side_identity") return 0.4;
        return mask_loss(decoded.mask_logit, mask).value().item();
    }
};

/// Terms with a row in this file or, for those that need a fitted head or a network's weights, in
/// the named test.
const std::set<std::string> rows{"photometric", "regularizer",   "locality", "mask",
                                 "identity",    "side_identity", "time"};
const std::set<std::string> tested_elsewhere{
    "depth",       // test_head_depth.cpp
    "perceptual",  // test_fitter.cpp
};

}  // namespace

TEST_CASE("Every term of the objective has a test", "[fit_objective]") {
    std::set<std::string> names;
    for (const FitTerm& term : fit_terms()) names.emplace(term.name);
    std::set<std::string> tested = rows;
    tested.insert(tested_elsewhere.begin(), tested_elsewhere.end());
    CHECK(names == tested);
}

TEST_CASE("A term has its closed form, its name and its weight", "[fit_objective]") {
    const Case given;
    const FitWeights weights{.regularizer = 0.5,
                             .locality = 3.0,
                             .depth = 1.0,
                             .mask = 0.25,
                             .identity = 1.0,
                             .time = 1.0};
    for (const std::string& name : rows) {
        INFO(name);
        const WorkMeter meter;
        const FitLoss loss = fit_loss(given.comparison(name), weights);
        REQUIRE(loss.terms.size() == 1);
        CHECK(loss.terms.front().first == name);
        CHECK(loss.terms.front().second == Approx(given.value(name)).epsilon(1e-5));
        CHECK(meter.counts().named.at("loss_terms").at(name) == 1);
        const double weight = name == "regularizer"     ? 0.5
                              : name == "locality"      ? 3.0
                              : name == "mask"          ? 0.25
                              : name == "side_identity" ? 2.0
                                                        : 1.0;
        CHECK(loss.total.value().item() == Approx(weight * given.value(name)).epsilon(1e-5));
    }
}

TEST_CASE("A term whose weight is 0 is not computed, and nothing to compare is refused",
          "[fit_objective]") {
    const Case given;
    FitComparison seen = given.comparison("photometric");
    seen.offsets = &given.codes;
    const FitWeights none{.regularizer = 0.0};
    CHECK(fit_loss(seen, none).terms.size() == 1);
    CHECK_THROWS_AS(fit_loss(given.comparison("regularizer"), none), ValueError);
}

}  // namespace fit_objective_tests
