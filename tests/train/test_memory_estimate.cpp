#include <algorithm>
#include <catch2/catch.hpp>

#ifdef __GLIBC__
#include <malloc.h>
#endif

#include <fstream>
#include <optional>

#include "core/autograd/grad.h"
#include "core/error.h"
#include "core/machine_limits.h"
#include "core/ops/ops.h"
#include "support/check_close.h"
#include "support/thread_count.h"
#include "train/memory_estimate.h"
#include "train/step_gradients.h"
#include "train/tiny_training.h"
#include "train/trainer.h"

using namespace stymo;
using namespace stymo::test;
using Catch::Matchers::Contains;

namespace {

constexpr double mebibyte = 1024.0 * 1024.0;

TrainingPhase phase_of(const TrainConfig& config, int stage, std::int64_t micro_batch) {
    return {.stage = stage,
            .resolution = config.model.decoder.resolution,
            .micro_batch = micro_batch,
            .samples_per_ray =
                stage == 1 ? config.stage1.samples_per_ray : config.stage2.samples_per_ray};
}

/// The paper's network without a perceptual term.
TrainConfig paper() {
    TrainConfig config;
    config.model.reconstruction.perceptual_weight = 0.0;
    return config;
}

/// A model and its loss, of which the estimate adds up the layers.
struct Estimated {
    TrainConfig config;
    Model model;
    ReconstructionLoss loss;

    explicit Estimated(const TrainConfig& made)
        : config(made),
          model([&] {
              Rng rng(1);
              return Model(made.model, rng);
          }()),
          loss(made.model.reconstruction) {}

    [[nodiscard]] StepMemory memory(const TrainingPhase& phase,
                                    const Recomputation& recomputation) const {
        return estimate_step_memory(model, loss, config, phase, {.recomputation = recomputation});
    }
    [[nodiscard]] Recomputation chosen(const TrainingPhase& phase) const {
        return choose_execution(model, loss, config, phase).recomputation;
    }
    [[nodiscard]] double peak(int stage, std::int64_t micro_batch,
                              const Recomputation& recomputation) const {
        return static_cast<double>(
            memory(phase_of(config, stage, micro_batch), recomputation).peak());
    }
};

#ifdef STYMO_TEST_SANITIZED
constexpr bool keeps_what_is_freed = true;
#else
constexpr bool keeps_what_is_freed = false;
#endif

/// What `work` takes at most beyond what the process holds already, in bytes; nothing where the
/// system does not say. The largest of three measurements: one is too small if the work finds
/// pages that the heap has kept, or if the system takes back pages of files meanwhile.
template <class Work>
std::optional<double> measured_peak(const Work& work) {
    if (keeps_what_is_freed) return std::nullopt;
    double largest = 0.0;
    for (int i = 0; i < 3; ++i) {
#ifdef __GLIBC__
        malloc_trim(0);  // else it would take what other tests have left
#endif
        std::ofstream("/proc/self/clear_refs") << "5";
        const double before = process_memory("VmRSS:");
        if (before == 0.0 || process_memory("VmHWM:") > before + 8.0 * mebibyte)
            return std::nullopt;
        work();
        largest = std::max(largest, process_memory("VmHWM:") - before);
    }
    return largest;
}

}  // namespace

TEST_CASE("every backbone and perceptual network says what its backward pass needs", "[memory]") {
    for (const std::string& name : backbone_names()) {
        ParameterStore store;
        Rng rng(1);
        CHECK(make_backbone(name, store, "", rng)->saved() > 0);
    }
    for (const std::string& network : lpips_networks())
        CHECK(Lpips(LpipsConfig{network, "random", "random"}, "").memory(64).transient > 0);
}

TEST_CASE("what is learnt for each photo counts with its gradients and moments", "[memory]") {
    const Estimated estimated(paper());
    constexpr std::int64_t numbers = 1'000'000, bytes = 4;
    const auto added = [&](int stage) {
        const TrainingPhase phase = phase_of(estimated.config, stage, 1);
        const auto persistent = [&](std::int64_t offsets) {
            return estimate_step_memory(estimated.model, estimated.loss, estimated.config, phase,
                                        {}, offsets)
                .persistent;
        };
        return persistent(numbers) - persistent(0);
    };
    CHECK(added(1) >= 5 * numbers * bytes);  // values, two moments, a gradient and its sum
    CHECK(added(2) == numbers * bytes);
}

TEST_CASE("micro-batches run side by side where the budget holds them all", "[memory]") {
    const ThreadCount before;
    set_thread_count(2);
    Estimated estimated(paper());
    TrainingPhase phase = phase_of(estimated.config, 1, 1);
    phase.batch = 4;
    const auto peak = [&](bool side_by_side) {
        const StepMemory memory =
            estimate_step_memory(estimated.model, estimated.loss, estimated.config, phase,
                                 {.recomputation = {}, .side_by_side = side_by_side});
        return static_cast<double>(memory.peak());
    };
    const auto chosen = [&](double bytes) {
        estimated.config.memory.budget_gibibytes = 1.25 * bytes / (1024.0 * mebibyte);
        return choose_execution(estimated.model, estimated.loss, estimated.config, phase);
    };
    REQUIRE(peak(true) > 1.2 * peak(false));
    CHECK(chosen(1.01 * peak(true)).at_once(phase) == 2);
    const StepExecution one_by_one = chosen(0.99 * peak(true));
    CHECK(one_by_one.at_once(phase) == 1);
    CHECK_FALSE(one_by_one.recomputation.blocks);
    CHECK(chosen(0.99 * peak(false)).recomputation.blocks);
    phase.batch = 1;
    CHECK(chosen(100.0 * peak(true)).at_once(phase) == 1);
}

