#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "core/autograd/variable.h"
#include "nn/pretrained/head_mask_network.h"
#include "train/head_mask_examples.h"

namespace stymo {

/// The training of a head-mask network. configs/models/head-mask/training.json has its values for
/// the network that comes with stymo.
struct HeadMaskTrainingConfig {
    std::int64_t steps = 4400;
    std::int64_t batch = 8;
    double learning_rate = 2e-3;          ///< at the start; falls to 0 as a half cosine
    double averaging_half_life = 1500.0;  ///< of the averaged weights, in images
    double checkpoint_minutes = 5.0;
    HeadMaskVariation variation;

    void describe(ConfigSchema& schema);
    /// Throws ConfigError for an unknown key or a value out of range.
    [[nodiscard]] static HeadMaskTrainingConfig load(const std::filesystem::path& path,
                                                     const std::vector<std::string>& overrides);
};

/// Where and how long to train.
struct HeadMaskRun {
    std::filesystem::path folder;
    bool resume = false;
    double minutes = 0.0;         ///< 0: no limit
    std::int64_t most_steps = 0;  ///< steps now; 0: no limit
    std::uint64_t seed = 0;
};

struct HeadMaskTrainingOutcome {
    std::int64_t steps = 0;
    double loss = 0.0;  ///< mean over the last steps
    double seconds = 0.0;
    bool finished = false;
};

/// Files of a training run in its folder.
inline constexpr const char* head_mask_file = "network.safetensors";  ///< averaged weights
inline constexpr const char* head_mask_state_file = "state.safetensors";

/// Trains `model` until all steps are done, a limit is reached or a signal arrives, and writes
/// network and state into the folder, at the end and from time to time. With `resume` it goes on
/// where the folder's state ends, with the same results as without a pause. Throws FileError if
/// `resume` finds no state or one of another seed, or for a folder that has one without `resume`.
HeadMaskTrainingOutcome train_head_mask(const HeadMaskModel& model,
                                        const HeadMaskExamples& examples,
                                        const HeadMaskTrainingConfig& config,
                                        const HeadMaskRun& run);

}  // namespace stymo
