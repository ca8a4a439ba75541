#include <catch2/catch.hpp>
#include <filesystem>

#include "core/autograd/grad.h"
#include "core/io/scratch_folder.h"
#include "fit/fit_job.h"
#include "nn/models/code_file.h"
#include "nn/realtime/view.h"
#include "support/error_message.h"
#include "support/tiny_model.h"

using namespace stymo;
using namespace stymo::test;

namespace {

/// A face of another model, as a photo that the model does not know.
struct Case {
    Model model = tiny_model(1).copy();
    ReconstructionLoss loss{model.config().reconstruction};

    [[nodiscard]] FaceBatch photo() const {
        const Model other = tiny_model(2).copy();
        const Camera camera = model_camera(model, 0.1, 0.0, 0.0);
        const Tensor image = other.decoder()(random_codes(1, 8), {camera}, {.samples_per_ray = 4})
                                 .images.back()
                                 .value();
        const std::int64_t side = image.shape(1);
        FaceBatch faces{.input = image, .targets = {image}, .cameras = {camera}};
        faces.mask = Tensor::full({1, side, side, 1}, 1.0);
        return faces;
    }
    [[nodiscard]] FitJob job(std::int64_t steps, std::int64_t tuning_steps) const {
        FitJobOptions options;
        options.fit.initial = random_codes(1, 7);
        options.fit.steps = steps;
        options.fit.samples_per_ray = 4;
        options.tuning.steps = tuning_steps;
        options.tuning.anchors = 3;
        return {model, loss, options};
    }
};

bool same_weights(const Model& a, const Model& b) {
    const std::vector<Parameter>& all = a.parameters().all();
    for (std::size_t i = 0; i < all.size(); ++i)
        if (all[i].variable().value().to_vector() !=
            b.parameters().all()[i].variable().value().to_vector())
            return false;
    return true;
}

}  // namespace

TEST_CASE("The tuned decoder of a job has the bits that its file gives other tools", "[fit_job]") {
    const Case given;
    const FittedFaces done = given.job(2, 4).fit(given.photo());
    REQUIRE((done.tuned && done.changes));
    CHECK(done.incomplete.empty());
    const ScratchFolder scratch;
    const std::filesystem::path file = scratch.path() / "tuned.safetensors";
    done.changes->save(file);
    const Model loaded = WeightChanges::load(file).applied_to(given.model);
    CHECK(same_weights(loaded, *done.tuned));
    CHECK_FALSE(same_weights(given.model.copy(ModelParts::decoder), *done.tuned));
}

TEST_CASE("A job without a limit for tuning fits only, and its report says what it compared",
          "[fit_job]") {
    const Case given;
    const FitJob job = given.job(3, 0);
    const FittedFaces done = job.fit(given.photo());
    CHECK_FALSE(done.tuned);
    CHECK(done.fit.losses.size() == 3);
    const FitReport report = job.report(done, 0, done.faces.mask, nullptr);
    const std::string json = to_json(report, done).text();
    CHECK_THAT(json, Catch::Contains("\"terms\"") && Catch::Contains("\"photometric\"") &&
                         Catch::Contains("\"regularizer\""));
    CHECK_THAT(json, !Catch::Contains("\"tuned\""));
}

TEST_CASE("An observer sees each step, and its exception ends the job", "[fit_job]") {
    const Case given;
    std::int64_t fit_steps = 0, tuning_steps = 0;
    bool fitted_before_tuning = false;
    FitObserver observer;
    observer.on_fit_step = [&](const FitStep&) { ++fit_steps; };
    observer.on_fitted = [&](const FitResult& result) {
        fitted_before_tuning = tuning_steps == 0 && result.losses.size() == 3;
    };
    observer.on_tuning_step = [&](const TuningStep&) { ++tuning_steps; };
    static_cast<void>(given.job(3, 2).fit(given.photo(), observer));
    CHECK(fit_steps == 3);
    CHECK(tuning_steps == 2);
    CHECK(fitted_before_tuning);
    struct Stop {};
    observer.on_fit_step = [](const FitStep&) { throw Stop(); };
    CHECK_THROWS_AS(given.job(3, 2).fit(given.photo(), observer), Stop);
}

TEST_CASE("Tuning of a job uses the samples and the tolerance of its fit", "[fit_job]") {
    const Case given;
    FitJobOptions options = given.job(1, 1).options();
    options.fit.samples_per_ray = 6;
    options.fit.tolerance = 0.25;
    const FitJob job(given.model, given.loss, options);
    CHECK(job.options().tuning.samples_per_ray == 6);
    CHECK(job.options().tuning.tolerance == 0.25);
}

TEST_CASE("A copy of a model has its values and is frozen", "[fit_job]") {
    const Model model = tiny_model(3);
    const Model copy = model.copy();
    CHECK(same_weights(model, copy));
    CHECK(copy.parameters().trainable().empty());
    CHECK(copy.has_encoder() == model.has_encoder());
    CHECK_FALSE(model.copy(ModelParts::decoder).has_encoder());
}

