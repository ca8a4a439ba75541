#pragma once

#include <filesystem>
#include <string>

#include "train/data/dataset.h"

namespace stymo {

/// The split called "train", "val", "test" or, if empty, all faces. Throws UsageError for another
/// name.
[[nodiscard]] Split split_called(const std::string& name);
/// How the training run of a model file split its data: "data" in the config.json beside it, or in
/// the run folder that its checkpoint is in. Throws FileError if there is none.
[[nodiscard]] DataConfig split_of_run(const std::filesystem::path& model);

}  // namespace stymo
