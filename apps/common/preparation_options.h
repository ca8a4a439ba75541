#pragma once

#include "apps/common/command_line.h"
#include "fit/photo/photo_preparation.h"

namespace stymo {

/// Declares --parser, --morphable, --landmarks and --pose-net, the files for the preparation of
/// photos, and --max-pixels.
void declare_preparation_files(Command& command, PhotoPreparationSettings& settings);
/// Prints a warning if the landmark network that comes with stymo was not found and no other was
/// named, because the shipped model fits photos worse if dlib's landmarks aligned them.
void warn_without_landmark_network(const PhotoPreparationSettings& settings);

}  // namespace stymo
