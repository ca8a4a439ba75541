#include "train/tick.h"

#include <algorithm>
#include <iomanip>
#include <sstream>
#include <string_view>
#include <utility>

namespace stymo {

void Tick::add(const StepReport& report) {
    ++steps_;
    regularized_steps_ += report.regularized ? 1 : 0;
    learning_rate_ = report.learning_rate;
    losses_.accumulate(report.losses, 1.0);
}

LossValues Tick::losses() const {
    const auto mean_over = [](double sum, std::int64_t steps) {
        return sum / static_cast<double>(std::max<std::int64_t>(1, steps));
    };
    LossValues mean;
    mean.accumulate(losses_, mean_over(1.0, steps_));
    mean["r1"] = mean_over(losses_["r1"], regularized_steps_);
    return mean;
}

std::string Tick::text() const {
    const LossValues mean = losses();
    std::ostringstream text;
    text << std::fixed << std::setprecision(4) << "loss " << mean.total;
    std::vector<std::string_view> names = loss_names(2);
    std::ranges::copy(discriminator_loss_names, std::back_inserter(names));
    for (const std::string_view name : names) {
        std::string words(name);
        std::ranges::replace(words, '_', ' ');
        if (mean[name] != 0.0) text << ", " << words << ' ' << mean[name];
    }
    return text.str();
}

JsonValue Tick::json(std::int64_t step, const TrainingPosition& position, double epoch,
                     const TickSpeed& speed) const {
    const LossValues mean = losses();
    JsonValue object = JsonValue::object({{"step", step},
                                          {"stage", position.phase.stage},
                                          {"resolution", position.phase.resolution},
                                          {"epoch", epoch},
                                          {"learning_rate", learning_rate_},
                                          {"images_per_second", speed.images_per_second},
                                          {"loss", mean.total}});
    if (speed.exchange_share) object.add("exchange_share", *speed.exchange_share);
    if (speed.hidden_exchange_share)
        object.add("hidden_exchange_share", *speed.hidden_exchange_share);
    if (speed.disk_share > 0.0) object.add("disk_share", speed.disk_share);
    for (const std::string_view name : loss_names(position.phase.stage))
        object.add(std::string(name), mean[name]);
    if (position.phase.stage == 1) return object;
    object.add("fade", position.fade);
    for (const std::string_view name : discriminator_loss_names)
        object.add(std::string(name), mean[name]);
    return object;
}

}  // namespace stymo
