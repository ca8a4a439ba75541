#include "nn/realtime/mesh_colors.h"

#include <algorithm>
#include <cmath>
#include <cstddef>

#include "core/io/ply_file.h"
#include "core/parallel.h"
#include "nn/realtime/view_range.h"
#include "render/continued_colors.h"
#include "render/morphable/head.h"
#include "render/rasterizer.h"
#include "render/soft_edge.h"

namespace stymo {

namespace {

constexpr std::int64_t vertices_per_chunk = 4096;
/// Tolerance, in world units, for the depth of a vertex behind the depth of its pixel, for rounding
/// of mesh and image.
constexpr double depth_tolerance = 0.05;

/// A view of the face by one camera.
struct ColoredView {
    Camera camera;
    Tensor image;    ///< (S, S, 3)
    Tensor opacity;  ///< (S, S, 1), of the head
    Tensor depth;    ///< (S, S, 1), of the mesh
};

Eigen::Vector3d vector_at(std::span<const float> values, std::int64_t index) {
    return Eigen::Map<const Eigen::Vector3f>(values.data() + 3 * index).cast<double>();
}

/// Weight of a view for a vertex: the fourth power of the cosine between normal and view direction
/// (slanted surfaces are blurred) times the opacity; 0 if the vertex is not visible. `pixel` is set
/// unless the weight is 0.
double weight_of(const ColoredView& view, const Eigen::Vector3d& vertex,
                 const Eigen::Vector3d& normal, std::size_t& pixel) {
    const std::int64_t side = view.image.shape(0);
    const Eigen::Vector3d image = project(view.camera, vertex);
    if (!(image[2] > 0.0) || !(image.head<2>().cwiseAbs().maxCoeff() < 1e6)) return 0.0;
    const auto column = static_cast<std::int64_t>(std::floor(image[0] * static_cast<double>(side)));
    const auto row = static_cast<std::int64_t>(std::floor(image[1] * static_cast<double>(side)));
    if (column < 0 || column >= side || row < 0 || row >= side) return 0.0;
    pixel = static_cast<std::size_t>(row * side + column);
    if (image[2] > static_cast<double>(view.depth.values<float>()[pixel]) + depth_tolerance)
        return 0.0;
    const Eigen::Vector3d to_camera = (view.camera.center - vertex).normalized();
    const double cosine = std::max(to_camera.dot(normal), 0.0);
    return std::pow(cosine, 4.0) * static_cast<double>(view.opacity.values<float>()[pixel]);
}

/// Adds weight times colour, and the weight as the fourth number.
void add_view(const ColoredView& view, const TriangleMesh& mesh, const Tensor& normals,
              std::span<double> sums) {
    const std::span<const float> colors = view.image.values<float>();
    parallel_for(
        mesh.vertices.shape(0), vertices_per_chunk, [&](std::int64_t begin, std::int64_t end) {
            for (std::int64_t i = begin; i < end; ++i) {
                std::size_t pixel = 0;
                const double weight = weight_of(view, vector_at(mesh.vertices.values<float>(), i),
                                                vector_at(normals.values<float>(), i), pixel);
                if (weight == 0.0) continue;
                double* sum = sums.data() + 4 * i;
                for (std::size_t channel = 0; channel < 3; ++channel)
                    sum[channel] += weight * static_cast<double>(colors[3 * pixel + channel]);
                sum[3] += weight;
            }
        });
}

/// Weighted means of the colours, (V, 4), with the weights up to 1.
Tensor means(std::span<const double> sums) {
    Tensor result({static_cast<std::int64_t>(sums.size() / 4), 4});
    const std::span<float> colors = result.mutable_values<float>();
    for (std::size_t i = 0; i < sums.size(); i += 4) {
        for (std::size_t channel = 0; channel < 3; ++channel)
            colors[i + channel] =
                static_cast<float>(sums[i + channel] / std::max(sums[i + 3], 1e-30));
        colors[i + 3] = static_cast<float>(std::min(sums[i + 3], 1.0));
    }
    return result;
}

}  // namespace

Tensor mesh_colors(const Model& model, const Codes& codes, const TriangleMesh& mesh,
                   const Tensor& normals, const RendererOptions& rendering) {
    RendererOptions options = rendering;
    options.mask = true;
    options.depth = false;
    FaceRenderer renderer(model, options);
    renderer.show(codes);
    std::vector<double> sums(static_cast<std::size_t>(4 * mesh.vertices.shape(0)), 0.0);
    const ViewRange usual{.camera = model.config().camera};
    for (const Camera& camera : cameras_over(usual, 3, 3)) {
        const View view = renderer.render(camera);
        const std::int64_t side = view.image.shape(0);
        const RasterImage raster =
            rasterize(mesh.vertices, mesh.vertices, mesh.triangles, camera,
                      {.width = side, .height = side, .samples_per_side = 1});
        add_view({camera, view.image, soft_opacity(view.mask), raster.depth}, mesh, normals, sums);
    }
    return continued_colors(means(sums), mesh.triangles);
}

void write_head_ply(const std::filesystem::path& path, const Model& model, const Codes& codes,
                    const HeadMeshOptions& meshing, RendererOptions rendering) {
    rendering.mode = RenderMode::exact;
    const TriangleMesh mesh = head_mesh(model, codes, 0, meshing);
    const Tensor normals = vertex_normals(mesh.vertices, mesh.triangles);
    write_ply(path, {.vertices = mesh.vertices,
                     .normals = normals,
                     .colors = mesh_colors(model, codes, mesh, normals, rendering),
                     .triangles = mesh.triangles});
}

}  // namespace stymo
