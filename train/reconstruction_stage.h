#pragma once

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

}  // namespace stymo
