#pragma once

#include "apps/common/command_line.h"
#include "fit/photo/photo_preparation.h"

namespace stymo {

/// Declares --parser, --morphable, --landmarks and --pose-net, the files for the preparation of
/// photos, and --max-pixels.
void declare_preparation_files(Command& command, PhotoPreparationSettings& settings);

}  // namespace stymo
