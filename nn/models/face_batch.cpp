#include "nn/models/face_batch.h"

#include <algorithm>

#include "core/error.h"
#include "core/io/image.h"
#include "core/ops/elementwise.h"
#include "core/ops/resample.h"
#include "core/ops/shape_ops.h"
#include "nn/known_pixels.h"
#include "nn/losses.h"
#include "nn/models/code_correction.h"

namespace stymo {
namespace {

/// The sides of the targets.
ResolutionLadder common_ladder(std::span<const Face> faces, std::int64_t smallest_target) {
    if (faces.empty()) fail<ValueError>("a batch needs at least one face");
    const std::int64_t side = faces[0].image.shape(0);
    for (const Face& face : faces)
        if (!(face.image.shape() == Shape{side, side, 3}) ||
            !(face.mask.shape() == Shape{side, side, 1}))
            fail<ShapeError>("face ", face.id, ": image ", face.image.shape(), " and mask ",
                             face.mask.shape(), " in a batch of side ", side);
    try {
        return {smallest_target, side};
    } catch (const ValueError&) {
        fail<ShapeError>("a batch needs faces with a side of ", smallest_target, ", ",
                         2 * smallest_target, ", ", 4 * smallest_target, ", ..., got ", side);
    }
}

Tensor stacked(std::span<const Face> faces, Tensor Face::*member) {
    const Shape& shape = (faces[0].*member).shape();
    Tensor result({static_cast<std::int64_t>(faces.size()), shape[0], shape[1], shape[2]});
    auto next = result.mutable_values<float>().begin();
    for (const Face& face : faces) {
        const std::span<const float> values = (face.*member).values<float>();
        next = std::copy(values.begin(), values.end(), next);
    }
    return result;
}

/// Undefined if all pixels of all faces are known.
Tensor known_of_all(std::span<const Face> faces) {
    if (std::ranges::none_of(faces, [](const Face& face) { return face.known.defined(); }))
        return {};
    std::vector<Variable> rows;
    for (const Face& face : faces) {
        const Shape shape = {1, face.mask.shape(0), face.mask.shape(1), 1};
        rows.push_back(face.known.defined() ? Variable(face.known.reshaped(shape))
                                            : Variable(Tensor::full(shape, 1.0)));
    }
    return concat(rows, 0).value();
}

Tensor shrunk(const Tensor& images, std::int64_t side, double low, double high) {
    if (images.shape(1) == side) return images;
    return clamp(resize_bicubic(images, static_cast<int>(side), static_cast<int>(side)), low, high)
        .value();
}

void add_codes(FaceBatch& batch, std::span<const Face> faces) {
    const auto count = static_cast<std::int64_t>(faces.size());
    batch.code_present = Tensor::zeros({count});
    const std::span<float> present = batch.code_present.mutable_values<float>();
    for (std::size_t i = 0; i < faces.size(); ++i) present[i] = faces[i].has_code ? 1.0F : 0.0F;
    std::ptrdiff_t first = 0;
    for (std::size_t group = 0; group < code_sizes.size(); ++group) {
        const std::ptrdiff_t size = code_sizes[group];
        batch.codes[group] = Tensor::zeros({count, size});
        auto row = batch.codes[group].mutable_values<float>().begin();
        for (const Face& face : faces) {
            if (face.has_code) std::copy_n(face.code.begin() + first, size, row);
            row += size;
        }
        first += size;
    }
}

}  // namespace

Face mirrored(const Face& face) {
    Face result = face;
    result.image = mirror_image(face.image);
    result.mask = mirror_image(face.mask);
    if (face.known.defined()) result.known = mirror_image(face.known);
    result.pose = mirrored(face.pose);
    result.intrinsics.center_x = 1.0 - face.intrinsics.center_x;
    result.is_mirrored = !face.is_mirrored;
    result.code.clear();
    result.has_code = false;
    return result;
}

FaceBatch make_batch(std::span<const Face> faces, std::int64_t smallest_target,
                     std::int64_t largest_target) {
    const ResolutionLadder ladder = common_ladder(faces, smallest_target).up_to(largest_target);
    const Variable images(stacked(faces, &Face::image));

    FaceBatch batch;
    batch.known = known_of_all(faces);
    batch.mask = where_known(batch.known, stacked(faces, &Face::mask), 0.0).value();
    batch.ray_mask = shrunk(batch.mask, smallest_target / 2, 0.0, 1.0);
    batch.input = with_guesses(batch.known, affine(images, 2.0, -1.0).value());
    const Tensor target = affine(images * Variable(batch.mask), 2.0, -1.0).value();
    for (const std::int64_t s : ladder.sides())
        batch.targets.push_back(
            where_known(known_at(batch.known, s, s), shrunk(target, s, -1.0, 1.0), -1.0).value());

    for (const Face& face : faces) {
        batch.ids.push_back(face.id);
        batch.sources.push_back(face.source);
        batch.mirrored.push_back(face.is_mirrored);
        batch.has_mask.push_back(face.has_mask);
        batch.cameras.push_back(camera_from_pose(face.pose, face.intrinsics));
    }
    add_codes(batch, faces);
    return batch;
}

void read_people_from(FaceBatch& batch, std::span<const Face> own, std::span<const Face> others,
                      std::vector<Shared> shared) {
    const std::size_t count = batch.cameras.size();
    if (own.size() != count || others.size() != count || shared.size() != count)
        fail<ShapeError>(others.size(), " photos for the people of ", count, " faces");
    const auto input = [](std::span<const Face> faces) {
        return with_guesses(known_of_all(faces),
                            affine(Variable(stacked(faces, &Face::image)), 2.0, -1.0).value());
    };
    batch.input = input(own);
    batch.other_input = input(others);
    batch.other_cameras.clear();
    for (const Face& face : others)
        batch.other_cameras.push_back(camera_from_pose(face.pose, face.intrinsics));
    batch.shared = std::move(shared);
}

bool FaceBatch::has_mask_of(std::int64_t row) const {
    return mask.defined() && !has_mask.empty() && has_mask[static_cast<std::size_t>(row)];
}

Tensor FaceBatch::known_of(std::int64_t row) const {
    if (!known.defined()) return {};
    return unless_all_known(slice(known, 0, row, row + 1).value());
}

bool FaceBatch::has_codes() const {
    if (!code_present.defined()) return false;
    const std::vector<double> present = code_present.to_vector();
    return std::ranges::any_of(present, [](double value) { return value > 0.0; });
}

Variable opacity_error(const Decoded& decoded, const FaceBatch& batch) {
    const Variable& transmittance = decoded.weights.transmittance;
    const std::int64_t rays = batch.ray_mask.shape(1);
    if (transmittance.shape(1) == rays * rays)
        return opacity_loss(transmittance, batch.ray_mask, known_at(batch.known, rays, rays));
    // A field without render blocks has a ray for each pixel.
    const int side = static_cast<int>(decoded.images.back().shape(1));
    return opacity_loss(transmittance, resize_box(batch.mask, side, side).value(),
                        known_at(batch.known, side, side));
}

namespace {

Codes encoded(const Model& model, const FaceBatch& batch) {
    const Codes codes = model.encoder()(Variable(batch.input));
    if (!batch.other_input.defined()) return codes;
    const Codes others = model.encoder()(Variable(batch.other_input));
    std::vector<Variable> expression, light;
    for (std::size_t i = 0; i < batch.shared.size(); ++i) {
        const auto row_of = [row = static_cast<std::int64_t>(i)](const Variable& group) {
            return slice(group, 0, row, row + 1);
        };
        const Shared shared = batch.shared[i];
        expression.push_back(row_of((shared == Shared::all ? others : codes).expression()));
        light.push_back(row_of((shared == Shared::person ? codes : others).light()));
    }
    return {{others.identity(), concat(expression, 0), others.texture(), concat(light, 0)}};
}

}  // namespace

Codes face_codes(const Model& model, const FaceBatch& batch) {
    return corrected(model, batch, uncorrected_codes(model, batch));
}

Codes uncorrected_codes(const Model& model, const FaceBatch& batch) {
    if (uses_encoder(model.config())) return encoded(model, batch);
    const std::vector<double> present = batch.code_present.defined()
                                            ? batch.code_present.to_vector()
                                            : std::vector<double>(batch.cameras.size());
    for (std::size_t i = 0; i < present.size(); ++i) {
        if (present[i] != 0.0) continue;
        fail<ValueError>(
            "face ", i < batch.ids.size() ? batch.ids[i] : std::to_string(i),
            " has no code of a morphable model, which this model starts from (codes.source = ",
            model.config().code_source,
            "); prepare it with stymo-prep --morphable, or train with an encoder");
    }
    Codes codes;
    std::ranges::copy(batch.codes, codes.groups.begin());
    return codes;
}

}  // namespace stymo
