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
    std::int64_t steps = 10000;
    std::int64_t batch = 16;
    double learning_rate = 2e-3;          ///< at the start; falls to 0 as a half cosine
    double averaging_half_life = 4000.0;  ///< of the averaged weights, in images
    double checkpoint_minutes = 5.0;
    HeadMaskVariation variation;

    void describe(ConfigSchema& schema);
    /// Throws ConfigError for an unknown key or a value out of range.
    [[nodiscard]] static HeadMaskTrainingConfig load(const std::filesystem::path& path,
                                                     const std::vector<std::string>& overrides);
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

/// Trains `model` until all steps are done, `minutes` have passed (0: no limit) or a signal
/// arrives, and writes network and state into `folder`, at the end and from time to time. With
/// `resume` it goes on where the state of the folder ends, with the same results as without a
/// pause. Throws FileError if `resume` finds no state, or a folder that has one without `resume`.
HeadMaskTrainingOutcome train_head_mask(const HeadMaskModel& model,
                                        const HeadMaskExamples& examples,
                                        const HeadMaskTrainingConfig& config,
                                        const std::filesystem::path& folder, bool resume,
                                        double minutes, std::uint64_t seed);

}  // namespace stymo
