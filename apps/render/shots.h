#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "apps/common/tool_options.h"
#include "nn/models/code_file.h"
#include "nn/realtime/face_renderer.h"
#include "nn/realtime/head_mesh.h"
#include "nn/realtime/view.h"

namespace stymo {

/// The options of stymo-render. `orbit`, `to`, the grids and `sample` exclude each other. Without
/// any of them one view is rendered.
struct RenderOptions {
    ModelOptions model;
    std::filesystem::path codes;
    std::filesystem::path out;
    std::optional<double> yaw;
    std::optional<double> pitch;
    std::optional<double> roll;
    std::optional<double> distance;  ///< of the camera, as a multiple of the model's

    int orbit = 0;
    double orbit_yaw = 30.0;
    double orbit_pitch = 8.0;

    std::filesystem::path to;
    int frames = 24;
    std::string take;
    double frames_per_second = 24.0;

    std::string grid_yaw;
    std::string grid_pitch;

    int sample = 0;
    double truncation = 0.7;
    std::filesystem::path data;

    std::filesystem::path mesh;
    HeadMeshOptions meshing;

    std::string mode = "skip";
    RendererOptions renderer;  ///< its mode is set from `mode`, its tolerance from `tolerance`
    double psnr = 45.0;        ///< wanted of the worst view against exact ones, in decibels
    std::optional<double> tolerance;  ///< used as it is, instead of one that `psnr` chooses
    bool cutout = false;              ///< the head's opacity as alpha
    bool raw = false;                 ///< no soft edge
    std::string around = "head";      ///< what stays in the middle as the head turns: head or face
    bool keep_floaters = false;

    /// Whether the views are not those of the photo that a face was fitted to.
    [[nodiscard]] bool leaves_photo() const {
        return yaw || pitch || roll || orbit > 0 || grid() || sample > 0;
    }
    [[nodiscard]] double chosen_distance() const {
        return distance.value_or(leaves_photo() ? whole_head_distance : 1.0);
    }
    /// --out is the depth; no image is wanted.
    [[nodiscard]] bool depth_alone() const { return sample == 0 && out.extension() == ".exr"; }
    [[nodiscard]] bool grid() const { return !grid_yaw.empty() || !grid_pitch.empty(); }
};

/// One face seen by one camera.
struct Shot {
    Codes codes;  ///< one row
    Pose pose;
};

/// Images that belong together: the frames of an animation, or tiles of one image.
struct ShotList {
    std::vector<Shot> shots;
    int columns = 1;         ///< number of tiles in a row of the image
    bool returning = false;  ///< an animation shows the shots forwards and then backwards
};

/// The pose with the angles of the options, or `face` without angles, from their distance.
[[nodiscard]] Pose chosen_pose(const RenderOptions& options, const Model& model, const Pose& face);

/// The shots that the options select: an orbit, a grid, an interpolation or one view of a face.
/// Throws FileError for an unreadable --to.
[[nodiscard]] ShotList shots_of_face(const RenderOptions& options, const Model& model,
                                     const CodeFile& face);

/// Throws UsageError for malformed grids and groups.
void require_understood(const RenderOptions& options);

/// Linear interpolation in Z from `from` (part = 0) to `to` (part = 1) of the groups in the
/// comma-separated list `take` (empty: all groups). Other groups keep the values of `from`.
[[nodiscard]] Codes interpolated(const Codes& from, const Codes& to, double part,
                                 const std::string& take);

}  // namespace stymo
