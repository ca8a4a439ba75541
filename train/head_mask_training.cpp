#include "train/head_mask_training.h"

#include <algorithm>
#include <cmath>
#include <iomanip>
#include <limits>
#include <numbers>
#include <sstream>

#include "core/autograd/grad.h"
#include "core/clock.h"
#include "core/error.h"
#include "core/interrupt.h"
#include "core/io/file.h"
#include "core/io/tensor_file.h"
#include "core/progress.h"
#include "nn/optim/adam.h"
#include "nn/optim/ema.h"
#include "train/state_number.h"

namespace stymo {
namespace {

namespace fs = std::filesystem;

constexpr const char* step_key = "step";
constexpr const char* seed_key = "seed";

/// A run's weights, optimiser and averages.
class MaskTraining {
public:
    MaskTraining(const HeadMaskModel& model, const HeadMaskTrainingConfig& config,
                 const HeadMaskRun& run)
        : model_(model),
          config_(config),
          folder_(run.folder),
          parameters_(model.store->trainable()),
          average_(parameters_),
          seed_(run.seed) {}

    [[nodiscard]] std::int64_t step() const { return step_; }

    /// One step of the optimiser; returns the loss.
    double learn(const HeadMaskExamples::Batch& batch) {
        const Variable loss =
            known_mask_loss(model_.network(batch.images), batch.masks, batch.known);
        const double value = loss.value().item();
        if (!std::isfinite(value))
            fail<NumericError>("step ", step_, ": the loss is not finite; lower learning_rate");
        adam_.step(parameters_, grad(loss, variables_of(parameters_)), learning_rate());
        const auto steps = static_cast<double>(step_);
        average_.update(std::min(ema_decay(config_.batch, config_.averaging_half_life),
                                 (1.0 + steps) / (10.0 + steps)));
        ++step_;
        return value;
    }

    void save() {
        TensorFile state;
        model_.store->save(state);
        adam_.save(state, "adam.");
        average_.save(state, "average.");
        state.metadata[step_key] = std::to_string(step_);
        state.metadata[seed_key] = std::to_string(seed_);
        average_.swap();
        write_head_mask_model(folder_ / head_mask_file, model_);
        average_.swap();
        write_tensor_file(folder_ / head_mask_state_file, state);
    }

    void resume() {
        const fs::path path = folder_ / head_mask_state_file;
        if (!fs::exists(path))
            fail<FileError>(path.string(), ": no state to resume from; start without --resume");
        const TensorFile state = read_tensor_file(path);
        const auto seed = state_number<std::uint64_t>(state, path.string(), seed_key);
        if (seed != seed_)
            fail<FileError>(path.string(), ": was trained with --seed ", seed, ", not ", seed_,
                            "; give the same seed");
        const auto step = state_number<std::int64_t>(state, path.string(), step_key);
        model_.store->load(state, path.string());
        adam_.load(state, path.string(), "adam.");
        average_.load(state, path.string(), "average.");
        step_ = step;
    }

private:
    [[nodiscard]] double learning_rate() const {
        constexpr double warm_up_steps = 100.0;
        const auto step = static_cast<double>(step_);
        const double done = step / static_cast<double>(config_.steps);
        return config_.learning_rate * 0.5 * (1.0 + std::cos(std::numbers::pi * done)) *
               std::min(1.0, (step + 1.0) / warm_up_steps);
    }

    const HeadMaskModel& model_;
    const HeadMaskTrainingConfig& config_;
    fs::path folder_;
    std::vector<Parameter> parameters_;
    Adam adam_;
    Ema average_;
    std::uint64_t seed_;
    std::int64_t step_ = 0;
};

}  // namespace

void HeadMaskTrainingConfig::describe(ConfigSchema& schema) {
    schema.integer("steps", steps, 1, 100'000'000, "steps of the optimiser (Adam)");
    schema.integer("batch", batch, 1, 4096, "photos in a step");
    schema.number("learning_rate", learning_rate, 0.0, 1.0, "at the start; falls as a half cosine");
    schema.number("averaging_half_life", averaging_half_life, 1.0, 1e9,
                  "half life of the averaged weights, in images");
    schema.number("checkpoint_minutes", checkpoint_minutes, 0.0, 1e6,
                  "minutes between two checkpoints");
    variation.describe(schema);
}

HeadMaskTrainingConfig HeadMaskTrainingConfig::load(const fs::path& path,
                                                    const std::vector<std::string>& overrides) {
    HeadMaskTrainingConfig config;
    ConfigSchema schema;
    config.describe(schema);
    schema.read_file(path);
    for (const std::string& assignment : overrides) schema.set(assignment);
    return config;
}

HeadMaskTrainingOutcome train_head_mask(const HeadMaskModel& model,
                                        const HeadMaskExamples& examples,
                                        const HeadMaskTrainingConfig& config,
                                        const HeadMaskRun& run) {
    require_writable_folder(run.folder);
    if (!run.resume && fs::exists(run.folder / head_mask_state_file))
        fail<FileError>(run.folder.string(),
                        ": holds a training already; continue it with "
                        "--resume latest or choose another --out");
    model.store->set_trainable("", true);
    MaskTraining training(model, config, run);
    if (run.resume) training.resume();
    const Rng rng(run.seed);
    const InterruptGuard guard;
    const double start = seconds_now();
    double saved = start, recent = 0.0;
    const std::int64_t first = training.step();
    const std::int64_t last =
        run.most_steps > 0 ? std::min(config.steps, first + run.most_steps) : config.steps;
    Progress progress({.title = "train",
                       .total = config.steps * config.batch,
                       .first = first * config.batch,
                       .unit = "images",
                       .time_limit = run.minutes * 60.0});
    const auto late = [&] {
        return run.minutes > 0.0 && seconds_now() - start >= run.minutes * 60.0;
    };
    while (training.step() < last && !interrupted() && !late()) {
        const Rng draws = rng.split(static_cast<std::uint64_t>(training.step()));
        const double loss = training.learn(examples.draw(config.batch, config.variation, draws));
        recent +=
            std::max(0.01, 1.0 / static_cast<double>(training.step() - first)) * (loss - recent);
        std::ostringstream text;
        text << std::fixed << std::setprecision(4) << "loss " << recent;
        progress.update(training.step() * config.batch, text.str());
        if (config.checkpoint_minutes == 0.0 ||
            seconds_now() - saved < 60.0 * config.checkpoint_minutes)
            continue;
        training.save();
        saved = seconds_now();
    }
    training.save();
    // As in Tick::losses, NaN stands for what no step has measured.
    const double loss = training.step() > first ? recent : std::numeric_limits<double>::quiet_NaN();
    return {training.step(), loss, seconds_now() - start, training.step() >= config.steps};
}

}  // namespace stymo
