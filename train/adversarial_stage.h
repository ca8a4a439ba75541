#pragma once

#include <optional>

#include "train/stage.h"

namespace stymo {

/// The second stage: the decoder against a discriminator, while the encoder stays as it is. A step
/// updates the discriminator, regularizes it every `r1_interval` steps (R1, an update of its own),
/// then updates the decoder. Without adversarial weight there is no discriminator, and the decoder
/// continues to learn the reconstruction.
class AdversarialStage : public TrainingStage {
public:
    explicit AdversarialStage(const TrainingParts& parts);

    [[nodiscard]] StepReport step(const TrainingPosition& position) override;
    [[nodiscard]] std::string learning_rate_key() const override { return "stage2.learning_rate"; }
    void save(TensorFile& file) const override;
    void load(const TensorFile& file, const std::string& source) override;

private:
    /// A discriminator with the weights that it learns and the optimiser's memory of them.
    struct TrainedDiscriminator {
        ParameterStore parameters;
        Discriminator network;
        Adam adam;
        AdaptiveProbability augmentation;

        TrainedDiscriminator(const TrainConfig& config, Rng rng);
    };

    /// Each does one update of the discriminator and notes what is not finite in it, in which case
    /// nothing has changed.
    void update_discriminator(const TrainingPosition& position, StepReport& report);
    void regularize_discriminator(const TrainingPosition& position, StepReport& report);
    void apply(const LossAndGradients& update, const std::vector<Parameter>& parameters,
               StepReport& report);
    /// Unfreezes the discriminator's layers that take part, and nothing else; returns them.
    [[nodiscard]] std::vector<Parameter> unfreeze_discriminator(const TrainingPosition& position);
    void update_decoder(const TrainingPosition& position, StepReport& report);

    TrainingParts parts_;
    HybridOptimizer optimizer_;
    std::optional<TrainedDiscriminator> discriminator_;
};

}  // namespace stymo
