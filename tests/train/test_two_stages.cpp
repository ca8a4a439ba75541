#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <limits>
#include <nlohmann/json.hpp>

#include "core/error.h"
#include "core/io/file.h"
#include "core/work_counts.h"
#include "support/check_close.h"
#include "support/error_message.h"
#include "train/plan.h"
#include "train/tiny_training.h"
#include "train/trainer.h"

namespace two_stage_tests {

using namespace stymo;
using namespace stymo::test;
namespace fs = std::filesystem;

// Steps of tiny_two_stage_config: 1 and 2 of the first stage, 3 and 4 at 64 pixels, 5 (fading) and
// 6 at 128.

namespace {

const Dataset& faces() {
    static const Dataset dataset = synthetic_dataset(128);
    return dataset;
}

void train(const TrainConfig& config, const fs::path& folder, const fs::path& resume_from = {},
           const Dataset* validation = nullptr) {
    const RunFolder run(folder, !resume_from.empty());
    Trainer trainer(config, faces(), validation, 5);
    if (!resume_from.empty()) trainer.resume(resume_from);
    CHECK(trainer.run(run, {}).finished);
}

fs::path checkpoint(const fs::path& run, std::int64_t step) {
    return run / "checkpoints" / ("00000" + std::to_string(step));
}

TensorFile state_at(const fs::path& run, std::int64_t step) {
    return read_tensor_file(checkpoint(run, step) / "state.safetensors");
}

TensorFile weights_at(const fs::path& run, std::int64_t step) {
    return read_tensor_file(checkpoint(run, step) / "model.safetensors");
}

/// Whether any tensor below the prefix differs.
bool moved(const TensorFile& before, const TensorFile& after, const std::string& prefix) {
    bool found = false;
    for (const auto& [name, tensor] : before.tensors) {
        if (!name.starts_with(prefix)) continue;
        found = true;
        if (!identical(tensor, after.tensors.at(name))) return true;
    }
    REQUIRE(found);
    return false;
}

/// One run with a checkpoint after each step, for all tests that only look at it.
const fs::path& whole_run() {
    struct Run {
        ScratchFolder folder;
        Run() {
            TrainConfig config = tiny_two_stage_config();
            config.output.checkpoint_steps = 1;
            config.output.keep_last = 10;
            config.output.sample_steps = 4;
            train(config, folder / "run");
            path = folder / "run";
        }
        fs::path path;
    };
    static const Run run;
    return run.path;
}

}  // namespace

TEST_CASE(
    "the first stage makes no discriminator, and LPIPS is made for neither without its weight",
    "[work]") {
    const TrainConfig config = tiny_two_stage_config();
    const Dataset& data = faces();
    const WorkMeter meter;
    Trainer trainer(config, data, nullptr, 5);
    const auto weights = [](const Trainer& of) {
        return std::ssize(of.model().parameters().all());
    };
    static_cast<void>(trainer.step());
    static_cast<void>(trainer.step());
    CHECK(meter.counts().parameters == weights(trainer));
    static_cast<void>(trainer.step());
    CHECK(meter.counts().parameters > weights(trainer));
}

TEST_CASE("without the mask's loss its branch is neither computed nor trained", "[work]") {
    TrainConfig config = tiny_train_config();
    config.model.decoder.resolution = 128;
    config.model.decoder.block_channels = {6, 4};
    config.model.reconstruction.resolution_weights = {0.5, 1.0};
    config.loss.mask_start_epoch = 0;
    const auto operations_of_a_step = [&](double mask_weight) {
        config.loss.mask_weight = mask_weight;
        Trainer trainer(config, faces(), nullptr, 5);
        const WorkMeter meter;
        static_cast<void>(trainer.step());
        const std::vector<Parameter> trained = trainer.model().parameters().trainable();
        const bool any_mask = std::ranges::any_of(
            trained, [](const Parameter& one) { return one.name().starts_with("decoder.mask."); });
        CHECK(any_mask == (mask_weight > 0.0));
        return meter.counts();
    };
    const WorkCounts without = operations_of_a_step(0.0), with = operations_of_a_step(0.1);
    CHECK(without.operations < with.operations);
    CHECK(without.gradient_rules < with.gradient_rules);
    CHECK(without.gradients < with.gradients);
}

TEST_CASE("a step of the second stage encodes each of its photos once, for all its updates",
          "[work]") {
    TrainConfig config = tiny_two_stage_config();
    // Its term reads the photos after they were encoded.
    config.loss.identity_weight = 0.1;
    config.loss.identity_network = "random";
    for (const double adversarial : {0.1, 0.0}) {
        config.loss.adversarial_weight = adversarial;
        Trainer trainer(config, faces(), nullptr, 5);
        for (int step = 0; step < 6; ++step) {
            INFO("adversarial weight " << adversarial << ", step " << step + 1);
            const WorkMeter meter;
            CHECK_FALSE(trainer.step().non_finite);
            CHECK(meter.counts().named.at("evaluations").at("photos_encoded") == 2);
        }
    }
}

TEST_CASE(
    "a run that stops and resumes gives the same bits in both stages and across every change of "
    "phase",
    "[two_stages]") {
    const std::int64_t stop = GENERATE(1, 2, 3, 4, 5);
    const ScratchFolder folder;
    train(tiny_two_stage_config(), folder / "run", checkpoint(whole_run(), stop));
    INFO("stopped after step " << stop);
    for (const char* file : {"checkpoints/000006/model.safetensors",
                             "checkpoints/000006/state.safetensors", "model.safetensors"})
        CHECK(read_file(folder / "run" / file) == read_file(whole_run() / file));
    const std::vector<nlohmann::json> whole = statistics(whole_run());
    const std::vector<nlohmann::json> rest = statistics(folder / "run");
    REQUIRE(whole.size() == 6);
    CHECK(std::vector(whole.begin() + static_cast<std::ptrdiff_t>(stop), whole.end()) == rest);
}

TEST_CASE("each phase trains what takes part in it and leaves the rest alone", "[two_stages]") {
    const fs::path& run = whole_run();
    const auto changed = [&](std::int64_t step, const std::string& prefix) {
        return moved(weights_at(run, step - 1), weights_at(run, step), prefix);
    };
    for (const char* prefix :
         {"encoder.backbone.", "encoder.heads.", "decoder.field.", "decoder.block128."}) {
        INFO(prefix);
        CHECK(changed(2, prefix));
    }
    for (const std::int64_t step : {3, 4, 5, 6}) {
        INFO("step " << step);
        CHECK_FALSE(changed(step, "encoder."));
        for (const char* prefix : {"decoder.field.", "decoder.mapping.", "decoder.block64."})
            CHECK(changed(step, prefix));
        CHECK(changed(step, "decoder.block128.") == (step >= 5));
        CHECK(changed(step, "decoder.mask.") == (step >= 5));
    }
    const auto discriminator_changed = [&](std::int64_t step, const std::string& prefix) {
        return moved(state_at(run, step - 1), state_at(run, step), "discriminator." + prefix);
    };
    CHECK(discriminator_changed(4, "from_rgb64."));
    CHECK(discriminator_changed(4, "block64."));
    CHECK_FALSE(discriminator_changed(4, "from_rgb128."));
    CHECK_FALSE(discriminator_changed(4, "block128."));
    CHECK(has_prefix(state_at(run, 4), "discriminator_adam.discriminator.block64."));
    CHECK_FALSE(has_prefix(state_at(run, 4), "discriminator_adam.discriminator.block128."));
    for (const char* prefix : {"from_rgb64.", "from_rgb128.", "block64.", "block128."})
        CHECK(discriminator_changed(5, prefix));
    // The new block has faded in.
    CHECK_FALSE(discriminator_changed(6, "from_rgb64."));
    CHECK(discriminator_changed(6, "block128."));
}

TEST_CASE("the discriminator steps once more where R1 is due, with what it remembers of both",
          "[two_stages]") {
    const auto steps_of = [](std::int64_t step, const std::string& name) {
        return state_at(whole_run(), step)
            .tensors.at("discriminator_adam.discriminator." + name + ".steps")
            .item();
    };
    // An interval of two, counted within each phase: R1 at steps 3 and 5.
    CHECK(steps_of(3, "from_rgb64.weight") == 2.0);
    CHECK(steps_of(4, "from_rgb64.weight") == 3.0);
    CHECK(steps_of(5, "from_rgb64.weight") == 5.0);
    CHECK(steps_of(6, "from_rgb64.weight") == 5.0);
    CHECK(steps_of(5, "from_rgb128.weight") == 2.0);
    CHECK(steps_of(6, "from_rgb128.weight") == 3.0);
    const std::vector<nlohmann::json> lines = statistics(whole_run());
    CHECK(lines[2]["r1"].get<double>() > 0.0);
    CHECK(lines[3]["r1"].get<double>() == 0.0);
}

TEST_CASE("what a step of the second stage reports goes to the statistics", "[two_stages]") {
    const std::vector<nlohmann::json> lines = statistics(whole_run());
    CHECK_FALSE(lines[1].contains("discriminator"));
    for (std::size_t i = 2; i < 6; ++i) {
        const nlohmann::json& line = lines[i];
        CHECK(line["stage"] == 2);
        CHECK(line["resolution"] == (i < 4 ? 64 : 128));
        CHECK(line["fade"] == (i == 4 ? 0.5 : 1.0));
        CHECK(line["code"] == 0.0);
        CHECK((line["mask"].get<double>() > 0.0) == (i >= 4));
        for (const char* term : {"reconstruction", "photometric", "adversarial", "discriminator"})
            CHECK(line[term].get<double>() > 0.0);
        for (const char* term : {"real_logit", "fake_logit"})
            CHECK(line[term].get<double>() != 0.0);
    }
    CHECK(fs::exists(whole_run() / "samples/000004.png"));
}

TEST_CASE(
    "the average of the second stage is the moving average of the weights after each of its steps",
    "[two_stages]") {
    const std::string name = "decoder.field.density.weight";
    const fs::path& run = whole_run();
    std::vector<double> average = state_at(run, 2).tensors.at("average." + name).to_vector();
    const double decay = std::pow(0.5, 2.0 / 6.0);
    for (const std::int64_t step : {3, 4}) {
        const std::vector<double> weights = weights_at(run, step).tensors.at(name).to_vector();
        const std::vector<double> stored =
            state_at(run, step).tensors.at("average." + name).to_vector();
        for (std::size_t i = 0; i < average.size(); ++i) {
            average[i] = decay * average[i] + (1.0 - decay) * weights[i];
            CHECK(stored[i] == Approx(average[i]).epsilon(1e-5).margin(1e-7));
        }
    }
}

TEST_CASE("a finished first stage goes on with a second one, with and without a discriminator",
          "[two_stages]") {
    const ScratchFolder folder;
    TrainConfig first = tiny_two_stage_config();
    first.stage2.resolutions = {};
    train(first, folder / "first");
    train(tiny_two_stage_config(), folder / "both", checkpoint(folder / "first", 2));
    CHECK(read_file(checkpoint(folder / "both", 6) / "state.safetensors") ==
          read_file(checkpoint(whole_run(), 6) / "state.safetensors"));

    TrainConfig without = tiny_two_stage_config();
    without.loss.adversarial_weight = 0.0;
    without.output.checkpoint_steps = 1;
    without.output.keep_last = 10;
    without.stage2.average_half_life = 0.0;
    train(without, folder / "without", checkpoint(folder / "first", 2));
    CHECK_FALSE(has_prefix(state_at(folder / "without", 4), "discriminator"));
    CHECK_FALSE(has_prefix(state_at(folder / "without", 4), "average."));
    CHECK(moved(weights_at(folder / "without", 3), weights_at(folder / "without", 4),
                "decoder.field."));
    CHECK(statistics(folder / "without").front()["adversarial"] == 0.0);

    train(tiny_two_stage_config(), folder / "late", checkpoint(folder / "without", 4));
    CHECK(has_prefix(state_at(folder / "late", 6), "discriminator.block64."));
    CHECK(has_prefix(state_at(folder / "late", 6), "average."));
}

TEST_CASE(
    "a step of the second stage with a gradient that is not finite changes nothing, and too many "
    "of them end the run",
    "[two_stages]") {
    TrainConfig config = tiny_two_stage_config();
    config.stage1.steps = 0;
    config.optimizer.failures_allowed = 1;
    Trainer trainer(config, faces(), nullptr, 5);
    const StepReport healthy_step = trainer.step();
    const auto& all = trainer.model().parameters().all();
    const auto broken = std::ranges::find(all, "decoder.field.density.bias", &Parameter::name);
    REQUIRE(broken != all.end());
    const Tensor healthy = broken->variable().value();
    broken->set_value(Tensor::full(healthy.shape(), std::numeric_limits<double>::quiet_NaN()));
    std::vector<Tensor> before;
    for (const Parameter& parameter : all) before.push_back(parameter.variable().value());
    const StepReport report = trainer.step();
    CHECK(report.non_finite.has_value());
    Tick tick;
    CHECK(std::isnan(tick.losses().total));
    CHECK(std::isnan(tick.losses()["reconstruction"]));
    tick.add(healthy_step);
    tick.add(report);
    CHECK(tick.steps() == 1);
    CHECK(tick.losses().total == healthy_step.losses.total);
    CHECK(trainer.state().failures == 1);
    for (std::size_t i = 0; i < all.size(); ++i)
        CHECK(identical(all[i].variable().value(), before[i]));
    const std::string message =
        error_message<NumericError>([&] { static_cast<void>(trainer.step()); });
    CHECK(is_one_line(message));
    CHECK_THAT(message,
               Catch::Contains("2 steps in a row") && Catch::Contains("stage2.learning_rate"));
}

TEST_CASE("a discriminator's update is taken back if the decoder's fails after it",
          "[two_stages]") {
    TrainConfig config = tiny_two_stage_config();
    config.stage1.steps = 0;
    config.optimizer.failures_allowed = 10;
    config.loss.opacity_weight = 1e300;
    const ScratchFolder folder;
    train(config, folder / "run");
    CHECK(state_at(folder / "run", 4).metadata.at("failures") == "4");
    CHECK_FALSE(has_prefix(state_at(folder / "run", 4), "discriminator_adam."));
    CHECK_FALSE(has_prefix(state_at(folder / "run", 4), "generator_adam."));
    CHECK_FALSE(moved(state_at(folder / "run", 2), state_at(folder / "run", 4), "discriminator."));
}

TEST_CASE("the best model is chosen anew at each resolution, by its reconstruction loss",
          "[two_stages]") {
    const ScratchFolder folder;
    const Dataset validation = synthetic_dataset(128);
    TrainConfig config = tiny_two_stage_config();
    train(config, folder / "run", {}, &validation);
    CHECK(state_at(folder / "run", 2).metadata.at("best_resolution") == "128");
    CHECK(state_at(folder / "run", 4).metadata.at("best_resolution") == "64");
    CHECK(state_at(folder / "run", 6).metadata.at("best_resolution") == "128");
    CHECK(std::stod(state_at(folder / "run", 6).metadata.at("best_validation")) < 10.0);
    CHECK(fs::exists(folder / "run/best.safetensors"));
    CHECK_THAT(
        read_file(folder / "run/log.txt"),
        Catch::Contains("validation at 64 pixels: reconstruction") && Catch::Contains("PSNR"));
}

TEST_CASE("the plan of both stages counts the discriminator and measures what it is asked to",
          "[two_stages]") {
    const TrainConfig config = tiny_two_stage_config();
    const auto plan_of = [&](MeasuredPhases measured) {
        Trainer trainer(config, faces(), nullptr, 5);
        return measure_plan(trainer, config, faces(), measured);
    };
    const TrainingPlan plan = plan_of(MeasuredPhases::ends);
    CHECK(plan.discriminator_parameters > 0);
    REQUIRE(plan.phases.size() == 3);
    CHECK((plan.phases[0].measured && !plan.phases[1].measured && plan.phases[2].measured));
    CHECK(plan.phases[2].step_seconds > 0.0);
    CHECK_THAT(plan_text(plan), Catch::Contains("discriminator") &&
                                    Catch::Contains("stage 2,   64 2 steps of 2 images"));
    for (const PhasePlan& phase : plan_of(MeasuredPhases::none).phases) CHECK_FALSE(phase.measured);
}

TEST_CASE("the peak memory of a phase is not that of what came before", "[two_stages]") {
    constexpr std::size_t mebibytes = 1024;
    { const std::vector<char> released(mebibytes << 20U, 'x'); }
    const TrainConfig config = tiny_two_stage_config();
    Trainer trainer(config, faces(), nullptr, 5);
    const TrainingPlan plan = measure_plan(trainer, config, faces(), MeasuredPhases::ends);
    const std::optional<double> peak = plan.phases[0].peak_megabytes;
    if (peak) CHECK((*peak > 0.0 && *peak < double(mebibytes)));
    CHECK_THAT(plan_text(plan), Catch::Contains(peak ? " MiB\n  all steps" : "not measured"));
    CHECK((to_json(plan).text().find("peak_megabytes") != std::string::npos) == peak.has_value());
}

TEST_CASE("random weights of LPIPS are reported as such by the plan and by the run",
          "[two_stages]") {
    TrainConfig config = tiny_two_stage_config();
    config.stage2.resolutions = {};
    config.stage1.steps = 1;
    config.model.reconstruction.perceptual_weight = 0.1;
    config.model.reconstruction.perceptual = {
        .network = "squeezenet1_1", .trunk = "random", .heads = "random"};
    const ScratchFolder folder;
    train(config, folder / "run");
    CHECK_THAT(read_file(folder / "run/log.txt"),
               Catch::Contains("LPIPS: squeezenet1_1, random weights"));

    Trainer trainer(config, faces(), nullptr, 5);
    const TrainingPlan plan = measure_plan(trainer, config, faces(), MeasuredPhases::none);
    CHECK(plan.lpips_network == "squeezenet1_1, random weights");
    CHECK_THAT(plan_text(plan), Catch::Contains("LPIPS         squeezenet1_1, random weights"));
    CHECK(nlohmann::json::parse(to_json(plan).text())["lpips_network"] ==
          "squeezenet1_1, random weights");
}

}  // namespace two_stage_tests
