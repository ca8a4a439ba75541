#pragma once

#include <filesystem>

namespace stymo {

/// A file that comes with stymo, by its name below `configs/`: in the sources of the running
/// program, or installed with it. Empty if there is none.
[[nodiscard]] std::filesystem::path shipped_file(const std::filesystem::path& name);
/// The landmark network that comes with stymo. Empty, which FaceDetector takes for the model of
/// libdlib-data, if there is none.
[[nodiscard]] std::filesystem::path shipped_landmark_network();

}  // namespace stymo
