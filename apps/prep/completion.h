#pragma once

#include <optional>
#include <span>
#include <string>

#include "apps/prep/pipeline.h"

namespace stymo {

/// Makes a data set of the photos that have a record (`files`, in output order): corrects a
/// network's poses by their medians, and writes faces.jsonl, camera.json and report.json. If
/// `complete`, these are all photos; then it also writes the contact sheets and removes the
/// records. Otherwise the preparation can continue. `photo_ids` are the ids of all photos, and
/// `left_out` what is none, for report.json. Throws FileError and removes its output if no photo
/// can be used. Returns nothing if there is no face yet, or if a signal arrives before the sheets
/// are written.
[[nodiscard]] std::optional<PrepareReport> write_data_set(const FolderPreparation& folders,
                                                          const PhotoPreparation& preparation,
                                                          std::span<const std::string> files,
                                                          const std::vector<std::string>& photo_ids,
                                                          const std::vector<BrokenFile>& left_out,
                                                          ResultFolder& notes, bool complete);

}  // namespace stymo
