#pragma once

#include <filesystem>

namespace stymo {

/// Writes a model for other people: numbers of 16 bits, and no paths of weight files in its
/// configuration. Since LPIPS needs such files, fitting compares activations of the model's own
/// encoder instead, or, with a backbone that does not give them, no activations. Throws FileError
/// for a file that is not a model of stymo.
void publish_model(const std::filesystem::path& in, const std::filesystem::path& out);

}  // namespace stymo
