#include "train/data/dataset.h"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <map>
#include <mutex>
#include <optional>
#include <set>
#include <sstream>

#include "core/clock.h"
#include "core/error.h"
#include "core/io/file.h"
#include "core/io/image.h"
#include "core/io/mask_file.h"
#include "core/parallel.h"
#include "nn/known_pixels.h"
#include "nn/realtime/view.h"
#include "train/data/folder_scan.h"

namespace stymo {
namespace {

/// Image and mask at the training size, 8 bits a channel.
struct Pixels {
    std::vector<std::uint8_t> image;
    std::vector<std::uint8_t> mask;   ///< empty: the whole frame
    std::vector<std::uint8_t> known;  ///< empty: all pixels are known
    std::vector<float> code;          ///< or none
    bool scaled_mask = false;
};

/// The decoded pixels of a face, or the reason why there are none.
struct DecodedFace {
    std::optional<Pixels> pixels;
    BrokenFile broken;
    std::string doubt;  ///< about its colours
};

std::vector<std::uint8_t> bytes_at_side(const Tensor& image, std::int64_t side) {
    const Tensor resized =
        resize_image(central_square(image), static_cast<int>(side), static_cast<int>(side));
    const std::span<const float> values = resized.values<float>();
    std::vector<std::uint8_t> bytes(values.size());
    std::transform(values.begin(), values.end(), bytes.begin(), [](float value) {
        return static_cast<std::uint8_t>(std::lround(std::clamp(value, 0.0F, 1.0F) * 255.0F));
    });
    return bytes;
}

Tensor tensor_of(const std::vector<std::uint8_t>& bytes, std::int64_t side) {
    Tensor result({side, side, static_cast<std::int64_t>(bytes.size()) / (side * side)});
    std::transform(bytes.begin(), bytes.end(), result.mutable_values<float>().begin(),
                   [](std::uint8_t byte) { return static_cast<float>(byte) / 255.0F; });
    return result;
}

DecodedFace decode(const FaceFiles& files, const FaceRecords& records, std::int64_t side) {
    const FaceImage image = read_face_image(files);
    if (image.broken) return {std::nullopt, *image.broken, {}};
    Pixels pixels;
    pixels.image = bytes_at_side(image.image, side);
    pixels.scaled_mask = image.scaled_mask;
    if (image.mask.defined()) pixels.mask = bytes_at_side(image.mask, side);
    if (image.known.defined())
        pixels.known = bytes_at_side(known_at(central_square(image.known), side, side), side);
    const FaceEntry* entry = records.find(files.id);
    if (entry != nullptr && entry->has_code) pixels.code = records.read(files.id).code;
    return {std::move(pixels), {}, image.doubt};
}

bool has_mask(const FaceFiles& files) {
    return !files.mask.empty() || !files.parsing.empty() || !files.mask_parts.empty();
}

/// Rank of a face's photo among all photos from which the folder was prepared.
std::int64_t rank_of(const std::string& id, const std::vector<std::string>& photo_ids) {
    const auto rank_in_order = [&](const std::string& photo) {
        return std::ranges::lower_bound(photo_ids, photo, id_less) - photo_ids.begin();
    };
    const auto is_photo = [&](const std::string& photo) {
        const auto rank = static_cast<std::size_t>(rank_in_order(photo));
        return rank < photo_ids.size() && photo_ids[rank] == photo;
    };
    // "ID_2" is the second face of the photo "ID".
    const std::string photo = id.substr(0, id.rfind('_'));
    const std::int64_t rank = rank_in_order(!is_photo(id) && is_photo(photo) ? photo : id);
    return std::min(rank, std::ssize(photo_ids) - 1);
}

/// The faces of one split.
std::vector<FaceFiles> faces_of_split(const FolderScan& scan, const DataConfig& config,
                                      Split split) {
    if (split == Split::all) return scan.faces;
    std::vector<std::string> ids = scan.photo_ids;
    if (ids.empty())
        for (const FaceFiles& face : scan.faces) ids.push_back(face.id);
    const auto count = static_cast<std::int64_t>(ids.size());
    const std::int64_t test = std::min(config.test, count);
    const std::int64_t validation = std::min(config.validation, count - test);
    const bool first = config.held_out == "first";
    std::vector<FaceFiles> faces;
    for (const FaceFiles& face : scan.faces) {
        const std::int64_t rank = rank_of(face.id, ids);
        const std::int64_t from_the_end = first ? rank : count - 1 - rank;
        const Split own = from_the_end < test                ? Split::test
                          : from_the_end < test + validation ? Split::validation
                                                             : Split::training;
        if (own == split) faces.push_back(face);
    }
    if (faces.empty())
        fail<ConfigError>("data.split: test ", config.test, " and val ", config.validation, " of ",
                          count,
                          " faces leave none for this use; set data.split.test and data.split.val "
                          "to other numbers");
    return faces;
}

std::map<std::string, std::int64_t> photos_of_people(const std::vector<FaceFiles>& faces,
                                                     const FaceRecords& records) {
    std::map<std::string, std::int64_t> photos;
    for (const FaceFiles& face : faces) {
        const FaceEntry* const entry = records.find(face.id);
        if (entry != nullptr && !entry->origin.person.empty()) ++photos[entry->origin.person];
    }
    return photos;
}

/// The number of people with photos both among `own`, one split of `all`, and outside it.
std::int64_t people_divided(const std::vector<FaceFiles>& own, const std::vector<FaceFiles>& all,
                            const FaceRecords& records) {
    const std::map<std::string, std::int64_t> total = photos_of_people(all, records);
    return std::ranges::count_if(photos_of_people(own, records), [&](const auto& person) {
        return person.second < total.at(person.first);
    });
}

}  // namespace

void describe(ConfigSchema& schema, DataConfig& config) {
    schema.integer("data.split.test", config.test, 0, 100000000,
                   "faces held out for the test, by order of id (paper: 1000)");
    schema.integer("data.split.val", config.validation, 0, 100000000,
                   "faces held out for validation, by order of id (paper: 1000)");
    schema.choice("data.split.held_out", config.held_out, {"first", "last"},
                  "which ids are held out: first (test, validation, training in order; paper) or "
                  "last (training, validation, test)");
    schema.boolean("data.mirror", config.mirror,
                   "mirror half of the training faces at random; a mirrored face has no code loss");
    schema.number("data.other_photo", config.other_photo, 0.0, 1.0,
                  "share of the images of people with several photos whose identity and texture "
                  "are read from another photo of the person");
    schema.number("data.turned_photos", config.turned_photos, 0.0, 1.0,
                  "share of the images with a pose and a code of the built-in head whose face is "
                  "shown turned, by its linear head; the photo's code has to render it");
    schema.integer(
        "data.cache_megabytes", config.cache_megabytes, 0, 10000000,
        "memory for decoded faces at the training size; a larger set is decoded again at each use");
}

std::string DatasetSummary::text() const {
    std::ostringstream text;
    text << faces << (faces == 1 ? " face" : " faces");
    if (without_mask > 0)
        text << "; " << without_mask << " without a mask (the whole frame is taken)";
    if (without_pose > 0) text << "; " << without_pose << " without a pose (frontal is assumed)";
    if (without_code > 0) text << "; " << without_code << " without a code (no code loss)";
    if (with_unknown > 0) text << "; " << with_unknown << " with unknown pixels";
    if (divided_people > 0)
        text << "; " << divided_people << (divided_people == 1 ? " person has" : " people have")
             << " photos in another part of the split too";
    if (scaled_masks > 0) text << "; " << scaled_masks << " with a mask of " << scaled_mask_note;
    if (!refused.empty())
        text << "; " << refused.size() << " skipped, which the model cannot render";
    if (!broken.empty()) text << "; " << broken.size() << " broken and skipped";
    if (!doubted.empty())
        text << "; " << doubted.size() << " whose colours could not be converted to sRGB";
    if (!refused.empty() || !broken.empty() || !doubted.empty()) text << ':';
    for (const std::vector<BrokenFile>* named : {&refused, &broken, &doubted})
        for (const BrokenFile& item : *named) text << '\n' << item.file << ": " << item.reason;
    if (!left_out.empty()) text << '\n' << left_out_text(left_out);
    return text.str();
}

struct Dataset::Implementation {
    std::int64_t side = 0;
    std::vector<FaceFiles> faces;
    std::vector<std::string> ids;
    FaceRecords records;
    Intrinsics intrinsics;
    Pose frontal;
    std::vector<Pixels> cache;  ///< one for each face, or empty
    mutable std::mutex broken_mutex;
    mutable std::map<std::int64_t, BrokenFile> broken;  ///< by index in the split
    mutable std::map<std::string, std::string> doubts;  ///< by file
    mutable std::set<std::int64_t> scaled_masks;        ///< by index in the split
    std::vector<BrokenFile> refused;
    std::vector<BrokenFile> left_out;
    std::int64_t divided_people = 0;
    mutable std::atomic<double> waiting_seconds = 0.0;

