#include "render/texture.h"

#include <algorithm>
#include <bit>
#include <cmath>

#include "core/error.h"
#include "core/parallel.h"

namespace stymo {

namespace {

using Texels = std::vector<Eigen::Array4f>;  ///< colour times weight, weight

/// A texel may lie this far, in world units, behind what the picture's depth buffer has.
constexpr double texture_depth_tolerance = 0.02;

/// Interpolates rows of a (M, columns) tensor at a sample of a triangle.
void interpolate(const Tensor& values, const std::array<std::int32_t, 3>& triangle,
                 const std::array<double, 3>& weights, std::span<float> to) {
    std::ranges::fill(to, 0.0F);
    const std::int64_t columns = values.shape(1);
    for (std::size_t k = 0; k < 3; ++k) {
        const float* const row = values.values<float>().data() + columns * triangle[k];
        for (std::size_t c = 0; c < to.size(); ++c)
            to[c] += static_cast<float>(weights[k]) * row[c];
    }
}

/// Point, normal and guess of each texel (side, side, 10); coverage is 0 beside the triangles. The
/// atlas is drawn as a plane in front of a camera.
RasterImage drawn_atlas(const TexturedMesh& mesh, const Tensor& guess, std::int64_t side) {
    Tensor plane = Tensor::full(mesh.vertices.shape(), 1.0);
    const std::span<float> at = plane.mutable_values<float>();
    for (std::size_t i = 0; i < at.size() / 3; ++i)
        std::ranges::copy(mesh.uv.values<float>().subspan(2 * i, 2),
                          at.begin() + std::ptrdiff_t(3 * i));
    const auto paint = [&](std::int32_t index, const std::array<double, 3>& weights,
                           std::span<float> to) {
        const auto& triangle = mesh.triangles[static_cast<std::size_t>(index)];
        interpolate(mesh.vertices, triangle, weights, to.first(3));
        interpolate(mesh.normals, triangle, weights, to.subspan(3, 3));
        interpolate(guess, triangle, weights, to.subspan(6, 4));
        return true;
    };
    return rasterize(plane, mesh.triangles, 10, paint, {.intrinsics = {1.0, 0.0, 0.0}},
                     {side, side, 1});
}

/// The weight of a picture for a point of the surface, and where the picture shows it.
float weight_in(const TextureView& view, const Tensor& depths, const Eigen::Vector3d& point,
                const Eigen::Vector3d& normal, Eigen::Vector2f& position) {
    const Eigen::Vector3d seen = project(view.camera, point);
    if (seen[2] <= 0.0 || seen.head<2>().minCoeff() < 0.0 || seen.head<2>().maxCoeff() >= 1.0)
        return 0.0F;
    const std::int64_t side = depths.shape(0);
    const auto column = static_cast<std::int64_t>(seen[0] * double(side));
    const auto row = static_cast<std::int64_t>(seen[1] * double(side));
    const auto pixel = static_cast<std::size_t>(row * side + column);
    if (seen[2] > static_cast<double>(depths.values<float>()[pixel]) + texture_depth_tolerance)
        return 0.0F;
    position = seen.head<2>().cast<float>();
    const double cosine = std::max((view.camera.center - point).normalized().dot(normal), 0.0);
    // At the rim of the mask the picture mixes the head with what is behind it.
    const float inside =
        std::max(4.0F * texel(view.mask, position[0], position[1])[0] - 3.0F, 0.0F);
    return static_cast<float>(std::pow(cosine, 4.0)) * inside;
}

/// Where the surface hides itself in each picture.
std::vector<Tensor> depths_in(const Tensor& vertices,
                              std::span<const std::array<std::int32_t, 3>> triangles,
                              std::span<const TextureView> views) {
    std::vector<Tensor> depths;
    for (const TextureView& view : views)
        depths.push_back(rasterize(vertices, vertices, triangles, view.camera,
                                   {view.image.shape(1), view.image.shape(0), 1})
                             .depth);
    return depths;
}

/// The sum of the pictures' colours of a point, times their weights, and that of the weights.
Eigen::Array4f seen_at(const Eigen::Vector3d& point, const Eigen::Vector3d& normal,
                       std::span<const TextureView> views, std::span<const Tensor> depths) {
    Eigen::Array4f sum = Eigen::Array4f::Zero();
    for (std::size_t k = 0; k < views.size(); ++k) {
        Eigen::Vector2f position;
        const float weight = weight_in(views[k], depths[k], point, normal, position);
        if (weight == 0.0F) continue;
        Eigen::Array4f seen = texel(views[k].image, position[0], position[1]);
        seen[3] = 1.0F;
        sum += weight * seen;
    }
    return sum;
}

/// A hundredth of the weight of one straight view is enough to be sure of a colour.
constexpr float sure_weight = 0.01F;

/// Fills texels of little weight with the mean of those around them: each level of a pyramid is
/// filled with the next coarser one.
void fill(Texels& texels, std::int64_t side) {
    if (side % 2 != 0) return;
    const std::int64_t half = side / 2;
    Texels coarse(static_cast<std::size_t>(half * half), Eigen::Array4f::Zero());
    for (std::int64_t i = 0; i < side * side; ++i)
        coarse[static_cast<std::size_t>(i / side / 2 * half + i % side / 2)] +=
            texels[static_cast<std::size_t>(i)];
    for (Eigen::Array4f& texel : coarse) texel /= std::max(texel[3], 1.0F);
    fill(coarse, half);
    for (std::int64_t i = 0; i < side * side; ++i) {
        Eigen::Array4f& texel = texels[static_cast<std::size_t>(i)];
        if (texel[3] >= 1.0F) continue;
        Eigen::Array4f around = Eigen::Array4f::Zero();
        for (const std::int64_t below : {0, 1})
            for (const std::int64_t right : {0, 1}) {
                // The four nearest coarse texels, by distance: 3 / 4 and 1 / 4 on each axis.
                const std::int64_t row = (i / side + 2 * below - 1) / 2;
                const std::int64_t column = (i % side + 2 * right - 1) / 2;
                const std::int64_t y = std::clamp<std::int64_t>(row, 0, half - 1);
                const std::int64_t x = std::clamp<std::int64_t>(column, 0, half - 1);
                const float share = (below == i / side % 2 ? 0.25F : 0.75F) *
                                    (right == i % side % 2 ? 0.25F : 0.75F);
                around += share * coarse[static_cast<std::size_t>(y * half + x)];
            }
        texel += (1.0F - texel[3]) * around / std::max(around[3], 1e-20F);
    }
}

}  // namespace

Eigen::Array4f texel(const Tensor& texture, float u, float v, float white) {
    const std::int64_t height = texture.shape(0), width = texture.shape(1);
    const std::int64_t channels = texture.shape(2);
    const float* const texels = texture.values<float>().data();
    const float x = std::clamp(u, 0.0F, 1.0F) * static_cast<float>(width) - 0.5F;
    const float y = std::clamp(v, 0.0F, 1.0F) * static_cast<float>(height) - 0.5F;
    const float left = std::floor(x), top = std::floor(y);
    Eigen::Array4f result(0.0F, 0.0F, 0.0F, channels == 4 ? 0.0F : 1.0F);
    for (int corner = 0; corner < 4; ++corner) {
        const auto right = static_cast<float>(corner % 2), below = static_cast<float>(corner / 2);
        const float weight =
            std::abs(1.0F - right - (x - left)) * std::abs(1.0F - below - (y - top)) / white;
        const auto column = std::clamp<std::int64_t>(std::llround(left + right), 0, width - 1);
        const auto row = std::clamp<std::int64_t>(std::llround(top + below), 0, height - 1);
        const float* const from = texels + (row * width + column) * channels;
        for (std::int64_t c = 0; c < channels; ++c) result[c] += weight * from[c];
    }
    return result;
}

Tensor seen_colors(const Tensor& vertices, const Tensor& normals,
                   std::span<const std::array<std::int32_t, 3>> triangles,
                   std::span<const TextureView> views) {
    const std::vector<Tensor> depths = depths_in(vertices, triangles, views);
    Tensor result({vertices.shape(0), 4});
    const float *const points = vertices.values<float>().data(), *const directions =
                                                                     normals.values<float>().data();
    const std::span<float> values = result.mutable_values<float>();
    parallel_for(vertices.shape(0), 1024, [&](std::int64_t begin, std::int64_t end) {
        for (std::int64_t i = begin; i < end; ++i) {
            const auto at = [i](const float* rows) {
                return Eigen::Map<const Eigen::Vector3f>(rows + 3 * i).cast<double>().eval();
            };
            Eigen::Array4f sum = seen_at(at(points), at(directions), views, depths);
            sum.head<3>() /= std::max(sum[3], 1e-20F);
            sum[3] = std::min(sum[3], 1.0F);
            std::ranges::copy(sum, values.begin() + 4 * i);
        }
    });
    return result;
}

Tensor baked_texture(const TexturedMesh& mesh, std::span<const TextureView> views,
                     const Tensor& guess, std::int64_t side) {
    if (side < 1 || !std::has_single_bit(static_cast<std::uint64_t>(side)))
        fail<ValueError>("a texture's side is a power of two, not ", side);
    const std::vector<Tensor> depths = depths_in(mesh.vertices, mesh.triangles, views);
    const RasterImage atlas = drawn_atlas(mesh, guess, side);
    Texels texels(static_cast<std::size_t>(side * side), Eigen::Array4f::Zero());
    parallel_for(side * side, 4096, [&](std::int64_t begin, std::int64_t end) {
        for (auto i = static_cast<std::size_t>(begin); i < static_cast<std::size_t>(end); ++i) {
            if (atlas.coverage.values<float>()[i] == 0.0F) continue;
            const float* const at = atlas.color.values<float>().data() + 10 * i;
            const Eigen::Vector3d point = Eigen::Map<const Eigen::Vector3f>(at).cast<double>();
            const Eigen::Vector3d normal =
                Eigen::Map<const Eigen::Vector3f>(at + 3).cast<double>().normalized();
            Eigen::Array4f& sum = texels[i];
            sum << Eigen::Map<const Eigen::Array3f>(at + 6) * at[9], at[9];
            sum += seen_at(point, normal, views, depths);
            sum /= std::max(sum[3], sure_weight);
        }
    });
    fill(texels, side);
    Tensor texture({side, side, 3});
    const std::span<float> values = texture.mutable_values<float>();
    for (std::size_t i = 0; i < values.size(); ++i)
        values[i] = std::clamp(texels[i / 3][static_cast<Eigen::Index>(i % 3)], 0.0F, 1.0F);
    return texture;
}

RasterImage rendered_mesh(const TexturedMesh& mesh, const Camera& camera,
                          const RasterSettings& settings) {
    const auto paint = [&](std::int32_t index, const std::array<double, 3>& weights,
                           std::span<float> to) {
        std::array<float, 2> uv{};
        interpolate(mesh.uv, mesh.triangles[static_cast<std::size_t>(index)], weights, uv);
        const Eigen::Array4f color = texel(mesh.texture, uv[0], uv[1]);
        std::copy_n(color.data(), 3, to.begin());
        return true;
    };
    return rasterize(mesh.vertices, mesh.triangles, 3, paint, camera, settings);
}

}  // namespace stymo
