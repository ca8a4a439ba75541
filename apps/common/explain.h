#pragma once

#include <cstdint>
#include <functional>
#include <iosfwd>
#include <string_view>

#include "apps/common/command_line.h"
#include "nn/realtime/face_renderer.h"

namespace stymo {

/// The result of `work` and a report of it: which networks were made, which losses were evaluated
/// and how much work was done. The report goes to `err`, and into the result as "explain".
[[nodiscard]] AppResult explained(const std::function<AppResult()>& work, std::ostream& err);

/// Adds a tool's own count to the report, "photos" for example.
void count_for_report(std::string_view name, std::int64_t number);
/// Adds a renderer's counts of its last frame.
void count_for_report(const RenderCounts& counts);

}  // namespace stymo