    [[nodiscard]] Pose pose_of(const std::string& id) const;
    void refuse(const CameraCheck& check);
    void fill_cache();
    [[nodiscard]] std::optional<Face> try_load(std::int64_t index) const;
    [[nodiscard]] Face face(std::int64_t index, const Pixels& pixels) const;
};

Pose Dataset::Implementation::pose_of(const std::string& id) const {
    const FaceEntry* entry = records.find(id);
    return entry == nullptr ? frontal : entry->pose.value_or(frontal);
}

void Dataset::Implementation::refuse(const CameraCheck& check) {
    std::erase_if(faces, [&](const FaceFiles& files) {
        const std::optional<std::string> problem = check(pose_of(files.id), intrinsics);
        if (problem) refused.push_back({files.image.string(), *problem});
        return problem.has_value();
    });
}

void Dataset::Implementation::fill_cache() {
    std::vector<DecodedFace> decoded(faces.size());
    parallel_items(std::ssize(faces), [&](std::size_t i, int /*thread*/) {
        decoded[i] = decode(faces[i], records, side);
    });
    std::vector<FaceFiles> readable;
    for (std::size_t i = 0; i < decoded.size(); ++i) {
        if (!decoded[i].doubt.empty()) doubts[faces[i].image.string()] = decoded[i].doubt;
        if (decoded[i].pixels) {
            if (decoded[i].pixels->scaled_mask) scaled_masks.insert(static_cast<std::int64_t>(i));
            cache.push_back(std::move(*decoded[i].pixels));
            readable.push_back(std::move(faces[i]));
        } else {
            broken.emplace(static_cast<std::int64_t>(i), std::move(decoded[i].broken));
        }
    }
    faces = std::move(readable);
}

Face Dataset::Implementation::face(std::int64_t index, const Pixels& pixels) const {
    const FaceFiles& files = faces[static_cast<std::size_t>(index)];
    Face face;
    face.id = files.id;
    face.image = tensor_of(pixels.image, side);
    face.has_mask = !pixels.mask.empty();
    face.mask = face.has_mask ? tensor_of(pixels.mask, side) : Tensor::full({side, side, 1}, 1.0);
    if (!pixels.known.empty()) face.known = tensor_of(pixels.known, side);
    face.intrinsics = intrinsics;
    face.pose = pose_of(files.id);
    const FaceEntry* entry = records.find(files.id);
    face.has_pose = entry != nullptr && entry->pose.has_value();
    if (entry != nullptr) face.source = entry->origin.source;
    face.code = pixels.code;
    face.has_code = !face.code.empty();
    return face;
}

std::optional<Face> Dataset::Implementation::try_load(std::int64_t index) const {
    if (!cache.empty()) return face(index, cache[static_cast<std::size_t>(index)]);
    const double start = seconds_now(), computing = thread_seconds();
    DecodedFace decoded = decode(faces[static_cast<std::size_t>(index)], records, side);
    waiting_seconds += (seconds_now() - start) - (thread_seconds() - computing);
    {
        const std::lock_guard lock(broken_mutex);
        if (!decoded.pixels) {
            broken.emplace(index, std::move(decoded.broken));
            return std::nullopt;
        }
        if (!decoded.doubt.empty())
            doubts[faces[static_cast<std::size_t>(index)].image.string()] = decoded.doubt;
        if (decoded.pixels->scaled_mask) scaled_masks.insert(index);
    }
    return face(index, *decoded.pixels);
}

Dataset::Dataset(const std::filesystem::path& folder, std::int64_t side, const DataConfig& config,
                 Split split, const CameraConfig& camera, const CameraCheck& check)
    : implementation_(std::make_unique<Implementation>()) {
    if (side < 1) fail<ValueError>("faces cannot be decoded to a side of ", side);
    FolderScan scan = scan_folder(folder);
    Implementation& data = *implementation_;
    data.side = side;
    data.frontal = frontal_pose(with_intrinsics(camera, scan.intrinsics));
    data.faces = faces_of_split(scan, config, split);
    data.divided_people = people_divided(data.faces, scan.faces, scan.records);
    data.records = std::move(scan.records);
    data.intrinsics = scan.intrinsics;
    data.left_out = std::move(scan.left_out);
    if (check) data.refuse(check);
    const bool has_unknown = std::ranges::any_of(
        data.faces, [](const FaceFiles& files) { return !files.unknown.empty(); });
    const std::int64_t channels = has_unknown ? 5 : 4;
    if (static_cast<std::int64_t>(data.faces.size()) * side * side * channels <=
        config.cache_megabytes * 1000000)
        data.fill_cache();
    if (data.faces.empty()) {
        const BrokenFile& one =
            data.refused.empty() ? data.broken.begin()->second : data.refused.front();
        fail<FileError>(folder.string(), ": none of its ", data.broken.size() + data.refused.size(),
                        data.refused.empty() ? " images can be read" : " images can be used",
                        "; the first: ", one.file, ": ", one.reason);
    }
    for (const FaceFiles& files : data.faces) data.ids.push_back(files.id);
}

Dataset::~Dataset() = default;
Dataset::Dataset(Dataset&&) noexcept = default;
Dataset& Dataset::operator=(Dataset&&) noexcept = default;

std::int64_t Dataset::size() const {
    return static_cast<std::int64_t>(implementation_->faces.size());
}

std::int64_t Dataset::side() const {
    return implementation_->side;
}

const std::vector<std::string>& Dataset::ids() const {
    return implementation_->ids;
}

const FaceFiles& Dataset::files(std::int64_t index) const {
    if (index < 0 || index >= size())
        fail<ValueError>("face ", index, " of a data set of ", size());
    return implementation_->faces[static_cast<std::size_t>(index)];
}

const FaceEntry* Dataset::entry(std::int64_t index) const {
    return implementation_->records.find(files(index).id);
}

Face Dataset::load(std::int64_t index) const {
    if (index < 0 || index >= size())
        fail<ValueError>("face ", index, " of a data set of ", size());
    for (std::int64_t step = 0; step < size(); ++step)
        if (std::optional<Face> face = implementation_->try_load((index + step) % size()))
            return std::move(*face);
    const BrokenFile one = summary().broken.front();
    fail<FileError>("none of the ", size(),
                    " images of the data set can be read; the first: ", one.file, ": ", one.reason);
}

Face Dataset::load_exactly(std::int64_t index) const {
    if (index < 0 || index >= size())
        fail<ValueError>("face ", index, " of a data set of ", size());
    if (std::optional<Face> face = implementation_->try_load(index)) return std::move(*face);
    const std::lock_guard lock(implementation_->broken_mutex);
    const BrokenFile& broken = implementation_->broken.at(index);
    fail<FileError>(broken.file, ": ", broken.reason);
}

std::vector<Face> Dataset::load(std::span<const std::int64_t> indices) const {
    std::vector<Face> faces(indices.size());
    parallel_items(std::ssize(faces),
                   [&](std::size_t i, int /*thread*/) { faces[i] = load(indices[i]); });
    return faces;
}

void Dataset::announce(std::int64_t index) const {
    if (!implementation_->cache.empty()) return;
    const FaceFiles& face = files(index);
    for (const std::filesystem::path* file :
         {&face.image, &face.mask, &face.parsing, &face.unknown})
        if (!file->empty()) prefetch(*file);
    for (const std::filesystem::path& part : face.mask_parts) prefetch(part);
}

double Dataset::waiting_seconds() const {
    return implementation_->waiting_seconds;
}

DatasetSummary Dataset::summary() const {
    const Implementation& data = *implementation_;
    const std::lock_guard lock(data.broken_mutex);
    DatasetSummary summary;
    for (std::size_t i = 0; i < data.faces.size(); ++i) {
        // A cached set no longer contains broken faces; the indices in `broken` are from before
        // their removal.
        if (data.cache.empty() && data.broken.contains(static_cast<std::int64_t>(i))) continue;
        ++summary.faces;
        if (!has_mask(data.faces[i])) ++summary.without_mask;
        if (!data.faces[i].unknown.empty()) ++summary.with_unknown;
        const FaceEntry* entry = data.records.find(data.faces[i].id);
        if (entry == nullptr || !entry->pose) ++summary.without_pose;
        if (entry == nullptr || !entry->has_code) ++summary.without_code;
    }
    for (const auto& [index, item] : data.broken) summary.broken.push_back(item);
    summary.scaled_masks = std::ssize(data.scaled_masks);
    summary.refused = data.refused;
    summary.left_out = data.left_out;
    summary.divided_people = data.divided_people;
    for (const auto& [file, doubt] : data.doubts) summary.doubted.push_back({file, doubt});
    return summary;
}

}  // namespace stymo
