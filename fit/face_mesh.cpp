#include "fit/face_mesh.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

#include "core/tensor_eigen.h"
#include "render/continued_colors.h"
#include "render/morphable/head_atlas.h"

namespace stymo {

namespace {

/// The head without the brows of the built-in head, which stand on its skin. Here the texture has
/// them.
MorphableHead without_brows(MorphableHead head) {
    if (head.grid_uv.defined())
        std::erase_if(head.triangles, [&](const auto& triangle) {
            return head.parts[static_cast<std::size_t>(triangle[0])] == HeadPart::brows;
        });
    return head;
}

/// Colours (V, 4) of what the views hardly show, with the small weights of baked_texture. The skin
/// continues what they show; eyes and the inside of the mouth are those of the head in the shade,
/// as bright as this face's nose is against the head's.
Tensor guessed_colors(const MorphableHead& head, const LaidHead& laid, const SeenFace& frontal,
                      const Tensor& shown) {
    Eigen::Array3f seen = Eigen::Array3f::Constant(1e-6F), expected = seen;
    for (std::size_t k = 27; k < 36; ++k) {
        const Eigen::Vector2f position = laid.landmarks[k].cast<float>();
        seen += texel(frontal.image, position[0], position[1]).head<3>();
        expected += matrix_map<float>(head.mean_albedo).row(head.landmarks[k]).transpose().array();
    }
    const float brightness = std::clamp(seen.sum() / expected.sum(), 0.3F, 1.5F);
    constexpr float weight = 0.01F, shade = 0.7F;
    const Tensor continued = continued_colors(shown, head.triangles);
    Tensor guess = Tensor::zeros({head.vertex_count(), 4});
    auto rows = mutable_matrix_map<float>(guess);
    for (Eigen::Index i = 0; i < rows.rows(); ++i) {
        const HeadPart part = head.parts[static_cast<std::size_t>(i)];
        if (part == HeadPart::eyes || part == HeadPart::mouth)
            rows.row(i) << shade * brightness * matrix_map<float>(head.mean_albedo).row(i), weight;
        else
            rows.row(i) << matrix_map<float>(continued).row(i),
                std::max(weight - matrix_map<float>(shown)(i, 3), 0.0F);
    }
    return guess;
}

/// Displacements (52, M, 3) by the shapes, turned and scaled as the head was.
Tensor laid_targets(const ArkitShapes& shapes, const HeadAtlas& atlas, const LaidHead& laid) {
    const std::int64_t count = shapes.displacement.shape(1);
    const auto corners = static_cast<std::int64_t>(atlas.vertex.size());
    Tensor targets({shapes.displacement.shape(0), corners, 3});
    auto to = mutable_matrix_map<float>(targets);
    const Eigen::Matrix3f turn = laid.world_from_head.transpose().cast<float>();
    RowMajorMatrix<float> at_corners(corners, 3);
    for (std::int64_t shape = 0; shape < targets.shape(0); ++shape) {
        const auto from = matrix_map<float>(shapes.displacement).middleRows(shape * count, count);
        for (std::size_t i = 0; i < atlas.vertex.size(); ++i)
            at_corners.row(static_cast<Eigen::Index>(i)) = from.row(atlas.vertex[i]);
        to.middleRows(shape * corners, corners).noalias() = at_corners * turn;
    }
    return targets;
}

}  // namespace

FaceMesh face_mesh(const Model& model, const Codes& codes, const MorphableHead& head,
                   const LandmarkModel& landmarks, std::int64_t texture_side, bool neutral) {
    const std::vector<SeenFace> views = surface_views(model, codes);
    FaceMesh face;
    face.head = fitted_head(head, landmarks, views.front());
    lay_on_surface(head, views, face.head);
    const HeadAtlas atlas = head_atlas(without_brows(head));
    const auto take_vertices = [&](const Tensor& vertices) {
        face.surface.vertices = at_atlas_vertices(atlas, vertices);
        face.surface.normals = at_atlas_vertices(atlas, vertex_normals(vertices, head.triangles));
    };
    face.surface.uv = atlas.uv;
    face.surface.triangles = atlas.triangles;
    take_vertices(face.head.vertices);
    std::vector<TextureView> pictures;
    for (const SeenFace& view : views) pictures.push_back({view.camera, view.image, view.mask});
    const Tensor shown =
        seen_colors(face.head.vertices, vertex_normals(face.head.vertices, head.triangles),
                    head.triangles, pictures);
    face.surface.texture = baked_texture(
        face.surface, pictures,
        at_atlas_vertices(atlas, guessed_colors(head, face.head, views.front(), shown)),
        texture_side);
    if (neutral) take_vertices(neutral_vertices(head, face.head));
    face.shapes = arkit_shapes(head);
    face.targets = laid_targets(face.shapes, atlas, face.head);
    return face;
}

}  // namespace stymo
