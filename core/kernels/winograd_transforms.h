#pragma once

#include <array>
#include <cstdint>

/// The linear maps of Winograd's F(4x4, 3x3) on pixels with many channels. Each map takes a square
/// of pixels to another one, along columns and then along rows; channels are independent and
/// contiguous, their number a multiple of 16. Where a square is given as pointers, each points at a
/// pixel's channels; where it is given as a start and a stride, its places are that far apart.
namespace stymo::kernels {

inline constexpr std::int64_t winograd_tile = 4;   ///< side of a square of output pixels
inline constexpr std::int64_t winograd_patch = 6;  ///< side of the input pixels that it depends on
inline constexpr std::int64_t winograd_places =
    36;  ///< products for each tile and pair of channels

using PatchPixels = std::array<const float*, 36>;
using TilePixels = std::array<float*, 16>;
using ConstTilePixels = std::array<const float*, 16>;

/// B^T d B, from a patch.
void winograd_transform_patch(const PatchPixels& patch, float* places, std::int64_t place_stride,
                              std::int64_t channels);
/// The same of values that pass where `signs` is positive and are multiplied by `slope` elsewhere.
void winograd_transform_gated_patch(const PatchPixels& patch, const PatchPixels& signs, float slope,
                                    float* places, std::int64_t place_stride,
                                    std::int64_t channels);
/// leaky_relu(A^T m A + bias, slope), to a tile of outputs.
void winograd_transform_products(const float* places, std::int64_t place_stride, const float* bias,
                                 float slope, const TilePixels& tile, std::int64_t channels);
/// A g A^T, from a tile of the outputs' gradients: the adjoint of the one before.
void winograd_transform_tile(const ConstTilePixels& tile, float* places, std::int64_t place_stride,
                             std::int64_t channels);
/// Where one row of a matrix for each place goes: panels of `panel_width` channels, `panel_stride`
/// apart.
struct PanelRows {
    float* first;
    std::int64_t place_stride;
    std::int64_t panel_width;
    std::int64_t panel_stride;
};
/// G w G^T, from nine taps (3, 3, channels); `turned`: from the filter turned by 180 degrees.
void winograd_transform_filter(const float* taps, bool turned, const PanelRows& rows,
                               std::int64_t channels);
/// G^T m G, to nine taps: the adjoint of the one before.
void winograd_transform_to_filter(const float* places, std::int64_t place_stride, float* taps,
                                  std::int64_t channels);

}  // namespace stymo::kernels
