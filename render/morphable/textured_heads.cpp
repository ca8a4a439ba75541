#include "render/morphable/textured_heads.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <sstream>

#include "core/error.h"
#include "render/morphable/head.h"
#include "render/morphable/scanned_head.h"
#include "render/spherical_harmonics.h"
#include "render/texture.h"

namespace stymo {

namespace {

using Points = Eigen::Map<Eigen::Matrix3Xf>;
using ConstPoints = Eigen::Map<const Eigen::Matrix3Xf>;

[[nodiscard]] Points points(Tensor& tensor) {
    return {tensor.mutable_values<float>().data(), 3, tensor.size() / 3};
}

/// The points (count, 3) that begin at row `row` of a tensor whose last extent is 3.
[[nodiscard]] ConstPoints points(const Tensor& tensor, std::int64_t row, std::int64_t count) {
    return {tensor.values<float>().data() + 3 * row, 3, count};
}

[[nodiscard]] std::vector<TexturedPart> read_parts(const morphable::HeadTensors& file,
                                                   const std::string& kind, std::int64_t heads,
                                                   std::int64_t skin) {
    std::vector<TexturedPart> parts;
    for (std::size_t k = 0;; ++k) {
        const std::string prefix = kind + "." + std::to_string(k) + ".";
        if (!file.has(prefix + "vertices")) return parts;
        TexturedPart part;
        part.owner =
            file.indices(prefix + "owner", file.take(prefix + "owner", {1}), heads).front();
        part.vertices = file.take(prefix + "vertices", 2, {3}, "(P, 3)");
        const std::int64_t count = part.vertices.shape(0);
        part.triangles = file.triangles(prefix + "triangles", count);
        part.uv = file.take(prefix + "uv", {count, 2});
        part.texture = file.take(prefix + "texture", 3, {4}, "(S, S, 4)");
        const Tensor anchors = file.take(prefix + "anchors", 2, {}, "(P, A)");
        part.anchors = file.indices(prefix + "anchors",
                                    file.take(prefix + "anchors", {count, anchors.shape(1)}), skin);
        parts.push_back(std::move(part));
    }
}

/// sum_k weights[k] values[k]
[[nodiscard]] Tensor weighted_sum(const Tensor& values, std::span<const float> weights,
                                  const Shape& shape) {
    Tensor sum = Tensor::zeros(shape);
    Eigen::Map<Eigen::ArrayXf> to(sum.mutable_values<float>().data(), sum.size());
    for (std::size_t k = 0; k < weights.size(); ++k) {
        if (weights[k] == 0.0F) continue;
        const float* const from =
            values.values<float>().data() + static_cast<std::int64_t>(k) * sum.size();
        to += weights[k] * Eigen::Map<const Eigen::ArrayXf>(from, sum.size());
    }
    return sum;
}

/// Joins the skin and the parts.
struct SurfaceBuilder {
    TexturedSurface surface;
    std::vector<float> vertices, normals, uv, head;

    void add(const Tensor& added, const Tensor& added_normals, const Tensor& coordinates,
             std::span<const std::array<std::int32_t, 3>> triangles, TexturedLayer layer) {
        const auto first = static_cast<std::int32_t>(vertices.size() / 3);
        layer.first_triangle = static_cast<std::int32_t>(surface.triangles.size());
        surface.layers.push_back(std::move(layer));
        const auto append = [](std::vector<float>& to, const Tensor& from) {
            to.insert(to.end(), from.values<float>().begin(), from.values<float>().end());
        };
        append(vertices, added);
        append(normals, added_normals);
        append(uv, coordinates);
        for (const auto& [a, b, c] : triangles)
            surface.triangles.push_back({first + a, first + b, first + c});
    }

