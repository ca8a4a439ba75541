#pragma once

#include <filesystem>

namespace stymo {

/// Writes a model for other people: numbers of 16 bits, and no paths of weight files in its
/// configuration. Since LPIPS needs such files, fitting to the model goes without LPIPS unless
/// asked otherwise. Throws FileError for a file that is not a model of stymo.
void publish_model(const std::filesystem::path& in, const std::filesystem::path& out);

}  // namespace stymo
