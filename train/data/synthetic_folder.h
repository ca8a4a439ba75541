#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <string>
#include <vector>

#include "core/io/json_writer.h"
#include "core/rng.h"
#include "core/tensor.h"
#include "render/camera.h"

/// Code that the writers of synthetic faces share. Not part of the public interface.
namespace stymo::synthetic {

/// Normal with mean 0, drawn again until it lies within `limit`.
[[nodiscard]] double truncated_normal(Rng& rng, double deviation, double limit);
/// 27 coefficients of a light from the front and above, with a random part from the side and a
/// random tint.
[[nodiscard]] std::vector<float> sample_light(Rng rng);
/// "00012"
[[nodiscard]] std::string padded_number(std::int64_t number);

/// A pose that was drawn for the usual focal length (Intrinsics), moved so that a camera of another
/// one sees the head's origin at the same size.
[[nodiscard]] Pose at_focal(const Pose& pose, double focal);

struct WrittenFace {
    Tensor image;
    Tensor mask;
    JsonValue record;  ///< the line of faces.jsonl
};

/// Writes a folder in the format of `scan_folder` with the faces that `render` makes of the indices
/// of `ids`, on several threads. The files are moved to `folder` after all are written, and replace
/// files of the same name. `progress` is called with the number of finished faces. Throws FileError
/// if the folder cannot be written or holds other images, Error when interrupted() becomes true.
void write_faces(const std::vector<std::string>& ids, const Intrinsics& intrinsics,
                 const std::filesystem::path& folder,
                 const std::function<WrittenFace(std::int64_t)>& render,
                 const std::function<void(std::int64_t)>& progress);

}  // namespace stymo::synthetic
