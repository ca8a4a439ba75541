#pragma once

#include <filesystem>
#include <string>

#include "train/data/dataset.h"

namespace stymo {

/// The split with the name "train", "val" or "test"; all faces for an empty name. Throws UsageError
/// for another name.
[[nodiscard]] Split split_called(const std::string& name);
/// How the training run of a model file split its data: "data" in the config.json next to the file,
/// or in the run folder of its checkpoint. Throws FileError if there is none.
[[nodiscard]] DataConfig split_of_run(const std::filesystem::path& model);

}  // namespace stymo
