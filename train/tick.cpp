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
    discriminator_.accumulate(report.discriminator, 1.0);
}

LossTerms Tick::losses() const {
    LossTerms mean;
    mean.accumulate(losses_, 1.0 / static_cast<double>(std::max<std::int64_t>(1, steps_)));
    return mean;
}

DiscriminatorTerms Tick::discriminator() const {
    DiscriminatorTerms mean;
    mean.accumulate(discriminator_, 1.0 / static_cast<double>(std::max<std::int64_t>(1, steps_)));
    mean.r1 = discriminator_.r1 / static_cast<double>(std::max<std::int64_t>(1, regularized_steps_));
    return mean;
}

std::string Tick::text() const {
    const LossTerms loss = losses();
    const DiscriminatorTerms judge = discriminator();
    std::ostringstream text;
    text << std::fixed << std::setprecision(4) << "loss " << loss.total;
    for (const auto& [name, value] : {std::pair<std::string_view, double>{"reconstruction", loss.reconstruction},
                                      {"photometric", loss.photometric},
                                      {"perceptual", loss.perceptual},
                                      {"adversarial", loss.adversarial},
                                      {"code", loss.code},
                                      {"mask", loss.mask},
                                      {"opacity", loss.opacity},
                                      {"depth variance", loss.depth_variance},
                                      {"code norm", loss.code_norm},
                                      {"discriminator", judge.loss},
                                      {"real", judge.real_logit},
                                      {"fake", judge.fake_logit},
                                      {"R1", judge.r1}}) {
        if (value != 0.0) text << ", " << name << ' ' << value;
    }
    return text.str();
}

JsonValue Tick::json(std::int64_t step, const TrainingPlace& place, double epoch, double images_per_second) const {
    const LossTerms loss = losses();
    JsonValue object = JsonValue::object({{"step", step},
                                          {"stage", place.phase.stage},
                                          {"resolution", place.phase.resolution},
                                          {"epoch", epoch},
                                          {"learning_rate", learning_rate_},
                                          {"images_per_second", images_per_second},
                                          {"loss", loss.total},
                                          {"reconstruction", loss.reconstruction},
                                          {"photometric", loss.photometric},
                                          {"perceptual", loss.perceptual},
                                          {"code", loss.code},
                                          {"mask", loss.mask},
                                          {"opacity", loss.opacity},
                                          {"depth_variance", loss.depth_variance},
                                          {"code_norm", loss.code_norm}});
    if (place.phase.stage == 1) return object;
    const DiscriminatorTerms judge = discriminator();
    object.add("fade", place.fade);
    object.add("adversarial", loss.adversarial);
    object.add("discriminator", judge.loss);
    object.add("real_logit", judge.real_logit);
    object.add("fake_logit", judge.fake_logit);
    object.add("r1", judge.r1);
    return object;
}

}  // namespace stymo
