#pragma once

#include "apps/common/command_line.h"
#include "fit/photo/photo_preparation.h"

namespace stymo {

/// --parser, --morphable, --landmarks, --pose-net: the files that the preparation of photos works with.
void declare_preparation_files(Command& command, PhotoPreparationSettings& settings);

}  // namespace stymo
