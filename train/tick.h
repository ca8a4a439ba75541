#pragma once

#include <optional>
#include <string>

#include "core/io/json_writer.h"
#include "train/discriminator_gradients.h"
#include "train/stage.h"

namespace stymo {

/// Speed of the steps of a tick.
struct TickSpeed {
    double images_per_second = 0.0;
    /// Share of the time in which this rank only exchanged data with other ranks or waited for
    /// them; nothing with a single rank.
    std::optional<double> exchange_share{};
    /// Share of the time in which it exchanged data while it was computing.
    std::optional<double> hidden_exchange_share{};
    double disk_share = 0.0;  ///< share of the threads' time in which they waited for the disk
};

/// Means over the steps of a tick, the interval between two lines of statistics.
class Tick {
public:
    void add(const StepReport& report);

    [[nodiscard]] std::int64_t steps() const { return steps_; }
    /// Means over all steps. R1 is the mean over the steps that computed it.
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

}  // namespace stymo
