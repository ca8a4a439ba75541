#include "fit/morphable/mesh_overlay.h"

#include <algorithm>

#include "render/morphable/shading.h"
#include "render/rasterizer.h"

namespace stymo {

Tensor with_fitted_head(const Tensor& photo, const MorphableHead& head, const MorphableFit& fit,
                        const Intrinsics& intrinsics) {
    constexpr float opacity = 0.6F;
    const Camera camera = camera_from_pose(fit.pose, intrinsics);
    const Tensor vertices = head_vertices(head, fit.identity, fit.expression);
    const Tensor colors =
        shaded_colors(head_albedo(head, fit.texture), vertex_normals(vertices, head.triangles),
                      fit.light, camera);
    const RasterImage raster =
        rasterize(vertices, colors, head.triangles, camera, {photo.shape(1), photo.shape(0), 2});
    Tensor result = photo;
    const auto target = result.mutable_values<float>();
    const auto drawn = raster.color.values<float>();
    const auto coverage = raster.coverage.values<float>();
    for (std::size_t i = 0; i < target.size(); ++i)
        target[i] = std::clamp(target[i] * (1.0F - opacity * coverage[i / 3]) + opacity * drawn[i],
                               0.0F, 1.0F);
    return result;
}

}  // namespace stymo
