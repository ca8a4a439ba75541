#pragma once

#include <optional>

#include "train/stage.h"

namespace stymo {

/// The first stage: encoder and decoder learn to reconstruct.
class ReconstructionStage : public TrainingStage {
public:
    explicit ReconstructionStage(const TrainingParts& parts);

    [[nodiscard]] StepReport step(const TrainingPosition& position) override;
    [[nodiscard]] std::string learning_rate_key() const override {
        return "optimizer.learning_rate";
    }
    void save(TensorFile& file) const override;
    void load(const TensorFile& file, const std::string& source) override;

private:
    /// Unfreezes the parameters that the step trains. A pre-trained backbone stays frozen for the
    /// first epochs.
    [[nodiscard]] std::vector<Parameter> unfreeze(const TrainingPosition& position);
    [[nodiscard]] double learning_rate(const TrainingPosition& position) const;

    TrainingParts parts_;
    HybridOptimizer optimizer_;
};

/// The second stage: adversarial training of the decoder with a frozen encoder. A step updates the
/// discriminator, regularizes it every `r1_interval` steps (R1, a separate update), and then
/// updates the decoder. With adversarial weight 0 there is no discriminator, and the decoder
/// continues to learn the reconstruction.
class AdversarialStage : public TrainingStage {
public:
    explicit AdversarialStage(const TrainingParts& parts);

    [[nodiscard]] StepReport step(const TrainingPosition& position) override;
    [[nodiscard]] std::string learning_rate_key() const override { return "stage2.learning_rate"; }
    void save(TensorFile& file) const override;
    void load(const TensorFile& file, const std::string& source) override;

private:
    /// A discriminator with its weights and the state of its optimiser.
    struct TrainedDiscriminator {
        ParameterStore parameters;
        Discriminator network;
        Adam adam;
        AdaptiveProbability augmentation;

        TrainedDiscriminator(const TrainConfig& config, Rng rng);
    };

    /// Loads the micro-batches of a step once for all its updates, and encodes their photos.
    void load_faces(const TrainingPosition& position);
    /// These functions make one update of the discriminator. If a value is not finite, they record
    /// it in the report and change nothing.
    void update_discriminator(const TrainingPosition& position, StepReport& report);
    void regularize_discriminator(const TrainingPosition& position, StepReport& report);
    void apply(const LossAndGradients& update, const std::vector<Parameter>& parameters,
               StepReport& report);
    /// Unfreezes only the discriminator's layers for the phase's resolution, and returns their
    /// parameters.
    [[nodiscard]] std::vector<Parameter> unfreeze_discriminator(const TrainingPosition& position);
    void update_decoder(const TrainingPosition& position, StepReport& report);

    TrainingParts parts_;
    HybridOptimizer optimizer_;
    std::optional<TrainedDiscriminator> discriminator_;
    std::vector<MicroBatch> batches_;  ///< of the step that is running, if it has several updates
};

}  // namespace stymo