TEST_CASE("A fit or a tuning that ends worse than it began is not kept, and says so", "[fit_job]") {
    const Case given;
    FitJobOptions options = given.job(3, 0).options();
    const auto done_with = [&](const FitJobOptions& changed) {
        return FitJob(given.model, given.loss, changed).fit(given.photo());
    };
    CHECK(done_with(options).warnings.empty());

    FitJobOptions wild = options;
    wild.fit.learning_rate = 1e3;
    const FittedFaces thrown = done_with(wild);
    CHECK(thrown.fit.final_loss > thrown.fit.initial_loss);
    REQUIRE(thrown.warnings.size() == 1);
    CHECK_THAT(thrown.warnings.front(),
               Catch::StartsWith("the fit ended no better than it began") &&
                   Catch::Contains("--learning-rate"));
    CHECK(is_one_line(thrown.warnings.front()));
    for (std::size_t group = 0; group < code_names.size(); ++group)
        CHECK(thrown.fit.fitted.groups[group].value().to_vector() ==
              thrown.fit.initial.groups[group].value().to_vector());

    FitJobOptions still = options;
    still.fit.learning_rate = 1e-30;
    CHECK_THAT(done_with(still).warnings.front(), Catch::StartsWith("the fit did not move"));

    options.tuning.steps = 4;
    CHECK(done_with(options).warnings.empty());
    FitJobOptions hurried = options;
    hurried.tuning.steps = 0;
    hurried.tuning.seconds = 1e-6;
    CHECK_THAT(done_with(hurried).warnings.back(),
               Catch::StartsWith("tuning made only 1 step in its time"));
    options.tuning.learning_rate = 10.0;
    const FittedFaces detuned = done_with(options);
    REQUIRE(detuned.warnings.size() == 1);
    CHECK_THAT(detuned.warnings.front(), Catch::Contains("--tune-learning-rate"));
    REQUIRE((detuned.tuned && detuned.changes));
    CHECK(same_weights(*detuned.tuned, given.model.copy(ModelParts::decoder)));
    const ScratchFolder scratch;
    const std::filesystem::path file = scratch.path() / "tuned.safetensors";
    detuned.changes->save(file);
    CHECK(same_weights(WeightChanges::load(file).applied_to(given.model), *detuned.tuned));
    const FitReport report = given.job(3, 0).report(detuned, 0, detuned.faces.mask, nullptr);
    CHECK(report.tuned_metrics.psnr == report.fitted_metrics.psnr);
}

TEST_CASE("With poses of a network the depth is not drawn to a head of another pose", "[fit_job]") {
    const Case given;
    FitJobOptions options = given.job(1, 0).options();
    options.head = "";
    CHECK(FitJob(given.model, given.loss, options).head() != nullptr);
    options.preparation.pose_network = "pose.onnx";
    CHECK(FitJob(given.model, given.loss, options).head() == nullptr);
}

TEST_CASE("Groups of codes that are not fitted keep their bits", "[fit_job]") {
    const Case given;
    FitOptions options = given.job(3, 0).options().fit;
    options.fitted_groups = {false, true, false, false};
    for (const FitOptimizer optimizer : {FitOptimizer::adam, FitOptimizer::lbfgs}) {
        options.optimizer = optimizer;
        const FitResult fit = given.job(3, 0).fit_frames(given.photo(), options);
        for (std::size_t group = 0; group < code_names.size(); ++group)
            CHECK((fit.fitted.groups[group].value().to_vector() ==
                   options.initial->groups[group].value().to_vector()) == (group != 1));
    }
}

TEST_CASE("a photo of few pixels is compared at the side that has them all", "[fit_job]") {
    ModelConfig config = tiny_model_config();
    config.decoder.resolution = 64;
    config.decoder.block_channels = {6, 6, 6};
    config.reconstruction.resolution_weights = {0.0, 0.0, 1.0};
    Rng rng(1);
    const Model model(config, rng);
    const auto face_of = [&](std::int64_t photo_side) {
        const Camera camera = model_camera(model, 0.0, 0.0, 0.0);
        return Face{.id = {},
                    .image = rng.uniform({64, 64, 3}, 0.0, 1.0),
                    .mask = Tensor::full({64, 64, 1}, 1.0),
                    .pose = pose_from_camera(camera),
                    .intrinsics = camera.intrinsics,
                    .photo_side = photo_side,
                    .code = {},
                    .has_mask = true};
    };
    const auto side_of = [&](std::initializer_list<std::int64_t> photo_sides) {
        std::vector<Face> faces;
        for (const std::int64_t side : photo_sides) faces.push_back(face_of(side));
        return compared_side(config.decoder, faces);
    };
    CHECK(side_of({0}) == 64);
    CHECK(side_of({33}) == 64);
    CHECK(side_of({500}) == 64);
    CHECK(side_of({32}) == 32);
    CHECK(side_of({9}) == 16);
    CHECK(side_of({9, 20}) == 32);

    FitJobOptions options;
    options.fit.steps = 2;
    options.tuning.steps = 4;
    options.tuning.anchors = 3;
    const ReconstructionLoss loss(config.reconstruction);
    const FitJob job(model, loss, options);
    const Face small = face_of(20);
    const FittedFaces done = job.fit(job.batch_of({&small, 1}));
    REQUIRE(done.faces.targets.size() == 2);
    REQUIRE(done.tuned);
    REQUIRE_FALSE(done.warnings.empty());
    CHECK_THAT(done.warnings.front(), Catch::Contains("at 32 of 64 pixels"));
    // The mask branch learns the photo's mask at the model's largest side.
    CHECK(std::ranges::count(done.tuning.terms, "mask", &std::pair<std::string, double>::first) ==
          1);
    const FitReport report = job.report(done, 0, done.faces.mask, nullptr);
    CHECK(report.target.shape() == Shape{32, 32, 3});
    CHECK(report.tuned.shape() == Shape{32, 32, 3});
    // The largest image that is compared counts as much as the model's largest image would.
    CHECK(done.fit.losses.front() > 0.1);
}
