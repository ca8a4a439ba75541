#pragma once

#include <map>
#include <set>
#include <string>
#include <vector>

#include "core/io/tensor_file.h"
#include "nn/models/face_batch.h"

namespace stymo {

/// What training learns for its photos besides the weights.
struct PhotoOffsetsConfig {
    bool codes = false;           ///< an offset of its code
    bool mirrored_codes = false;  ///< and another one of its mirror image's code
    bool poses = false;           ///< an offset of its pose
    /// Names for each of which an offset of the light code is learnt, so that the look of a source
    /// does not become a part of its people. Without it a face has the look of the photos that
    /// name no source.
    std::set<std::string> sources{};
};

/// Offsets of codes and poses of the training photos, which begin as zeros and are trained together
/// with the weights. HeadNeRF learns such offsets of morphable codes.
class PhotoOffsets {
public:
    static constexpr const char* code_prefix = "codes.offset.";
    static constexpr const char* pose_prefix = "poses.";
    static constexpr const char* source_prefix = "sources.";

    /// Creates codes.offset.{id,expr,tex,light} and poses.offset, as far as they are asked for,
    /// with one row for each of `ids`; codes of mirror images follow in as many rows. sources.NAME
    /// has the offset of a source's light code.
    PhotoOffsets(const std::vector<std::string>& ids, const PhotoOffsetsConfig& config);

    [[nodiscard]] bool has_codes() const { return config_.codes; }
    [[nodiscard]] bool has_poses() const { return config_.poses; }
    [[nodiscard]] ParameterStore& parameters() { return parameters_; }
    [[nodiscard]] std::int64_t element_count() const { return parameters_.element_count(); }

    /// Restores what `parameters().save` wrote. Offsets of a kind or of a source that the file does
    /// not have stay zeros. Throws FileError, which names `source`, for offsets of another number
    /// of photos.
    void load(const TensorFile& file, const std::string& source);

    /// Offsets of the codes of the batch's photos, one row for each. Throws ValueError for a photo
    /// without offset, or if none are learnt.
    [[nodiscard]] Codes codes(const FaceBatch& batch) const;
    /// (B, 27): the offset of the light code that each photo's source has; undefined if none are
    /// learnt.
    [[nodiscard]] Variable source_lights(const FaceBatch& batch) const;
    /// Orbit parameters (render/tracked_rays.h) of the poses of the batch's photos, (B, 6), offset
    /// included. The mean offset of all photos is subtracted, because other photos, which have no
    /// offset, must go on fitting the same head. A mirrored photo has the mirrored offset. Throws
    /// as `codes` does.
    [[nodiscard]] Variable orbits(const FaceBatch& batch) const;

private:
    [[nodiscard]] std::vector<std::int64_t> rows_of(const FaceBatch& batch, bool mirrored) const;

    PhotoOffsetsConfig config_;
    std::map<std::string, std::int64_t> rows_;
    ParameterStore parameters_;
    Parameter poses_;
};

/// The codes of the batch's faces (nn/models/face_batch.h), plus their learnt offsets and those of
/// their sources, if any.
/// `offsets` may be null.
[[nodiscard]] Codes face_codes(const Model& model, const FaceBatch& batch,
                               const PhotoOffsets* offsets);
/// The cameras of the batch's faces, moved by their learnt offsets, if any. `offsets` may be null.
[[nodiscard]] std::vector<Camera> face_cameras(const FaceBatch& batch, const PhotoOffsets* offsets);

/// Notes in a checkpoint which photos the run has, unless there are millions: their names would not
/// fit into the header of a file.
void store_photo_ids(TensorFile& state, const std::vector<std::string>& ids);

/// Compares the photos of a checkpoint with those that a run has now. Rows of learnt offsets
/// (PhotoOffsets) and of their optimiser's moments follow their photos: those of photos that are
/// gone are dropped, new photos begin at zero. Returns one line that says what has changed; empty
/// if nothing has, or if a checkpoint of an older version names no photos and has no offsets.
[[nodiscard]] std::string follow_photos(TensorFile& state,
                                        const std::vector<std::string>& photo_ids);

}  // namespace stymo