    void add_part(const TexturedPart& part, const TexturedHeads& heads, const Tensor& skin,
                  const Eigen::Vector3f& tint) {
        const std::int64_t skin_count = skin.shape(0);
        const Eigen::Matrix3Xf moved = points(skin, 0, skin_count) -
                                       points(heads.vertices, part.owner * skin_count, skin_count);
        Tensor added = part.vertices;
        Points to = points(added);
        const auto anchors = static_cast<Eigen::Index>(part.anchors.size()) / to.cols();
        for (Eigen::Index vertex = 0; vertex < to.cols(); ++vertex) {
            Eigen::Vector3f sum = Eigen::Vector3f::Zero();
            for (Eigen::Index k = 0; k < anchors; ++k)
                sum += moved.col(part.anchors[static_cast<std::size_t>(vertex * anchors + k)]);
            to.col(vertex) += sum / static_cast<float>(anchors);
        }
        add(added, vertex_normals(added, part.triangles), part.uv, part.triangles,
            {0, part.texture, tint});
        head.resize(vertices.size() / 3, 1.0F);
    }
};

/// Normals of the skin without the seams of its texture.
[[nodiscard]] Tensor welded_normals(const TexturedHeads& heads, const Tensor& skin) {
    auto triangles = heads.triangles;
    for (auto& triangle : triangles)
        for (std::int32_t& vertex : triangle)
            vertex = heads.welded[static_cast<std::size_t>(vertex)];
    const Tensor of_first = vertex_normals(skin, triangles);
    Tensor normals = of_first;
    Points to = points(normals);
    for (Eigen::Index vertex = 0; vertex < to.cols(); ++vertex)
        to.col(vertex) = points(of_first, heads.welded[static_cast<std::size_t>(vertex)], 1);
    return normals;
}

/// Whether a triangle is skin that is seen from within, through the mouth. Below the shoulders it
/// is seen where the clothes end.
[[nodiscard]] std::vector<char> throat_of(const TexturedSurface& surface,
                                          const Eigen::Vector3d& eye) {
    const std::size_t skin = surface.layers.size() > 1
                                 ? static_cast<std::size_t>(surface.layers[1].first_triangle)
                                 : surface.triangles.size();
    std::vector<char> result(surface.triangles.size(), 0);
    for (std::size_t i = 0; i < skin; ++i) {
        Eigen::Matrix3f corners;
        for (Eigen::Index k = 0; k < 3; ++k)
            corners.col(k) =
                points(surface.vertices, surface.triangles[i][static_cast<std::size_t>(k)], 1);
        const Eigen::Vector3f outward =
            (corners.col(1) - corners.col(0)).cross(corners.col(2) - corners.col(0));
        constexpr float shoulders = -1.1F;
        const bool inside = outward.dot(eye.cast<float>() - corners.col(0)) < 0.0F;
        result[i] = inside && corners.row(1).mean() > shoulders ? 1 : 0;
    }
    return result;
}

}  // namespace

TexturedHeads read_textured_heads(const std::filesystem::path& path) {
    const morphable::HeadTensors file(path, "a file of textured heads");
    TexturedHeads heads;
    heads.name = file.path();
    heads.vertices = file.take("vertices", 3, {3}, "(N, V, 3)");
    const std::int64_t count = heads.vertices.shape(0), skin = heads.vertices.shape(1);
    heads.triangles = file.triangles("triangles", skin);
    heads.uv = file.take("uv", {skin, 2});
    heads.welded = file.indices("welded", file.take("welded", {skin}), skin);
    heads.head = file.take("head", {skin});
    heads.landmarks = file.landmarks(skin);
    heads.expressions = file.take("expressions", 3, {skin, 3}, "(E, V, 3)");
    std::istringstream names(file.metadata("expressions"));
    for (std::string name; names >> name;) heads.expression_names.push_back(name);
    if (std::ssize(heads.expression_names) != heads.expressions.shape(0))
        fail<FileError>(heads.name, ": \"expressions\" has ", heads.expressions.shape(0),
                        " rows, its metadata ", heads.expression_names.size(), " names");
    heads.textures = file.take("textures", 4, {3}, "(N, S, S, 3)");
    if (heads.textures.shape(0) != count)
        fail<FileError>(heads.name, ": \"textures\" is ", heads.textures.shape(), ", expected ",
                        count, " textures");
    heads.teeth = read_parts(file, "teeth", count, skin);
    heads.hair = read_parts(file, "hair", count, skin);
    return heads;
}

TexturedSurface textured_surface(const TexturedHeads& heads, const TexturedPerson& person,
                                 std::span<const float> expression) {
    if (std::ssize(person.weights) != heads.vertices.shape(0) ||
        std::ssize(expression) != heads.expressions.shape(0))
        fail<ShapeError>("[textured heads] needs ", heads.vertices.shape(0), " weights and ",
                         heads.expressions.shape(0), " of expressions; got ", person.weights.size(),
                         " and ", expression.size());
    if (person.hair >= std::ssize(heads.hair))
        fail<ValueError>("[textured heads] no hair ", person.hair, " of ", heads.hair.size());
    const Shape shape{heads.vertices.shape(1), 3};
    Tensor skin = weighted_sum(heads.vertices, person.weights, shape);
    const morphable::HeadFrame frame = morphable::head_frame(skin, heads.landmarks, heads.name);
    points(skin) += points(weighted_sum(heads.expressions, expression, shape), 0, shape[0]);

    SurfaceBuilder builder;
    const Shape texture{heads.textures.shape(1), heads.textures.shape(2), 3};
    builder.add(skin, welded_normals(heads, skin), heads.uv, heads.triangles,
                {0, weighted_sum(heads.textures, person.weights, texture), person.skin_tint});
    builder.head.assign(heads.head.values<float>().begin(), heads.head.values<float>().end());
    for (const TexturedPart& part : heads.teeth)
        builder.add_part(part, heads, skin, Eigen::Vector3f::Ones());
    if (person.hair >= 0)
        builder.add_part(heads.hair[static_cast<std::size_t>(person.hair)], heads, skin,
                         person.hair_tint);

    TexturedSurface surface = std::move(builder.surface);
    const auto count = std::ssize(builder.head);
    surface.vertices = Tensor::from({count, 3}, std::span<const float>(builder.vertices));
    points(surface.vertices) =
        (static_cast<float>(frame.scale) * points(surface.vertices)).colwise() +
        frame.offset.cast<float>();
    surface.normals = Tensor::from({count, 3}, std::span<const float>(builder.normals));
    surface.uv = Tensor::from({count, 2}, std::span<const float>(builder.uv));
    surface.head = Tensor::from({count}, std::span<const float>(builder.head));
    for (std::size_t k = 0; k < surface.landmarks.size(); ++k)
        surface.landmarks[k] =
            points(surface.vertices, heads.landmarks[k], 1).col(0).cast<double>();
    return surface;
}

RasterImage render_textured(const TexturedSurface& surface, std::span<const float> light,
                            const Camera& camera, std::int64_t side) {
    const auto uv = surface.uv.values<float>();
    const auto head = surface.head.values<float>();
    const Eigen::Matrix3d camera_from_world = camera.world_from_camera.transpose();
    Eigen::Matrix3Xf received(3, surface.vertices.shape(0));
    for (Eigen::Index vertex = 0; vertex < received.cols(); ++vertex) {
        const Eigen::Vector3d normal = points(surface.normals, vertex, 1).col(0).cast<double>();
        received.col(vertex) = irradiance(light, camera_from_world * normal).cast<float>();
    }
    const std::vector<char> throat = throat_of(surface, camera.center);
    const auto paint = [&](std::int32_t triangle, const std::array<double, 3>& weights,
                           std::span<float> to) {
        const auto layer =
            std::ranges::upper_bound(surface.layers, triangle, {}, &TexturedLayer::first_triangle) -
            1;
        float u = 0.0F, v = 0.0F, on_head = 0.0F;
        Eigen::Array3f irradiated = Eigen::Array3f::Zero();
        for (std::size_t k = 0; k < 3; ++k) {
            const auto weight = static_cast<float>(weights[k]);
            const auto vertex =
                static_cast<std::size_t>(surface.triangles[static_cast<std::size_t>(triangle)][k]);
            u += weight * uv[2 * vertex];
            v += weight * uv[2 * vertex + 1];
            on_head += weight * head[vertex];
            irradiated += weight * received.col(static_cast<Eigen::Index>(vertex)).array();
        }
        const Eigen::Array4f color = texel(layer->texture, u, v, 255.0F);
        if (color[3] < 0.5F) return false;
        // The throat is dark, and belongs to the head.
        constexpr float throat_light = 0.2F;
        const bool in_throat = throat[static_cast<std::size_t>(triangle)] != 0;
        const Eigen::Array3f seen =
            (color.head<3>() * layer->tint.array() * irradiated * (in_throat ? throat_light : 1.0F))
                .max(0.0F)
                .min(1.0F);
        const float share = in_throat || on_head >= 0.5F ? 1.0F : 0.0F;
        for (std::size_t c = 0; c < 3; ++c) {
            to[c] = seen[static_cast<Eigen::Index>(c)];
            to[3 + c] = share * to[c];
        }
        to[6] = share;
        return true;
    };
    return rasterize(surface.vertices, surface.triangles, 7, paint, camera, {side, side, 3});
}

}  // namespace stymo
