#include "train/photo_offsets.h"

#include <algorithm>
#include <array>

#include "core/error.h"
#include "core/ops/ops.h"
#include "render/tracked_rays.h"

namespace stymo {

namespace {

constexpr std::int64_t orbit_size = 6;
constexpr std::size_t light_group = 3;
/// Radians and decimetres of an offset of 1, so that the learning rate of weights suits it.
constexpr double pose_unit = 0.05;
/// What mirroring does to yaw, pitch, roll and to the centre's part to the right, up and towards
/// the camera.
constexpr std::array<double, orbit_size> mirrored_sign{-1.0, 1.0, -1.0, -1.0, 1.0, 1.0};

bool is_mirrored(const FaceBatch& batch, std::size_t face) {
    return face < batch.mirrored.size() && batch.mirrored[face];
}

/// (B, 6): 1, or the signs of a mirror image.
Tensor orbit_signs(const FaceBatch& batch) {
    std::vector<double> signs;
    for (std::size_t face = 0; face < batch.ids.size(); ++face)
        for (const double sign : mirrored_sign)
            signs.push_back(is_mirrored(batch, face) ? sign : 1.0);
    return Tensor::from({static_cast<std::int64_t>(batch.ids.size()), orbit_size},
                        std::span<const double>(signs))
        .to(DType::float32);
}

}  // namespace

PhotoOffsets::PhotoOffsets(const std::vector<std::string>& ids, const PhotoOffsetsConfig& config)
    : config_(config) {
    for (const std::string& id : ids) rows_.emplace(id, static_cast<std::int64_t>(rows_.size()));
    const auto count = static_cast<std::int64_t>(rows_.size());
    for (std::size_t group = 0; config.codes && group < code_names.size(); ++group)
        parameters_.create(
            code_prefix + std::string(code_names[group]),
            Tensor::zeros({config.mirrored_codes ? 2 * count : count, code_sizes[group]}));
    if (config.poses)
        poses_ = parameters_.create(pose_prefix + std::string("offset"),
                                    Tensor::zeros({count, orbit_size}));
    for (const std::string& source : config.sources)
        parameters_.create(source_prefix + source, Tensor::zeros({code_sizes[light_group]}));
}

void PhotoOffsets::load(const TensorFile& file, const std::string& source) {
    for (const char* prefix : {code_prefix, pose_prefix})
        if (has_prefix(file, prefix)) parameters_.load(file, source, prefix);
    for (const std::string& name : config_.sources)
        if (file.tensors.contains(source_prefix + name))
            parameters_.load(file, source, source_prefix + name);
}

std::vector<std::int64_t> PhotoOffsets::rows_of(const FaceBatch& batch, bool mirrored) const {
    RowIndices rows;
    for (std::size_t face = 0; face < batch.ids.size(); ++face) {
        const auto found = rows_.find(batch.ids[face]);
        if (found == rows_.end())
            fail<ValueError>("face ", batch.ids[face], " has no learnt offset of its code or pose");
        const bool second = mirrored && is_mirrored(batch, face);
        rows.push_back(found->second + (second ? std::ssize(rows_) : 0));
    }
    return rows;
}

Codes PhotoOffsets::codes(const FaceBatch& batch) const {
    if (!config_.codes) fail<ValueError>("no offsets of codes are learnt");
    const RowIndices rows = rows_of(batch, config_.mirrored_codes);
    Codes codes;
    for (std::size_t group = 0; group < code_names.size(); ++group)
        codes.groups[group] = gather_rows(parameters_.all()[group].variable(), rows);
    return codes;
}

Variable PhotoOffsets::source_lights(const FaceBatch& batch) const {
    const auto count = static_cast<std::int64_t>(batch.ids.size());
    Variable sum;
    for (const Parameter& parameter : parameters_.all()) {
        if (!parameter.name().starts_with(source_prefix)) continue;
        const std::string source = parameter.name().substr(std::string_view(source_prefix).size());
        Tensor is_of_source = Tensor::zeros({count, 1});
        for (std::size_t face = 0; face < batch.sources.size(); ++face)
            if (batch.sources[face] == source) is_of_source.mutable_values<float>()[face] = 1.0F;
        const Variable lights =
            Variable(is_of_source) * reshape(parameter.variable(), {1, code_sizes[light_group]});
        sum = sum.defined() ? sum + lights : lights;
    }
    return sum;
}

Variable PhotoOffsets::orbits(const FaceBatch& batch) const {
    if (!config_.poses) fail<ValueError>("no offsets of poses are learnt");
    const Variable& all = poses_.variable();
    // The mean counts as a constant. Otherwise every photo would have a gradient in every step, and
    // Adam would move all photos that no batch has shown yet.
    const Variable own = gather_rows(all, rows_of(batch, false)) - mean(all, {0}).detach();
    return Variable(orbit_parameters(batch.cameras, DType::float32)) +
           own * Variable(orbit_signs(batch)) * pose_unit;
}

Codes face_codes(const Model& model, const FaceBatch& batch, const PhotoOffsets* offsets) {
    Codes codes = face_codes(model, batch);
    if (offsets == nullptr) return codes;
    if (offsets->has_codes()) codes = add(codes, offsets->codes(batch));
    if (const Variable lights = offsets->source_lights(batch); lights.defined())
        codes.groups[light_group] = codes.light() + lights;
    return codes;
}

std::vector<Camera> face_cameras(const FaceBatch& batch, const PhotoOffsets* offsets) {
    if (offsets == nullptr || !offsets->has_poses()) return batch.cameras;
    return cameras_at(offsets->orbits(batch).value(), batch.cameras);
}

}  // namespace stymo