TEST_CASE("another photo of the person takes a second pass through the encoder", "[memory]") {
    TrainConfig config = paper();
    config.model.encoder.backbone = "small_conv";
    Estimated estimated(config);
    const auto generator = [&](int stage) {
        return static_cast<double>(
            estimated.memory(phase_of(estimated.config, stage, 2), {}).generator);
    };
    const double first = generator(1), second = generator(2);
    estimated.config.data.other_photo = 0.5;
    const std::int64_t side = config.model.decoder.resolution;
    const double photo = 2.0 * 3.0 * static_cast<double>(side * side);
    const auto pass = static_cast<double>(2 * estimated.model.encoder().backbone().saved());
    constexpr double bytes_of_a_number = 4.0 * 1.15;  // with what the heap loses
    CHECK(generator(1) - first == Approx(bytes_of_a_number * (photo + pass)));
    CHECK(generator(2) - second == Approx(bytes_of_a_number * photo));
}

TEST_CASE("what lasts is the weights with gradients, moments and averages", "[memory]") {
    TrainConfig config = paper();
    config.model.encoder.backbone = "mobilefacenet";
    Estimated estimated(config);
    const auto persistent = [&](int stage) {
        return static_cast<double>(
                   estimated.memory(phase_of(estimated.config, stage, 1), {}).persistent) -
               120.0 * mebibyte;
    };
    estimated.config.stage1.average_half_life = 0.0;
    const auto weights = static_cast<double>(4 * estimated.model.parameters().element_count());
    CHECK(persistent(1) == Approx(5.0 * weights).epsilon(0.05));
    estimated.config.stage1.average_half_life = 1000.0;
    CHECK(persistent(1) == Approx(6.0 * weights).epsilon(0.05));

    estimated.config.discriminator.max_channels = 64;
    ParameterStore store;
    Rng rng(1);
    const Discriminator discriminator(estimated.config.discriminator, 512, store, "discriminator",
                                      rng);
    const double with = persistent(2);
    estimated.config.loss.adversarial_weight = 0.0;
    CHECK(with - persistent(2) ==
          Approx(static_cast<double>(8 * 4 * store.element_count())).epsilon(0.02));
}

namespace {

/// Holds the estimate of a step of the decoder with two images against what it takes.
void check_estimate(const TrainConfig& config, const Recomputation& recomputation) {
    const Estimated estimated(config);
    const Model& model = estimated.model;
    const std::vector<Variable> leaves = variables_of(model.parameters().trainable());
    Codes codes = random_codes(2, 3);
    const std::vector<Camera> cameras(2, camera_from_pose(orbit_pose(0.0, 0.0, 0.0, 5.3), {}));
    const auto peak_of_step = measured_peak([&] {
        const Decoded decoded =
            model.decoder()(codes, cameras,
                            {.samples_per_ray = config.stage1.samples_per_ray,
                             .mask = true,
                             .gradient_tolerance = config.optimizer.sample_tolerance,
                             .keep_field = !recomputation.field,
                             .recompute_blocks = recomputation.blocks});
        Variable loss = mean(square(decoded.mask_logit));
        for (const Variable& image : decoded.images) loss = loss + mean(square(image));
        CHECK(grad(loss, leaves).size() == leaves.size());
    });
    if (!peak_of_step) {
        WARN("skipped: the system does not tell the peak of a part of the run");
        return;
    }
    const StepMemory memory = estimated.memory(phase_of(config, 1, 2), recomputation);
    CAPTURE(recomputation.blocks, recomputation.field, *peak_of_step / mebibyte);
    CHECK(static_cast<double>(memory.generator) / mebibyte ==
          Approx(*peak_of_step / mebibyte).epsilon(0.25).margin(16.0));
}

TrainConfig narrow_paper(std::int64_t resolution) {
    TrainConfig config = paper();
    config.model.encoder.backbone = "small_conv";
    config.model.decoder.resolution = resolution;
    config.model.decoder.field_width = 128;
    config.stage1.samples_per_ray = 8;
    return config;
}

}  // namespace

TEST_CASE("the estimate is within a quarter of what a step takes", "[memory]") {
    for (const Recomputation& recomputation :
         {Recomputation{}, Recomputation{true}, Recomputation{true, true}})
        check_estimate(narrow_paper(256), recomputation);
    TrainConfig tolerant = narrow_paper(256);
    tolerant.optimizer.sample_tolerance = 0.001;
    check_estimate(tolerant, {});
}

