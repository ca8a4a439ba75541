#pragma once

#include <filesystem>

namespace stymo {

/// A file that is shipped with stymo, by its name below `configs/`: in the source tree of the
/// running program, or installed with it. Empty if there is none.
[[nodiscard]] std::filesystem::path shipped_file(const std::filesystem::path& name);
/// The landmark network that is shipped with stymo. Empty if there is none; FaceDetector then uses
/// the model of libdlib-data.
[[nodiscard]] std::filesystem::path shipped_landmark_network();

}  // namespace stymo
