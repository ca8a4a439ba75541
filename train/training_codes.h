#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>

#include "nn/models/model.h"
#include "train/data/dataset.h"

namespace stymo {

/// The initial codes (face_codes of nn/models/face_batch.h) of at most `most` >= 1 of the faces,
/// evenly spread over the set, in their order; one row for each.
[[nodiscard]] Codes encoded_faces(const Model& model, const Dataset& faces, std::int64_t most);
/// Statistics of these codes; nothing for fewer than two faces, or if a code is not finite.
[[nodiscard]] std::optional<CodeStatistics> code_statistics_of(const Model& model,
                                                               const Dataset& faces,
                                                               std::int64_t most);
/// Adds these statistics to a model's file. Does nothing if the file does not exist or there are no
/// statistics. Throws what reading and writing the file throw.
void add_code_statistics(const std::filesystem::path& model_file, const Dataset& faces,
                         std::int64_t most);

}  // namespace stymo
