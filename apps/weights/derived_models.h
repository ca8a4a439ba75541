#pragma once

#include <filesystem>
#include <span>
#include <string>

namespace stymo {

/// Writes a copy of a model for publication: 16-bit numbers, and no paths of weight files in its
/// configuration. Since LPIPS needs such a file, the perceptual term of the copy uses activations
/// of the model's own encoder; if the backbone does not provide activations, there is no perceptual
/// term. Codes of either are codes of the other. Throws FileError for a file that is not a model of
/// stymo.
void publish_model(const std::filesystem::path& in, const std::filesystem::path& out);

/// Writes a model with more channels that renders the same images, so that a training can continue
/// with a larger decoder ("Net2Net", Chen et al. 2016). The weights of the new channels are random,
/// but the weights with which old channels read new ones are zero. `settings` are assignments
/// ("decoder.field_width=192") to decoder.field_width, .feature_channels, .block_channels and
/// .mask_channels, and to encoder.identity_backbone and .expression_backbone where there is none
/// yet: then the head of identity or expression is drawn anew, so that its codes lie near 0. Codes
/// stay as they are with encoder.identity_from_both, and with encoder.backbone=small_residual for a
/// model that has small_conv. Each doubling of decoder.resolution, for which decoder.block_channels
/// and reconstruction.resolution_weights need a number, adds a render block that enlarges the
/// images of before. Codes of the narrow model are codes of the wide one, until that is trained.
/// Throws ConfigError for other settings and for fewer channels or pixels, ValueError for a decoder
/// that is not the paper's, FileError for a file that is not a model of stymo.
void widen_model(const std::filesystem::path& in, const std::filesystem::path& out,
                 std::span<const std::string> settings);

}  // namespace stymo
