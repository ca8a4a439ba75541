#pragma once

#include <optional>
#include <span>
#include <string>

#include "apps/prep/pipeline.h"
#include "apps/prep/progress_file.h"

namespace stymo {

/// Makes a data set of a folder all of whose photos, `files` in the order wanted, are noted: poses of a network are set
/// upright over all of them, then faces.jsonl, camera.json, the contact sheets and report.json are written, and the notes
/// removed. Throws FileError, and removes what was written, if no photo can be used. Nothing if a signal came first.
[[nodiscard]] std::optional<PrepareReport> complete_folder(const FolderPreparation& folders, const PhotoPreparation& preparation,
                                                           std::span<const std::string> files, const ProgressFile& notes);

}  // namespace stymo
