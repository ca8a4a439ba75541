#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <optional>
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
/// missing, damaged or does not match, or that the run had another seed, and leaves the model
/// unchanged. If files are missing or
/// damaged, or if the folder's number is not the state's step, the error also names the newest
/// older checkpoint next to `folder` that is intact.
[[nodiscard]] Checkpoint read_checkpoint(const std::filesystem::path& folder, Model& model,
                                         std::uint64_t seed);

/// The step in the name of a checkpoint's folder, or nothing for another name.
[[nodiscard]] std::optional<std::int64_t> checkpoint_step(const std::filesystem::path& folder);
/// Writes a checkpoint's folder so that it survives a crash or a power cut at any time. While it is
/// being written, two more folders can exist: `folder`.unfinished is the new checkpoint, and
/// `folder`.replaced is the complete one that it replaces. Calls `write(unfinished)` and replaces
/// `folder` by the result. Throws FileError if a folder cannot be renamed; the older checkpoint of
/// this name is then kept.
void write_checkpoint_folder(const std::filesystem::path& folder,
                             const std::function<void(const std::filesystem::path&)>& write);
/// Removes a checkpoint. After a crash a partly removed checkpoint is named as unfinished, never as
/// complete.
void remove_checkpoint_folder(const std::filesystem::path& folder);
/// Repairs one checkpoint after a crash: restores the replaced one if no new one is complete.
void repair_checkpoint_folder(const std::filesystem::path& folder);
/// Repairs every checkpoint in `folder` and removes unfinished ones.
void repair_checkpoint_folders(const std::filesystem::path& folder);

/// Checks the files of a checkpoint against its checksums.txt, which has CRC-32C in hexadecimal,
/// size and name of every other file in the folder. Throws FileError, which names the first file
/// that differs, or that is missing in the folder or in checksums.txt. Accepts a folder of an older
/// version, which has no checksums.txt.
void verify_checksums(const std::filesystem::path& folder);

}  // namespace stymo
