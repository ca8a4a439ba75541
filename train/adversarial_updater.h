#pragma once

#include <optional>

#include "train/updater.h"

namespace stymo {

/// The second stage: the decoder against a discriminator, while the encoder stays as it is. A step updates the discriminator,
/// every so often regularizes it (R1, a step of its own), then updates the decoder. Without adversarial weight there is no
/// discriminator, and the decoder goes on learning to reconstruct.
class AdversarialUpdater : public Updater {
public:
    explicit AdversarialUpdater(const TrainingParts& parts);

    [[nodiscard]] StepReport step(const TrainingPlace& place, bool mask_loss) override;
    [[nodiscard]] std::string learning_rate_key() const override { return "stage2.learning_rate"; }
    void save(TensorFile& file) const override;
    void load(const TensorFile& file, const std::string& source) override;

private:
    /// A discriminator with the weights that it learns and the optimiser's memory of them.
    struct Judge {
        ParameterStore parameters;
        Discriminator discriminator;
        Adam adam;

        Judge(const TrainConfig& config, Rng rng);
    };

    /// Each does one update and returns what is not finite in it, in which case nothing has changed.
    std::optional<std::string> update_discriminator(const TrainingPlace& place, StepReport& report);
    std::optional<std::string> regularize_discriminator(const TrainingPlace& place, StepReport& report);
    std::optional<std::string> update_generator(const TrainingPlace& place, bool mask_loss, StepReport& report);
    /// Thaws the discriminator's layers that take part, and nothing else; returns them.
    [[nodiscard]] std::vector<Parameter> thaw_discriminator(const TrainingPlace& place);
    [[nodiscard]] double discriminator_learning_rate() const;

    TrainingParts parts_;
    Adam adam_;
    std::optional<Judge> judge_;
};

}  // namespace stymo
