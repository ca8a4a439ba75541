#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <span>
#include <vector>

#include "core/tensor.h"
#include "render/camera.h"

namespace stymo {

struct RasterSettings {
    std::int64_t width = 128;
    std::int64_t height = 128;
    /// Antialiasing: each pixel is the mean of samples_per_side^2 samples on a regular grid. 1
    /// samples only the pixel's centre.
    std::int64_t samples_per_side = 3;
};

struct RasterImage {
    Tensor color;     ///< (height, width, channels) float32, premultiplied: the background is 0
    Tensor coverage;  ///< (height, width, 1), fraction of the samples that a triangle covers
    Tensor depth;     ///< (height, width, 1), depth along the optical axis of the pixel's nearest
                      ///< sample; infinity where there is none
    /// height * width elements: the triangle of that sample, -1 where there is none.
    std::vector<std::int32_t> triangle;
};

/// Draws triangles with a depth buffer and perspective-correct colours. Triangles are visible from
/// both sides. Triangles that share an edge leave no gap. At equal depth the first triangle is
/// kept. A triangle that is partly behind the camera is left out. vertices (V, 3) in world
/// coordinates and colors (V, 3), float32. The camera's intrinsics are in units of the image's
/// width. The result does not depend on the number of threads. Throws ShapeError for shapes that do
/// not match, ValueError for settings below 1 and for triangles that refer to a missing vertex.
[[nodiscard]] RasterImage rasterize(const Tensor& vertices, const Tensor& colors,
                                    std::span<const std::array<std::int32_t, 3>> triangles,
                                    const Camera& camera, const RasterSettings& settings);

/// Writes the channels of a triangle's sample, whose perspective-correct barycentric coordinates
/// are `weights`. False: the triangle is transparent there, and nothing was written.
using SampleColor = std::function<bool(std::int32_t triangle, const std::array<double, 3>& weights,
                                       std::span<float> color)>;

/// The same with colours that are computed for each sample, for textures. `color` is called on
/// several threads.
[[nodiscard]] RasterImage rasterize(const Tensor& vertices,
                                    std::span<const std::array<std::int32_t, 3>> triangles,
                                    std::int64_t channels, const SampleColor& color,
                                    const Camera& camera, const RasterSettings& settings);

}  // namespace stymo
