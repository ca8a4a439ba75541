#pragma once

#include <algorithm>
#include <cstdint>
#include <limits>
#include <optional>
#include <string>

#include "core/io/json_writer.h"
#include "nn/models/model.h"
#include "nn/models/reconstruction.h"
#include "train/data/dataset.h"
#include "train/photo_offsets.h"
#include "train/stage.h"
#include "train/step_gradients.h"

namespace stymo {

/// Notices a loss that explodes while it is still finite, as with a learning rate that is too high.
/// A loss is high if it is above `factor` times the lowest loss of the phase, where losses below
/// `least` count as `least`: images alone cannot differ by so much. High losses of `most` steps in
/// a row, or of the last step of a run, end the run.
class LossWatch {
public:
    static constexpr double factor = 1000.0, least = 0.01;
    static constexpr std::int64_t most = 10;

    /// The finite loss of one more step.
    void add(double loss) {
        lowest_ = std::min(lowest_, std::max(loss, least));
        high_steps_ = loss > factor * lowest_ ? high_steps_ + 1 : 0;
    }
    [[nodiscard]] double lowest() const { return lowest_; }
    [[nodiscard]] std::int64_t high_steps() const { return high_steps_; }

private:
    double lowest_ = std::numeric_limits<double>::infinity();
    std::int64_t high_steps_ = 0;
};

/// Speed of the steps of a tick.
struct TickSpeed {
    double images_per_second = 0.0;
    /// Share of the time in which this rank only exchanged data with other ranks or waited for
    /// them; nothing with a single rank.
    std::optional<double> exchange_share{};
    /// Share of the time in which it exchanged data while it was computing.
    std::optional<double> hidden_exchange_share{};
    /// Share of the time in which the threads that load photos waited for the disk.
    double disk_share = 0.0;
};

/// Measures the speed of the steps of each tick.
class TickClock {
public:
    /// Begins a tick at image `image` of the run. `images` and `ranks` must outlive the clock.
    TickClock(const TrainingImages& images, const Ranks& ranks, std::int64_t image);

    /// The speed of the tick that ends at image `image`, whose photos were loaded by so many
    /// threads. The next tick begins.
    [[nodiscard]] TickSpeed lap(std::int64_t image, std::int64_t loading_threads);

private:
    /// Seconds since some begin.
    struct Reading {
        double now = 0.0;
        double exchange = 0.0;
        double hidden = 0.0;  ///< part of `exchange`
        double disk = 0.0;    ///< of all threads
        std::int64_t image = 0;
    };

    [[nodiscard]] Reading reading(std::int64_t image) const;

    const TrainingImages& images_;
    const Ranks& ranks_;
    Reading begin_;
};

/// Means over the steps of a tick, the interval between two lines of statistics.
class Tick {
public:
    /// Does nothing for a step that was skipped (StepReport::non_finite).
    void add(const StepReport& report);

    /// Without those that were skipped.
    [[nodiscard]] std::int64_t steps() const { return steps_; }
    /// Means over these steps, NaN if there are none. R1 is the mean over the steps that computed
    /// it.
    [[nodiscard]] LossValues losses() const;

    /// "loss 0.1234, reconstruction 0.1200, ...": the terms that are not 0.
    [[nodiscard]] std::string text() const;
    /// Every term. The terms of the discriminator appear only in the second stage.
    [[nodiscard]] JsonValue json(std::int64_t step, const TrainingPosition& position, double epoch,
                                 const TickSpeed& speed) const;

private:
    std::int64_t steps_ = 0;
    std::int64_t regularized_steps_ = 0;
    double learning_rate_ = 0.0;  ///< of the last step
    LossValues losses_;           ///< sums
};

/// Mean scores of a model's images for the initial codes (face_codes).
struct ValidationScore {
    double reconstruction = 0.0;  ///< L_recon of training
    double psnr = 0.0;            ///< of the masked image, in decibels
};

/// The score on the first `count` faces, at one of the model's resolutions; NaN if none of their
/// pixels is known.
[[nodiscard]] ValidationScore validation_score(const Model& model,
                                               const ReconstructionLoss& reconstruction,
                                               const Dataset& faces, std::int64_t count,
                                               std::int64_t resolution,
                                               std::int64_t samples_per_ray);

/// An image with one row for each of the first few faces: target | image for the initial code |
/// three views at yaw -30, 0 and 30 degrees, at one of the model's resolutions. `offsets`: the
/// learnt offsets of the faces, or null. Views that the model cannot render are black.
[[nodiscard]] Tensor sample_sheet(const Model& model, const Dataset& faces, std::int64_t resolution,
                                  std::int64_t samples_per_ray,
                                  const PhotoOffsets* offsets = nullptr);

}  // namespace stymo
