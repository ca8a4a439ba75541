#pragma once

#include <filesystem>

namespace stymo {

/// The folder of `tiny_run()`, with a folder bad/ of malformed files for every tool; made at the
/// first call.
[[nodiscard]] const std::filesystem::path& hostile_inputs();

}  // namespace stymo
