#include "fit/morphable/mesh_overlay.h"

#include <algorithm>

#include "render/rasterizer.h"
#include "render/spherical_harmonics.h"

namespace stymo {

Tensor with_fitted_head(const Tensor& photo, const MorphableHead& head, const MorphableFit& fit, const Intrinsics& intrinsics) {
    constexpr float opacity = 0.6F;
    const Camera camera = camera_from_pose(fit.pose, intrinsics);
    const Tensor vertices = head_vertices(head, fit.identity, fit.expression);
    const Tensor normals = vertex_normals(vertices, head.triangles);
    Tensor colors = head_albedo(head, fit.texture);
    const auto normal_values = normals.values<float>();
    const auto color_values = colors.mutable_values<float>();
    for (std::size_t vertex = 0; vertex < color_values.size(); vertex += 3) {
        Vector3 normal{};
        for (std::size_t axis = 0; axis < 3; ++axis) {
            for (std::size_t k = 0; k < 3; ++k)
                normal[axis] += camera.world_from_camera[k][axis] * static_cast<double>(normal_values[vertex + k]);
        }
        const Vector3 light = irradiance(fit.light, normal);
        for (std::size_t channel = 0; channel < 3; ++channel)
            color_values[vertex + channel] *= static_cast<float>(light[channel]);
    }
    const RasterImage raster = rasterize(vertices, colors, head.triangles, camera, {photo.shape(1), photo.shape(0), 2});
    Tensor result = photo;
    const auto target = result.mutable_values<float>();
    const auto drawn = raster.color.values<float>();
    const auto coverage = raster.coverage.values<float>();
    for (std::size_t i = 0; i < target.size(); ++i)
        target[i] = std::clamp(target[i] * (1.0F - opacity * coverage[i / 3]) + opacity * drawn[i], 0.0F, 1.0F);
    return result;
}

}  // namespace stymo
