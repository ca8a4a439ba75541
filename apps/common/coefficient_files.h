#pragma once

#include <Eigen/Core>
#include <filesystem>
#include <string>
#include <vector>

#include "fit/morphable/arkit_coefficients.h"

namespace stymo {

/// A face at one moment, as ARKit describes it.
struct ArkitMoment {
    std::vector<double> coefficients;  ///< in the order of `arkit_names`
    /// Yaw, pitch and roll (Pose) of the camera that sees the head as it is turned.
    Eigen::Vector3d view = Eigen::Vector3d::Zero();
};

/// The conversion for the head of --morphable (morphable_head_from). Throws Error for a head that
/// does not name its expressions.
[[nodiscard]] ArkitConversion arkit_conversion(const std::filesystem::path& morphable);

/// The rows of Live Link Face's CSV (columns Timecode, BlendShapeCount, EyeBlinkLeft, ..., in any
/// order), or the one of a .json file {"coefficients": {"eyeBlinkLeft": 0.5, ...}}, where shapes
/// may be left out. HeadYaw, HeadPitch and HeadRoll may be missing; they are radians by which the
/// head turns to its own left, up, and leans to its own right. Rotations of the eyes are not read.
/// A row with 0 as BlendShapeCount and no more cells, at which no face was seen, repeats the one
/// before. Throws FileError, which names the line or key, for another form, for a missing column,
/// and for numbers out of range.
[[nodiscard]] std::vector<ArkitMoment> read_coefficients(const std::filesystem::path& path);

/// Live Link Face's CSV with this row. The eyes are at rest.
[[nodiscard]] std::string live_link_csv(const ArkitMoment& moment);

}  // namespace stymo
