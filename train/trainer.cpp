#include "train/trainer.h"

#include <algorithm>
#include <cmath>
#include <iomanip>
#include <sstream>

#include "core/error.h"
#include "core/metrics.h"
#include "nn/realtime/view.h"
#include "train/memory_estimate.h"
#include "train/photo_offsets.h"
#include "train/stages.h"

namespace stymo {

namespace {

constexpr const char* ema_prefix = "average.";

void require_codes(const TrainConfig& config, const Dataset& faces) {
    if (uses_encoder(config.model)) return;
    const DatasetSummary summary = faces.summary();
    if (summary.without_code == 0) return;
    fail<ConfigError>("codes.source = ", config.model.code_source,
                      " needs a morphable model's code of every face, and ", summary.without_code,
                      " of ", summary.faces,
                      " have none; prepare the folder with stymo-prep --morphable, or set "
                      "codes.source to encoder");
}

Model initial_model(const ModelConfig& config, const Rng& rng) {
    Rng weights = rng.split("weights");
    return {config, weights};
}

}  // namespace

Dataset faces_for_training(const std::filesystem::path& folder, const TrainConfig& config,
                           Split split) {
    return {folder,
            config.model.decoder.resolution,
            config.data,
            split,
            config.model.camera,
            camera_check(config.model.decoder, config.data.mirror)};
}

Trainer::Trainer(const TrainConfig& config, const Dataset& training, const Dataset* validation,
                 std::uint64_t seed, Ranks* ranks)
    : ranks_(ranks != nullptr ? *ranks : alone_),
      config_(config),
      training_(training),
      validation_(validation),
      rng_(seed),
      schedule_(config),
      images_(training, config.data, rng_, resolution_ladder(config.model.decoder).smallest(),
              config.stage1.batch, camera_check(config.model.decoder, config.data.mirror)),
      model_(initial_model(config.model, rng_)),
      reconstruction_(config.model.reconstruction) {
    if (uses_encoder(config.model)) require_backbone_weights(config.model.encoder);
    if (config.loss.compares_identity()) identity_.emplace(config.loss.identity_network);
    require_codes(config, training);
    if (validation != nullptr) require_codes(config, *validation);
    create_offsets(config.stage1.pose_interval > 0);
    schedule_.choose_executions([&](const TrainingPhase& phase) {
        require_share(ranks_, phase.micro_batches(), "stage " + std::to_string(phase.stage));
        return choose_execution(model_, reconstruction_, config, phase, offset_numbers());
    });
    state_.seed = seed;
    state_.mask_loss = config.loss.mask_start_epoch == 0;
}

Trainer::~Trainer() = default;

void Trainer::create_offsets(bool poses) {
    const bool codes = learns_codes(config_.model);
    std::set<std::string> sources;
    for (std::int64_t face = 0; face < training_.size(); ++face)
        if (const FaceEntry* entry = training_.entry(face); entry && !entry->origin.source.empty())
            sources.insert(entry->origin.source);
    if (!codes && !poses && sources.empty()) return;
    offsets_.emplace(training_.ids(), PhotoOffsetsConfig{.codes = codes,
                                                         .mirrored_codes = config_.data.mirror,
                                                         .poses = poses,
                                                         .sources = std::move(sources)});
}

Trainer::EvaluationScope::EvaluationScope(Trainer& trainer) : trainer_(trainer) {
    if (trainer_.ema_) trainer_.ema_->swap();
    trainer_.model_.parameters().set_trainable("", false);
}

Trainer::EvaluationScope::~EvaluationScope() {
    if (trainer_.ema_) trainer_.ema_->swap();
}

TrainingPhase Trainer::phase_done() const {
    return schedule_.position(std::max<std::int64_t>(0, state_.step - 1)).phase;
}

double Trainer::average_half_life(const TrainingPosition& position) const {
    if (position.phase.stage == 2) return config_.stage2.average_half_life;
    // The half life is short at first, so that the EMA forgets the random initial weights.
    return std::min(config_.stage1.average_half_life,
                    0.1 * static_cast<double>(position.first_image + position.phase.batch));
}

void Trainer::enter_stage(int stage) {
    if (stage == stage_number_) return;
    stage_number_ = stage;
    const TrainingParts parts{config_,         images_,
                              reconstruction_, rng_,
                              model_,          offsets_ ? &*offsets_ : nullptr,
                              ranks_,          identity_ ? &*identity_ : nullptr};
    if (stage == 1) {
        stage_ = std::make_unique<ReconstructionStage>(parts);
    } else {
        stage_ = std::make_unique<AdversarialStage>(parts);
    }
    const double half_life =
        stage == 1 ? config_.stage1.average_half_life : config_.stage2.average_half_life;
    if (half_life == 0.0) ema_.reset();
    if (half_life > 0.0 && !ema_) ema_.emplace(model_.parameters().all());
}

StepReport Trainer::step() {
    TrainingPosition position = schedule_.position(state_.step);
    enter_stage(position.phase.stage);
    // The mask branch needs the features of all resolutions.
    position.mask_loss = config_.loss.mask_weight > 0.0 &&
                         position.phase.resolution == config_.model.decoder.resolution &&
                         (position.phase.stage == 2 || state_.mask_loss);
    StepReport report = stage_->step(position);
    if (report.non_finite) {
        count_failure(*report.non_finite);
    } else {
        state_.failures = 0;
        if (ema_) ema_->update(ema_decay(position.phase.batch, average_half_life(position)));
    }
    ++state_.step;
    if (position.phase.stage == 1) count_epoch(report.losses["reconstruction"]);
    return report;
}

void Trainer::count_failure(const std::string& what) {
    ++state_.failures;
    if (state_.failures > config_.optimizer.failures_allowed) {
        fail<NumericError>("step ", state_.step + 1, ": ", what, " is not finite, ",
                           state_.failures, " steps in a row; lower ", stage_->learning_rate_key());
    }
}

void Trainer::count_epoch(double reconstruction_loss) {
    if (std::isfinite(reconstruction_loss)) {
        state_.epoch_loss_sum += reconstruction_loss;
        ++state_.epoch_loss_count;
    }
    const double epochs = std::floor(epochs_at(state_.step));
    if (epochs > std::floor(epochs_at(state_.step - 1)) && state_.epoch_loss_count > 0) {
        state_.epoch_losses.push_back(state_.epoch_loss_sum /
                                      static_cast<double>(state_.epoch_loss_count));
        state_.epoch_loss_sum = 0.0;
        state_.epoch_loss_count = 0;
        const std::vector<double>& history = state_.epoch_losses;
        const std::size_t count = history.size();
        const bool stable =
            count >= 3 && history[count - 1] > (1.0 - config_.loss.mask_start_improvement) *
                                                   std::min(history[count - 2], history[count - 3]);
        state_.mask_loss =
            state_.mask_loss || (stable && config_.loss.mask_start_improvement > 0.0);
    }
    state_.mask_loss =
        state_.mask_loss || epochs >= static_cast<double>(config_.loss.mask_start_epoch);
}

std::string Trainer::begin_with(const std::filesystem::path& model_file) {
    // A model's file is checked and converted from 16 bits by loading it.
    TensorFile weights;
    const Model initial = Model::load(model_file);
    initial.parameters().save(weights);
    model_.parameters().load(weights, model_file.string());
    const double before = initial.config().camera.intrinsics.focal,
                 now = config_.model.camera.intrinsics.focal;
    constexpr double rounding = 0.01;
    if (std::abs(now - before) <= rounding * before) return {};
    std::ostringstream note;
    note << "warning: " << model_file.string() << " was trained with the focal length " << before
         << ", the photos have " << now << ": prepare them with stymo-prep --focal " << before
         << ", or the model learns another camera";
    return note.str();
}

std::string Trainer::resume(const std::filesystem::path& folder) {
    Checkpoint checkpoint = read_checkpoint(folder, model_, state_.seed);
    const std::string source = (folder / "state.safetensors").string();
    std::string note = follow_photos(checkpoint.tensors, training_.ids());
    state_ = checkpoint.state;
    stage_number_ = 0;
    ema_.reset();
    // This must come before enter_stage, which would begin a new EMA.
    if (has_prefix(checkpoint.tensors, ema_prefix)) {
        ema_.emplace(model_.parameters().all());
        ema_->load(checkpoint.tensors, source, ema_prefix);
    }
    // Poses that were learnt earlier stay as they are if no step learns them.
    if (has_prefix(checkpoint.tensors, PhotoOffsets::pose_prefix)) create_offsets(true);
    if (offsets_) offsets_->load(checkpoint.tensors, source);
    enter_stage(schedule_.position(state_.step).phase.stage);
    stage_->load(checkpoint.tensors, source);
    return note;
}

void Trainer::save_checkpoint(const RunFolder& folder) {
    const TrainingPhase phase = phase_done();
    std::ostringstream line;
    line << "checkpoint at step " << state_.step;
    {
        const EvaluationScope evaluation(*this);
        const std::int64_t count =
            validation_ == nullptr
                ? 0
                : std::min(config_.output.validation_images, validation_->size());
        if (count > 0) {
            const ValidationScore score =
                validation_score(model_, reconstruction_, *validation_, count, phase.resolution,
                                 phase.samples_per_ray);
            const bool is_scored = std::isfinite(score.reconstruction);
            if (is_scored) model_.set_validation_psnr(score.psnr);
            line << std::fixed << ", validation at " << phase.resolution
                 << " pixels: reconstruction " << std::setprecision(4) << score.reconstruction
                 << ", PSNR " << std::setprecision(2) << score.psnr << " dB"
                 << (score.psnr > most_plausible_psnr ? implausible_psnr : "");
            // A run that is resumed in another folder has no best model there yet.
            if (is_scored && (phase.resolution != state_.best_resolution ||
                              score.reconstruction < state_.best_validation ||
                              !std::filesystem::exists(folder.best_file()))) {
                state_.best_resolution = phase.resolution;
                state_.best_validation = score.reconstruction;
                model_.save(folder.best_file());
            }
        }
        model_.save(folder.model_file());
    }
    Checkpoint checkpoint{state_, {}};
    if (stage_) stage_->save(checkpoint.tensors);
    if (offsets_) offsets_->parameters().save(checkpoint.tensors);
    store_photo_ids(checkpoint.tensors, training_.ids());
    if (ema_) ema_->save(checkpoint.tensors, ema_prefix);
    write_checkpoint(folder.checkpoint(state_.step), model_, checkpoint);
    folder.finish_checkpoint(state_.step, config_.output.keep_last);
    folder.log(line.str());
}

}  // namespace stymo
