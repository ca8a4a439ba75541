#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "core/config.h"
#include "train/data/batch.h"
#include "train/data/camera_check.h"
#include "train/data/face_image.h"

namespace stymo {

struct DataConfig {
    std::int64_t test = 1000;        ///< number of faces held out for the test
    std::int64_t validation = 1000;  ///< number of faces held out for validation
    std::string held_out =
        "first";          ///< which end of the ids in order is held out: "first" or "last"
    bool mirror = false;  ///< whether training mirrors half of the faces, drawn at random
    std::int64_t cache_megabytes = 2048;
};

/// Binds "data.split.test", "data.split.val", "data.split.held_out", "data.mirror",
/// "data.cache_megabytes".
void describe(ConfigSchema& schema, DataConfig& config);

/// With `held_out` "first" the ids in order are: test, validation, training; with "last": training,
/// validation, test. The ids are those of the photos that the folder was made of, where it says so
/// (FolderScan::photo_ids), so that a photo without a usable face moves no other one to another
/// split; else those of its images.
enum class Split { training, validation, test, all };

/// Counts of what a data set lacks, for one report.
struct DatasetSummary {
    std::int64_t faces = 0;  ///< of this split, without the broken ones known so far
    std::int64_t without_mask = 0;
    std::int64_t without_pose = 0;
    std::int64_t without_code = 0;
    std::vector<BrokenFile> broken;   ///< skipped, in order of id
    std::vector<BrokenFile> refused;  ///< skipped for their cameras, in order of id

    /// "700 faces; 700 without a pose (frontal is assumed); ..." and one more line for each face
    /// that is skipped.
    [[nodiscard]] std::string text() const;
};

/// One split of a folder of faces (`scan_folder` tells the format), each decoded to side x side:
/// the central square, resampled by antialiased bicubic, 8 bits a channel. A set that fits into the
/// cache is decoded by the constructor on all threads, a larger one on demand. The faces depend
/// neither on that nor on the number of threads.
class Dataset {
public:
    /// `frontal` is the pose of a face without one, for a model frontal_pose(camera). Faces whose
    /// camera `check` refuses are left out.
    /// Throws FileError for a folder without images, with a malformed side file, or whose images
    /// are all skipped, ConfigError if the split leaves no face.
    Dataset(const std::filesystem::path& folder, std::int64_t side, const DataConfig& config,
            Split split, const Pose& frontal = {}, const CameraCheck& check = {});
    ~Dataset();
    Dataset(Dataset&&) noexcept;
    Dataset& operator=(Dataset&&) noexcept;

    [[nodiscard]] std::int64_t size() const;
    [[nodiscard]] std::int64_t side() const;
    /// In order; numbers by value.
    [[nodiscard]] const std::vector<std::string>& ids() const;
    /// The files of a face. Throws ValueError for an index outside the set.
    [[nodiscard]] const FaceFiles& files(std::int64_t index) const;
    /// Thread-safe. A broken file that was not found at the start (a set too large
    /// for the cache) is noted in the summary, and the next readable face stands in for it. Throws
    /// ValueError for an index outside the set.
    [[nodiscard]] Face load(std::int64_t index) const;
    /// The same, but throws FileError with the name of a broken file instead of giving another
    /// face.
    [[nodiscard]] Face load_exactly(std::int64_t index) const;
    /// `load` for several, on all threads, in the order of `indices`.
    [[nodiscard]] std::vector<Face> load(std::span<const std::int64_t> indices) const;
    [[nodiscard]] DatasetSummary summary() const;
    /// Tells the system that a face will be loaded soon, if its files are read again at each use.
    void announce(std::int64_t index) const;
    /// Of all threads together, in which `load` waited for the disk instead of computing.
    [[nodiscard]] double waiting_seconds() const;

private:
    struct Implementation;
    std::unique_ptr<Implementation> implementation_;
};

}  // namespace stymo
