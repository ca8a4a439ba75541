#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "render/camera.h"
#include "render/morphable/head.h"

/// The mesh from which the built-in morphable head is made. Not part of the public interface.
namespace stymo::morphable {

/// Measures of the generated head in world units (decimetres). The defaults are the mean head. Some
/// basis rows of the model are differences of heads in which one measure is changed.
struct HeadParameters {
    double eye_width = 0.150;  ///< half of the opening
    double upper_lid = 0.068;
    double lower_lid = 0.046;
    double eye_tilt = 0.05;
    double nose_height = 0.25;
    double nose_bridge = 0.10;
    double nose_width = 0.082;
    double nostrils = 0.09;
    double brow_thickness = 0.036;
    double brow_arch = 0.045;
    double mouth_width = 0.25;  ///< half of the width
    double upper_lip = 0.056;
    double lower_lip = 0.074;
    double lip_bulge = 0.038;
    double mouth_curve = 0.012;
    double ear_size = 1.0;
    double ear_angle = 0.0;
    double hair_top = 0.13;
    double hair_side = 0.09;
    double hair_back = 0.14;
    double hair_fringe = 0.04;
    double hairline = 0.0;  ///< height by which it is raised
    double hair_length = 0.0;
    double hair_parting = 0.0;
    double hair_wave = 0.012;
    double lid_closure_left = 0.0;  ///< of the eye at the image's left: 0 open, 1 closed
    double lid_closure_right = 0.0;
    double jaw_open = 0.0;  ///< angle in radians
    double gaze_x = 0.0;    ///< angle in radians
    double gaze_y = 0.0;
};

struct HeadMesh {
    std::vector<Eigen::Vector3d> vertices;
    std::vector<Eigen::Vector3d> albedo;
    std::vector<HeadPart> parts;
    /// For each vertex, -1 below the line between the lips, +1 above, 0 on it, fading to 0 away
    /// from the mouth. Displacements use it to move the lips apart.
    std::vector<double> mouth_side;
    std::vector<Eigen::Vector2d> grid_uv;  ///< see MorphableHead::grid_uv
    std::vector<std::array<std::int32_t, 3>> triangles;

    void add(const Eigen::Vector3d& vertex, const Eigen::Vector3d& color, HeadPart part,
             double side = 0.0);
    /// Triangulates the last rows * columns vertices as a grid whose rows may be closed rings.
    void add_grid(std::int64_t rows, std::int64_t columns, bool closed, bool outward_is_left);
};

/// The number and order of vertices and the triangles are the same for all parameters.
[[nodiscard]] HeadMesh generate_head(const HeadParameters& parameters);

void add_skin(HeadMesh& mesh, const HeadParameters& parameters);
void add_eyes(HeadMesh& mesh, const HeadParameters& parameters);
void add_brows(HeadMesh& mesh, const HeadParameters& parameters);
void add_ears(HeadMesh& mesh, const HeadParameters& parameters);
void add_hair(HeadMesh& mesh, const HeadParameters& parameters);

inline const Eigen::Vector3d skin_color{0.76, 0.56, 0.46};
inline const Eigen::Vector3d hair_color{0.30, 0.215, 0.155};
inline const Eigen::Vector3d lip_color{0.67, 0.37, 0.34};
/// Half of the distance between the centres of the eyes.
inline constexpr double eye_spacing = 0.30;
inline constexpr double eye_height = 0.05;
inline constexpr double eye_radius = 0.175;
inline constexpr double mouth_height = -0.52;

}  // namespace stymo::morphable
