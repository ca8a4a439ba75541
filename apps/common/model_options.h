#pragma once

#include <filesystem>

#include "apps/common/command_line.h"
#include "nn/models/model.h"

namespace stymo {

/// The model of a tool, with what a tuned face adds to its weights.
struct ModelOptions {
    std::filesystem::path file;   ///< empty: the model that comes with stymo
    std::filesystem::path tuned;  ///< of `stymo-fit --tune`; empty: none
};

/// --model
void declare_model(Command& command, ModelOptions& options);
/// --tuned
void declare_tuned(Command& command, ModelOptions& options);

/// The file of --model, or that of the model that comes with stymo. Throws UsageError where there
/// is neither.
[[nodiscard]] std::filesystem::path model_file(const ModelOptions& options);
/// That model, with the changes of --tuned. Throws what Model::load and WeightChanges throw.
[[nodiscard]] Model load_model(const ModelOptions& options, ModelParts parts = ModelParts::all);

}  // namespace stymo
