#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "core/config.h"
#include "nn/models/face_batch.h"
#include "nn/models/model.h"
#include "train/data/camera_check.h"
#include "train/data/face_image.h"

namespace stymo {

struct DataConfig {
    std::int64_t test = 1000;        ///< number of faces held out for the test
    std::int64_t validation = 1000;  ///< number of faces held out for validation
    /// Which end of the sorted ids is held out: "first" or "last".
    std::string held_out = "first";
    bool mirror = false;  ///< whether training mirrors a random half of the faces
    /// Share of the images of people with several photos whose identity and texture the encoder
    /// reads from another photo of the person.
    double other_photo = 0.0;
    /// Share of the images with a pose and a code of the built-in head that are seen from another
    /// side (turned_face.h), with the code of the photo itself.
    double turned_photos = 0.0;
    std::int64_t cache_megabytes = 2048;
};

/// Binds "data.split.test", "data.split.val", "data.split.held_out", "data.mirror",
/// "data.other_photo", "data.turned_photos", "data.cache_megabytes".
void describe(ConfigSchema& schema, DataConfig& config);

/// With `held_out` "first" the sorted ids are divided into test, validation, training; with "last"
/// into training, validation, test. The ids are those of all photos from which the folder was
/// prepared, if they are known (FolderScan::photo_ids), else those of its images. With the former,
/// a photo without a usable face moves no other photo to another split.
enum class Split { training, validation, test, all };

/// Counts of faces with missing data, for a report.
struct DatasetSummary {
    std::int64_t faces = 0;  ///< of this split, without the faces that are known to be broken
    std::int64_t without_mask = 0;
    std::int64_t without_pose = 0;
    std::int64_t without_code = 0;
    std::int64_t with_unknown = 0;     ///< with unknown pixels
    std::int64_t scaled_masks = 0;     ///< faces with masks of 0 and 1, of those decoded so far
    std::int64_t divided_people = 0;   ///< people with photos in this split and in another one
    std::vector<BrokenFile> broken;    ///< skipped, in order of id
    std::vector<BrokenFile> refused;   ///< skipped because of their cameras, in order of id
    std::vector<BrokenFile> left_out;  ///< of the folder: what is no image
    std::vector<BrokenFile> doubted;   ///< used, but with colours that could not be converted

    /// "700 faces; 700 without a pose (frontal is assumed); ..." and one line for each face that is
    /// skipped.
    [[nodiscard]] std::string text() const;
};

/// One split of a folder of faces (see `scan_folder` for its format). Each image is decoded to side
/// x side pixels with 8 bits a channel: the central square, resampled with an antialiased bicubic
/// filter. A set that fits into the cache is decoded by the constructor on all threads, a larger
/// one on demand. The faces depend neither on this nor on the number of threads.
class Dataset {
public:
    /// Faces without a pose have the frontal one of `camera`, the model's, for the focal length of
    /// the folder (with_intrinsics). Faces whose camera `check` rejects are left out. Throws
    /// FileError for a folder without images, with a malformed side file, or whose images are all
    /// skipped; ConfigError if the split has no face.
    Dataset(const std::filesystem::path& folder, std::int64_t side, const DataConfig& config,
            Split split, const CameraConfig& camera = {}, const CameraCheck& check = {});
    ~Dataset();
    Dataset(Dataset&&) noexcept;
    Dataset& operator=(Dataset&&) noexcept;

    [[nodiscard]] std::int64_t size() const;
    [[nodiscard]] std::int64_t side() const;
    /// The ids in the order of `id_less`.
    [[nodiscard]] const std::vector<std::string>& ids() const;
    /// The line of faces.jsonl about a face; null if it has none. Throws ValueError for an index
    /// outside the set.
    [[nodiscard]] const FaceEntry* entry(std::int64_t index) const;
    /// The files of a face. Throws ValueError for an index outside the set.
    [[nodiscard]] const FaceFiles& files(std::int64_t index) const;
    /// Loads a face. Thread-safe. If a file turns out to be broken (in a set that is too large for
    /// the cache), it is recorded in the summary, and the next readable face is returned instead.
    /// Throws ValueError for an index outside the set.
    [[nodiscard]] Face load(std::int64_t index) const;
    /// The same, but throws FileError, which names the broken file, instead of returning another
    /// face.
    [[nodiscard]] Face load_exactly(std::int64_t index) const;
    /// Loads several faces on all threads, in the order of `indices`.
    [[nodiscard]] std::vector<Face> load(std::span<const std::int64_t> indices) const;
    [[nodiscard]] DatasetSummary summary() const;
    /// Tells the operating system that a face will be loaded soon. Does nothing if the face is in
    /// the cache.
    void announce(std::int64_t index) const;
    /// Seconds in which `load` waited for the disk, summed over all threads.
    [[nodiscard]] double waiting_seconds() const;

private:
    struct Implementation;
    std::unique_ptr<Implementation> implementation_;
};

}  // namespace stymo
