#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>

#include "nn/models/model.h"
#include "train/data/dataset.h"

namespace stymo {

/// The codes of `faces` before any fitting (nn/models/face_batch.h), in their order; of at most
/// `most` (1 or more) of them, evenly spread over the set. One row for each.
[[nodiscard]] Codes encoded_faces(const Model& model, const Dataset& faces, std::int64_t most);
/// Statistics of these codes; nothing for less than two faces, or for codes that are not finite.
[[nodiscard]] std::optional<CodeStatistics> code_statistics_of(const Model& model,
                                                               const Dataset& faces,
                                                               std::int64_t most);
/// Adds them to a model's file, if there is that file and they can be had. Throws what reading and
/// writing throw.
void add_code_statistics(const std::filesystem::path& model_file, const Dataset& faces,
                         std::int64_t most);

}  // namespace stymo
