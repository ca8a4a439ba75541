#include "apps/common/shipped_file.h"

#include <array>

namespace stymo {
namespace {

/// Places of `configs/` relative to the folder of the program.
constexpr std::array config_folders{"../../configs", "../share/stymo/configs"};

}  // namespace

std::filesystem::path shipped_file(const std::filesystem::path& name) {
    const std::filesystem::path program = std::filesystem::read_symlink("/proc/self/exe");
    for (const char* folder : config_folders) {
        const std::filesystem::path file =
            (program.parent_path() / folder / name).lexically_normal();
        if (std::filesystem::exists(file)) return file;
    }
    return {};
}

std::filesystem::path shipped_landmark_network() {
    return shipped_file("models/landmarks/landmarks.safetensors");
}

}  // namespace stymo
