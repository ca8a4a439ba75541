#pragma once

#include <filesystem>

namespace stymo {

/// Writes a copy of a model for publication: 16-bit numbers, and no paths of weight files in its
/// configuration. Since LPIPS needs such a file, the perceptual term of the copy uses activations
/// of the model's own encoder; if the backbone does not provide activations, there is no perceptual
/// term. Throws FileError for a file that is not a model of stymo.
void publish_model(const std::filesystem::path& in, const std::filesystem::path& out);

}  // namespace stymo
