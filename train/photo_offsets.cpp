#include "train/photo_offsets.h"

#include <algorithm>
#include <array>
#include <cstdint>
#include <map>
#include <sstream>
#include <string_view>

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
    // Sources that the file lacks keep their values.
    TensorFile of_sources;
    parameters_.save(of_sources, source_prefix);
    for (auto& [name, value] : of_sources.tensors)
        if (const auto found = file.tensors.find(name); found != file.tensors.end())
            value = found->second;
    parameters_.load(of_sources, source, source_prefix);
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

namespace {

constexpr const char* photos_key = "photos";

std::vector<std::string> lines_of(const std::string& text) {
    std::vector<std::string> lines;
    std::istringstream stream(text);
    for (std::string line; std::getline(stream, line);) lines.push_back(line);
    return lines;
}

/// An id on one line and in ASCII.
std::string escaped(const std::string& id) {
    constexpr std::string_view digits = "0123456789ABCDEF";
    std::string text;
    for (const char letter : id) {
        const auto byte = static_cast<unsigned char>(letter);
        if (byte < ' ' || byte > '~' || letter == '%') {
            text += '%';
            text += digits[byte / digits.size()];
            text += digits[byte % digits.size()];
        } else {
            text += letter;
        }
    }
    return text;
}

using Rows = std::map<std::string, std::int64_t>;

Rows rows_of(const std::vector<std::string>& ids) {
    Rows rows;
    for (const std::string& id : ids) rows.emplace(id, std::ssize(rows));
    return rows;
}

/// The ids that `others` does not have.
std::vector<std::string> missing_in(const Rows& others, const std::vector<std::string>& ids) {
    std::vector<std::string> missing;
    std::ranges::copy_if(ids, std::back_inserter(missing),
                         [&](const std::string& id) { return !others.contains(id); });
    return missing;
}

/// "3 photos (a, b, ...)".
std::string counted(const std::vector<std::string>& ids) {
    constexpr std::size_t named = 3;
    std::ostringstream text;
    text << ids.size() << (ids.size() == 1 ? " photo" : " photos");
    for (std::size_t i = 0; i < std::min(named, ids.size()); ++i)
        text << (i == 0 ? " (" : ", ") << ids[i];
    if (ids.size() > named) text << ", ...";
    if (!ids.empty()) text << ')';
    return text.str();
}

/// The rows of `tensor` in their new places; codes of mirror images are a second block of rows.
Tensor moved_rows(const Tensor& tensor, const Rows& before, const Rows& after) {
    const auto old_count = std::ssize(before), count = std::ssize(after);
    const std::int64_t blocks = tensor.shape(0) / old_count, columns = tensor.shape(1);
    Tensor result = Tensor::zeros({blocks * count, columns}, tensor.dtype());
    dispatch(tensor.dtype(), [&]<class T>(T) {
        const auto from = tensor.values<T>().begin();
        const auto to = result.mutable_values<T>().begin();
        for (const auto& [id, row] : after) {
            const auto old = before.find(id);
            for (std::int64_t block = 0; old != before.end() && block < blocks; ++block)
                std::copy_n(from + (block * old_count + old->second) * columns, columns,
                            to + (block * count + row) * columns);
        }
    });
    return result;
}

bool is_of_photos(const std::string& name) {
    return name.find(PhotoOffsets::code_prefix) != std::string::npos ||
           name.find(std::string(PhotoOffsets::pose_prefix) + "offset") != std::string::npos;
}

}  // namespace

void store_photo_ids(TensorFile& state, const std::vector<std::string>& ids) {
    std::string text;
    for (const std::string& id : ids) text += escaped(id) + '\n';
    constexpr std::size_t most_bytes = 30'000'000;
    if (text.size() <= most_bytes) state.metadata[photos_key] = text;
}

std::string follow_photos(TensorFile& state, const std::vector<std::string>& photo_ids) {
    const bool learnt = std::ranges::any_of(
        state.tensors, [](const auto& entry) { return is_of_photos(entry.first); });
    const auto stored = state.metadata.find(photos_key);
    if (stored == state.metadata.end())
        return learnt ? "the checkpoint does not name its photos; their learnt offsets are taken "
                        "in the order of the ids"
                      : "";
    const std::vector<std::string> earlier = lines_of(stored->second);
    std::vector<std::string> ids;
    for (const std::string& id : photo_ids) ids.push_back(escaped(id));
    const Rows before = rows_of(earlier), after = rows_of(ids);
    const std::vector<std::string> gone = missing_in(after, earlier),
                                   added = missing_in(before, ids);
    if (earlier == ids) return {};
    if (learnt && before.empty())
        fail<FileError>("the checkpoint has learnt offsets of photos, and names none");
    for (auto& [name, tensor] : state.tensors)
        if (is_of_photos(name) && tensor.rank() == 2 && tensor.shape(0) % std::ssize(before) == 0)
            tensor = moved_rows(tensor, before, after);
    std::ostringstream line;
    line << "the folder has changed since the checkpoint: " << counted(gone) << " gone, "
         << counted(added) << " new";
    if (learnt)
        line << "; learnt offsets: " << gone.size() << " dropped, " << added.size() << " from zero";
    return line.str();
}

}  // namespace stymo
