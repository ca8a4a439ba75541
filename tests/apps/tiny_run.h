#pragma once

#include <filesystem>

namespace stymo {

/// A folder in which the tools have done their work once, on the smallest data there is; made at
/// the first call. It holds faces/ (12 heads of 64 pixels), tiny.json (the configuration), run/ (4
/// steps of training), fit/ (a fit of the last head), and inputs that are wrong: empty/, zero.png,
/// text.png, cut.png, cut.jpg, cut.safetensors, file (whose name no folder can take).
[[nodiscard]] const std::filesystem::path& tiny_run();

}  // namespace stymo