TEST_CASE(
    "the estimate is within a quarter of what a step of a decoder with concatenated codes takes",
    "[memory]") {
    for (const std::string render : {"blocks", "none"}) {
        CAPTURE(render);
        TrainConfig config = narrow_paper(render == "blocks" ? 256 : 128);
        config.model.decoder.conditioning = "concatenation";
        config.model.decoder.render = render;
        config.model.decoder.field_layers = 2;
        check_estimate(config, {});
    }
}

TEST_CASE(
    "a smaller budget recomputes first the render blocks, then the field too, and one that is too "
    "small is refused",
    "[memory]") {
    TrainConfig config = paper();
    config.model.encoder.backbone = "small_conv";
    Estimated estimated(config);
    const TrainingPhase phase = phase_of(config, 1, 8);
    CHECK_FALSE(estimated.chosen(phase).blocks);

    const auto choice = [&](double bytes) {
        estimated.config.memory.budget_gibibytes = bytes / (1024.0 * mebibyte);
        return estimated.chosen(phase);
    };
    double previous = estimated.peak(1, 8, {});
    for (const Recomputation& wanted : {Recomputation{true, false}, Recomputation{true, true}}) {
        const double needed = estimated.peak(1, 8, wanted);
        CHECK(needed < previous);
        previous = needed;
        const Recomputation chosen = choice(1.25 * needed + mebibyte);
        CHECK(chosen.blocks);
        CHECK(chosen.field == wanted.field);
    }
    CHECK_THROWS_AS(choice(200.0 * mebibyte), ConfigError);
    CHECK_THROWS_WITH(choice(200.0 * mebibyte), Contains("memory.budget_gibibytes") &&
                                                    Contains("8 images at once; it needs"));
}

TEST_CASE("a trainer whose steps do not fit the memory budget is refused", "[memory]") {
    TrainConfig config = tiny_train_config();
    config.memory.budget_gibibytes = 0.05;
    const Dataset faces = synthetic_dataset();
    CHECK_THROWS_WITH(Trainer(config, faces, nullptr, 5),
                      Contains("memory.budget_gibibytes = 0.05") && Contains("it needs"));
    config.memory.budget_gibibytes = 12.0;
    CHECK_NOTHROW(Trainer(config, faces, nullptr, 5));
}

TEST_CASE("a trainer chooses once how the steps of a phase are computed", "[memory]") {
    TrainConfig config = tiny_train_config();
    const Dataset faces = synthetic_dataset();
    const auto first_phase = [&] {
        const Trainer trainer(config, faces, nullptr, 5);
        return trainer.schedule().position(1).phase;
    };
    CHECK_FALSE(first_phase().execution.recomputation.field);
    const Estimated estimated(config);
    const double least = static_cast<double>(
        estimated.memory(first_phase(), {.blocks = true, .field = true}).peak());
    config.memory.budget_gibibytes = (1.25 * least + 1.0) / (1024.0 * mebibyte);
    CHECK(first_phase().execution.recomputation.blocks);
    CHECK(first_phase().execution.recomputation.field);
}

TEST_CASE("both stages of the paper fit twelve gibibytes", "[memory]") {
    TrainConfig config;
    config.memory.budget_gibibytes = 12.0;
    config.model.reconstruction.perceptual.trunk = "random";
    config.model.reconstruction.perceptual.heads = "random";
    const Estimated estimated(config);
    const TrainingSchedule schedule(config);
    for (const TrainingPhase& phase : schedule.phases()) {
        CAPTURE(phase.stage, phase.resolution);
        CHECK(estimated.memory(phase, estimated.chosen(phase)).peak() <= std::int64_t{12} << 30);
    }
}

TEST_CASE("a training step within a budget has the gradients of one without", "[memory]") {
    TrainConfig config = tiny_train_config();
    config.loss.mask_weight = 0.5;
    const Dataset faces = synthetic_dataset();
    const FaceBatch batch = make_batch(std::vector{faces.load(0), faces.load(1)});
    Rng weights(1);
    const Model model(config.model, weights);
    const ReconstructionLoss reconstruction(config.model.reconstruction);
    const Estimated estimated(config);
    const auto result_with = [&](double bytes) {
        config.memory.budget_gibibytes = bytes / (1024.0 * mebibyte);
        Rng jitter(2);
        TrainingPosition position = TrainingSchedule(config).position(0);
        position.mask_loss = true;
        position.phase.execution = choose_execution(model, reconstruction, config, position.phase);
        return generator_gradients({model, reconstruction, config}, position, batch,
                                   model.parameters().trainable(), jitter);
    };
    const LossAndGradients kept = result_with(0.0);
    const LossAndGradients recomputed =
        result_with(1.25 * estimated.peak(1, 2, {true, true}) + 1.0);
    CHECK(choose_execution(model, reconstruction, config, phase_of(config, 1, 2))
              .recomputation.field);
    CHECK(recomputed.losses.total == Approx(kept.losses.total).epsilon(1e-6));
    for (std::size_t i = 0; i < kept.gradients.size(); ++i) {
        const CloseReport report =
            check_close(recomputed.gradients[i].value(), kept.gradients[i].value(), 1e-4);
        INFO(report.message);
        CHECK(report.passed);
    }
}
