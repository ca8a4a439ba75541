#pragma once

#include <filesystem>
#include <vector>

#include "core/io/tensor_file.h"
#include "nn/models/model.h"
#include "nn/optim/adam.h"

namespace stymo {

/// What the next step depends on, apart from the weights. Everything random is a pure function of
/// seed and step, so no generator's state is needed.
struct TrainingState {
    std::uint64_t seed = 0;
    std::int64_t step = 0;        ///< optimiser steps done
    bool mask_loss = false;       ///< switched on; it stays on
    double epoch_loss_sum = 0.0;  ///< reconstruction loss of the running epoch's steps
    std::int64_t epoch_loss_count = 0;
    std::vector<double> epoch_losses;  ///< means of the epochs that are over
    std::int64_t failures = 0;         ///< steps skipped in a row
    double best_validation = 1e300;    ///< lowest L_recon on the validation images so far ...
    std::int64_t best_resolution = 0;  ///< ... at this resolution; others do not compare
};

struct Checkpoint {
    TrainingState state;
    TensorFile
        tensors;  ///< discriminator, optimisers' moments and EMA of the weights, under prefixes
};

/// Writes `folder`/{model,state}.safetensors and their checksums; the folder appears whole or not
/// at all, in place of an older one of its name. Throws FileError if it cannot be written.
void write_checkpoint(const std::filesystem::path& folder, const Model& model,
                      const Checkpoint& checkpoint);
/// Reads the weights into `model` and returns the rest. Throws FileError naming what is missing,
/// damaged or does not fit, and leaves the model as it was. If files are missing or damaged, or if
/// the folder's number is not the state's step, the error names the newest older checkpoint beside
/// `folder` that is whole.
[[nodiscard]] Checkpoint read_checkpoint(const std::filesystem::path& folder, Model& model);

}  // namespace stymo
