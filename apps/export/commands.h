#pragma once

#include "apps/common/command_line.h"

namespace stymo {

// The commands of stymo-export.
void declare_mesh(CommandLine& line);
void declare_splat(CommandLine& line);
void declare_arkit(CommandLine& line);

}  // namespace stymo
