#pragma once

#include <filesystem>
#include <ostream>

#include "apps/common/command_line.h"
#include "core/io/json_writer.h"
#include "fit/frame_comparison.h"

namespace stymo {

// The commands of stymo-export.
void declare_mesh(CommandLine& line);
void declare_splat(CommandLine& line);
void declare_arkit(CommandLine& line);

/// Compares what was exported with the model's frames from nine sides: a picture with the frames
/// above the drawings, a table, and "check" of the JSON.
void check_against_frames(const std::filesystem::path& picture, const Model& model,
                          const Codes& codes, const DrawnFrom& draw, std::ostream& text,
                          JsonValue& json);

}  // namespace stymo
