#include "train/trainer.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <iomanip>
#include <numbers>
#include <numeric>
#include <sstream>

#include "core/error.h"
#include "core/interrupt.h"
#include "core/metrics.h"
#include "core/ops/elementwise.h"
#include "core/progress.h"
#include "nn/models/picture.h"
#include "nn/optim/schedule.h"
#include "train/sample_sheet.h"

namespace stymo {

namespace {

constexpr const char* backbone_prefix = "encoder.backbone.";

double seconds_now() {
    return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count();
}

Model initial_model(const ModelConfig& config, const Rng& rng) {
    Rng weights = rng.split("weights");
    return {config, weights};
}

/// Order of the images in one pass over them.
std::vector<std::int64_t> shuffled(std::int64_t count, Rng rng) {
    std::vector<std::int64_t> order(static_cast<std::size_t>(count));
    std::iota(order.begin(), order.end(), 0);
    for (std::int64_t i = count - 1; i > 0; --i)
        std::swap(order[static_cast<std::size_t>(i)], order[static_cast<std::size_t>(rng.below(i + 1))]);
    return order;
}

std::string tick_text(const LossTerms& losses) {
    std::ostringstream text;
    text << std::fixed << std::setprecision(4) << "loss " << losses.total << ", reconstruction " << losses.reconstruction;
    return text.str();
}

JsonValue tick_json(std::int64_t step, double epoch, double learning_rate, double images_per_second, const LossTerms& losses) {
    return JsonValue::object({{"step", step},
                              {"epoch", epoch},
                              {"learning_rate", learning_rate},
                              {"images_per_second", images_per_second},
                              {"loss", losses.total},
                              {"reconstruction", losses.reconstruction},
                              {"code", losses.code},
                              {"mask", losses.mask},
                              {"opacity", losses.opacity},
                              {"depth_variance", losses.depth_variance},
                              {"code_norm", losses.code_norm}});
}

}  // namespace

Trainer::Trainer(const TrainConfig& config, const Dataset& training, const Dataset* validation, std::uint64_t seed)
    : config_(config),
      training_(training),
      validation_(validation),
      rng_(seed),
      model_(initial_model(config.model, rng_)),
      adam_({config.optimizer.beta1, config.optimizer.beta2, config.optimizer.epsilon}) {
    state_.seed = seed;
    if (config.stage1.average_half_life > 0.0) average_.emplace(model_.parameters().all());
    set_trainable_parts();
}

Trainer::EvaluationScope::EvaluationScope(Trainer& trainer) : trainer_(trainer) {
    if (trainer_.average_) trainer_.average_->swap();
    trainer_.model_.parameters().set_trainable("", false);
}

Trainer::EvaluationScope::~EvaluationScope() {
    if (trainer_.average_) trainer_.average_->swap();
    trainer_.set_trainable_parts();
}

double Trainer::epochs_at(std::int64_t step) const {
    return static_cast<double>(step) * static_cast<double>(config_.stage1.batch) / static_cast<double>(training_.size());
}

double Trainer::learning_rate() const {
    const OptimizerConfig& optimizer = config_.optimizer;
    if (optimizer.schedule == "cosine") {
        const double part = std::min(
            1.0, static_cast<double>(state_.step) / static_cast<double>(std::max<std::int64_t>(1, config_.stage1.steps)));
        return optimizer.learning_rate * 0.5 * (1.0 + std::cos(std::numbers::pi * part));
    }
    return optimizer.learning_rate * std::pow(optimizer.decay, std::floor(epochs_at(state_.step)));
}

TrainingBatch Trainer::batch_at(std::int64_t first_image) const {
    std::vector<Face> faces;
    std::int64_t epoch = -1;
    std::vector<std::int64_t> order;
    for (std::int64_t number = first_image; number < first_image + config_.stage1.micro_batch; ++number) {
        if (number / training_.size() != epoch) {
            epoch = number / training_.size();
            order = shuffled(training_.size(), rng_.split("order").split(static_cast<std::uint64_t>(epoch)));
        }
        Face face = training_.load(order[static_cast<std::size_t>(number % training_.size())]);
        const bool mirror = config_.data.mirror && rng_.split("mirror").split(static_cast<std::uint64_t>(number)).below(2) == 1;
        faces.push_back(mirror ? mirrored(face) : std::move(face));
    }
    return make_batch(faces);
}

void Trainer::set_trainable_parts() {
    model_.parameters().set_trainable("", true);
    const bool frozen = epochs_at(state_.step) < static_cast<double>(config_.optimizer.backbone_frozen_epochs) &&
                        !config_.model.encoder.backbone_weights.empty();
    model_.parameters().set_trainable(backbone_prefix, !frozen);
}

LossTerms Trainer::step() {
    set_trainable_parts();
    const std::vector<Parameter> parameters = model_.parameters().trainable();
    const std::int64_t micro_batches = config_.stage1.batch / config_.stage1.micro_batch;
    const double part = 1.0 / static_cast<double>(micro_batches);
    LossTerms losses;
    std::vector<Variable> gradients;
    Rng jitter = rng_.split("jitter").split(static_cast<std::uint64_t>(state_.step));
    for (std::int64_t micro = 0; micro < micro_batches; ++micro) {
        const TrainingBatch batch = batch_at(state_.step * config_.stage1.batch + micro * config_.stage1.micro_batch);
        const LossAndGradients result = reconstruction_gradients(model_, batch, config_, parameters, state_.mask_loss, jitter);
        losses.accumulate(result.losses, part);
        for (std::size_t i = 0; i < result.gradients.size(); ++i) {
            const Variable share = result.gradients[i] * part;
            if (micro == 0) {
                gradients.push_back(share);
            } else {
                gradients[i] = gradients[i] + share;
            }
        }
    }
    if (std::isfinite(losses.total) && !first_non_finite(parameters, gradients)) {
        state_.failures = 0;
        apply(parameters, gradients);
    } else {
        ++state_.failures;
        if (state_.failures > config_.stage1.failures_allowed) {
            fail<NumericError>("step ", state_.step, ": ", first_non_finite(parameters, gradients).value_or("the loss"),
                               " is not finite, ", state_.failures, " steps in a row; lower optimizer.learning_rate");
        }
    }
    ++state_.step;
    count_epoch(losses.reconstruction);
    return losses;
}

void Trainer::apply(const std::vector<Parameter>& parameters, const std::vector<Variable>& gradients) {
    const double rate = learning_rate();
    for (const bool backbone : {false, true}) {
        std::vector<Parameter> group;
        std::vector<Variable> group_gradients;
        for (std::size_t i = 0; i < parameters.size(); ++i) {
            if (parameters[i].name().starts_with(backbone_prefix) != backbone) continue;
            group.push_back(parameters[i]);
            group_gradients.push_back(gradients[i]);
        }
        adam_.step(group, group_gradients, backbone ? rate * config_.optimizer.backbone_factor : rate);
    }
    if (average_) {
        // While the run is young the average follows closely, else it would remember the random start.
        const double images = static_cast<double>((state_.step + 1) * config_.stage1.batch);
        average_->update(ema_decay(config_.stage1.batch, std::min(config_.stage1.average_half_life, 0.1 * images)));
    }
}

void Trainer::count_epoch(double reconstruction_loss) {
    if (std::isfinite(reconstruction_loss)) {
        state_.epoch_loss_sum += reconstruction_loss;
        ++state_.epoch_loss_count;
    }
    const double epochs = std::floor(epochs_at(state_.step));
    if (epochs > std::floor(epochs_at(state_.step - 1)) && state_.epoch_loss_count > 0) {
        state_.epoch_losses.push_back(state_.epoch_loss_sum / static_cast<double>(state_.epoch_loss_count));
        state_.epoch_loss_sum = 0.0;
        state_.epoch_loss_count = 0;
        const std::vector<double>& history = state_.epoch_losses;
        const std::size_t count = history.size();
        const bool stable = count >= 3 && history[count - 1] > (1.0 - config_.loss.mask_start_improvement) *
                                                                   std::min(history[count - 2], history[count - 3]);
        state_.mask_loss = state_.mask_loss || (stable && config_.loss.mask_start_improvement > 0.0);
    }
    state_.mask_loss = state_.mask_loss || epochs >= static_cast<double>(config_.loss.mask_start_epoch);
}

std::optional<double> Trainer::validate() const {
    const std::int64_t count = validation_ == nullptr ? 0 : std::min(config_.output.validation_images, validation_->size());
    if (count == 0) return std::nullopt;
    double total = 0.0;
    for (std::int64_t index = 0; index < count; ++index) {
        const TrainingBatch batch = make_batch(std::vector{validation_->load(index)});
        const Codes codes = model_.encoder()(Variable(batch.input));
        const Decoded decoded = model_.decoder()(codes, batch.cameras, {.samples_per_ray = config_.stage1.samples_per_ray});
        const Tensor image = masked_picture(picture(decoded.images.back().value(), 0), picture_mask(batch.mask, 0));
        total += peak_signal_to_noise_ratio(image, picture(batch.targets.back(), 0));
    }
    return total / static_cast<double>(count);
}

void Trainer::resume(const std::filesystem::path& folder) {
    Checkpoint checkpoint = read_checkpoint(folder, model_);
    if (checkpoint.state.seed != state_.seed) {
        fail<FileError>(folder.string(), ": was trained with --seed ", checkpoint.state.seed, ", not ", state_.seed,
                        "; give the same seed");
    }
    state_ = checkpoint.state;
    adam_.load(checkpoint.tensors, (folder / "state.safetensors").string(), "adam.");
    if (average_) average_->load(checkpoint.tensors, (folder / "state.safetensors").string(), "average.");
    set_trainable_parts();
}

void Trainer::save_checkpoint(const RunFolder& folder) {
    std::ostringstream line;
    line << "checkpoint at step " << state_.step;
    {
        const EvaluationScope evaluation(*this);
        model_.save(folder.model_file());
        if (const std::optional<double> score = validate()) {
            line << ", validation PSNR " << std::fixed << std::setprecision(2) << *score << " dB";
            if (*score > state_.best_validation) {
                state_.best_validation = *score;
                model_.save(folder.best_file());
            }
        }
    }
    Checkpoint checkpoint{state_, {}};
    adam_.save(checkpoint.tensors, "adam.");
    if (average_) average_->save(checkpoint.tensors, "average.");
    write_checkpoint(folder.checkpoint(state_.step), model_, checkpoint);
    folder.finish_checkpoint(state_.step, config_.output.keep_last);
    folder.log(line.str());
}

TrainingOutcome Trainer::run(const RunFolder& folder, const TrainingLimits& limits) {
    const InterruptGuard guard;
    const OutputConfig& output = config_.output;
    const double start = seconds_now();
    double last_checkpoint = start;
    double tick_start = start;
    const std::int64_t first_step = state_.step;
    folder.forget_statistics_after(first_step);
    Progress progress({.title = "train",
                       .total = config_.stage1.steps * config_.stage1.batch,
                       .first = first_step * config_.stage1.batch,
                       .unit = "images",
                       .time_limit = limits.minutes * 60.0});
    TrainingOutcome outcome;
    LossTerms tick;
    std::int64_t tick_steps = 0;
    const auto time_is_up = [&] { return limits.minutes > 0.0 && seconds_now() - start >= limits.minutes * 60.0; };
    while (state_.step < config_.stage1.steps && !interrupted() && !time_is_up()) {
        const std::int64_t failures = state_.failures;
        const LossTerms losses = step();
        if (state_.failures > failures)
            progress.message("step " + std::to_string(state_.step) + " skipped: loss or gradient not finite");
        tick.accumulate(losses, 1.0);
        ++tick_steps;
        if (state_.step % output.tick_steps == 0) {
            outcome.last_tick = {};
            outcome.last_tick.accumulate(tick, 1.0 / static_cast<double>(tick_steps));
            const double rate = static_cast<double>(tick_steps * config_.stage1.batch) / (seconds_now() - tick_start);
            folder.statistics(tick_json(state_.step, epochs_at(state_.step), learning_rate(), rate, outcome.last_tick));
            folder.log("step " + std::to_string(state_.step) + ": " + tick_text(outcome.last_tick));
            tick = {};
            tick_steps = 0;
            tick_start = seconds_now();
        }
        progress.update(state_.step * config_.stage1.batch, tick_text(losses));
        if (output.sample_steps > 0 && state_.step % output.sample_steps == 0) {
            const EvaluationScope evaluation(*this);
            folder.sample(state_.step, sample_sheet(model_, shown_faces(), config_.stage1.samples_per_ray));
        }
        if (output.checkpoint_minutes > 0.0 && seconds_now() - last_checkpoint >= output.checkpoint_minutes * 60.0) {
            save_checkpoint(folder);
            last_checkpoint = seconds_now();
        }
    }
    outcome.steps = state_.step;
    outcome.seconds = seconds_now() - start;
    outcome.images_per_second =
        static_cast<double>((state_.step - first_step) * config_.stage1.batch) / std::max(1e-9, outcome.seconds);
    outcome.finished = state_.step >= config_.stage1.steps;
    if (tick_steps > 0 && outcome.last_tick.total == 0.0)
        outcome.last_tick.accumulate(tick, 1.0 / static_cast<double>(tick_steps));
    save_checkpoint(folder);
    progress.finish(tick_text(outcome.last_tick));
    return outcome;
}

}  // namespace stymo
