#pragma once

#include "apps/common/command_line.h"

namespace stymo {

// The commands of stymo-edit.
void declare_mix(CommandLine& line);
void declare_color(CommandLine& line);
void declare_disentangle(CommandLine& line);

}  // namespace stymo
