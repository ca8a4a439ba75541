#pragma once

#include <filesystem>
#include <vector>

#include "core/io/tensor_file.h"
#include "nn/models/model.h"
#include "nn/optim/adam.h"

namespace stymo {

/// The state on which the next step depends, apart from weights and optimisers. Random numbers are
/// a pure function of seed and step, so no generator's state is stored.
struct TrainingState {
    std::uint64_t seed = 0;
    std::int64_t step = 0;   ///< optimiser steps done
    bool mask_loss = false;  ///< whether the mask loss has been switched on; it stays on
    /// Sum of the reconstruction loss over the steps of the current epoch.
    double epoch_loss_sum = 0.0;
    std::int64_t epoch_loss_count = 0;
    std::vector<double> epoch_losses;  ///< mean for each finished epoch
    std::int64_t failures = 0;         ///< number of consecutive skipped steps
    double best_validation = 1e300;    ///< lowest L_recon on the validation images so far
    /// Resolution of best_validation; losses at other resolutions are not comparable.
    std::int64_t best_resolution = 0;
};

struct Checkpoint {
    TrainingState state;
    /// Discriminator, moments of the optimisers and EMA of the weights, under prefixes.
    TensorFile tensors;
};

/// Writes `folder`/{model,state}.safetensors and their checksums. The folder is written completely
/// or not at all, and replaces an older one of the same name. Throws FileError if it cannot be
/// written.
void write_checkpoint(const std::filesystem::path& folder, const Model& model,
                      const Checkpoint& checkpoint);
/// Reads the weights into `model` and returns the rest. Throws FileError, which names what is
/// missing, damaged or does not match, and leaves the model unchanged. If files are missing or
/// damaged, or if the folder's number is not the state's step, the error also names the newest
/// older checkpoint next to `folder` that is intact.
[[nodiscard]] Checkpoint read_checkpoint(const std::filesystem::path& folder, Model& model);

}  // namespace stymo
