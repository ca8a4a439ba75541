#pragma once

#include <filesystem>

#include "apps/common/command_line.h"
#include "nn/models/model.h"

namespace stymo {

/// The model of a tool, with the changes of its weights for a tuned face.
struct ModelOptions {
    std::filesystem::path file;   ///< empty: the model that is shipped with stymo
    std::filesystem::path tuned;  ///< file written by `stymo-fit --tune`; empty: none
};

/// Declares --model.
void declare_model(Command& command, ModelOptions& options);
/// Declares --tuned.
void declare_tuned(Command& command, ModelOptions& options);

/// The file of --model, or of the model that is shipped with stymo. Throws UsageError if there is
/// neither.
[[nodiscard]] std::filesystem::path model_file(const ModelOptions& options);
/// Loads that model and applies the changes of --tuned. Throws what Model::load and WeightChanges
/// throw.
[[nodiscard]] Model load_model(const ModelOptions& options, ModelParts parts = ModelParts::all);

}  // namespace stymo
