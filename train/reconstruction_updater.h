#pragma once

#include "train/updater.h"

namespace stymo {

/// The first stage: encoder and decoder learn to reconstruct.
class ReconstructionUpdater : public Updater {
public:
    explicit ReconstructionUpdater(const TrainingParts& parts);

    [[nodiscard]] StepReport step(const TrainingPlace& place, bool mask_loss) override;
    [[nodiscard]] std::string learning_rate_key() const override { return "optimizer.learning_rate"; }
    void save(TensorFile& file) const override;
    void load(const TensorFile& file, const std::string& source) override;

private:
    /// A pre-trained backbone stays as it is for the first epochs, the mask branch until its loss is on.
    void set_trainable_parts(const TrainingPlace& place, bool mask_loss);
    [[nodiscard]] double learning_rate(const TrainingPlace& place) const;

    TrainingParts parts_;
    Adam adam_;
};

}  // namespace stymo
