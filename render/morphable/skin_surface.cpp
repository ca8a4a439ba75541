#include "render/morphable/skin_surface.h"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace stymo::morphable {

namespace {

constexpr std::int64_t columns = 112;
constexpr double axis_depth = -0.08;

struct Knot {
    double s;
    Section section;
};

constexpr std::array<Knot, 17> profile{{
    {0.00, {1.020, 0.000, -0.08, -0.08}},
    {0.03, {1.010, 0.170, 0.12, -0.28}},
    {0.08, {0.975, 0.325, 0.30, -0.48}},
    {0.15, {0.900, 0.480, 0.49, -0.68}},
    {0.24, {0.770, 0.605, 0.645, -0.85}},
    {0.34, {0.580, 0.690, 0.760, -0.96}},
    {0.44, {0.360, 0.730, 0.815, -1.00}},
    {0.50, {0.200, 0.735, 0.825, -1.00}},
    {0.55, {0.050, 0.725, 0.805, -0.97}},
    {0.62, {-0.150, 0.700, 0.790, -0.86}},
    {0.70, {-0.340, 0.660, 0.780, -0.70}},
    {0.77, {-0.520, 0.595, 0.765, -0.54}},
    {0.83, {-0.680, 0.505, 0.735, -0.44}},
    {0.88, {-0.800, 0.405, 0.695, -0.38}},
    {0.92, {-0.885, 0.310, 0.615, -0.34}},
    {0.96, {-0.920, 0.200, 0.430, -0.27}},
    {1.00, {-0.900, 0.000, -0.08, -0.08}},
}};

[[nodiscard]] double hermite(double a, double b, double slope_a, double slope_b, double t) {
    const double u = 1.0 - t;
    return a * (1.0 + 2.0 * t) * u * u + b * t * t * (3.0 - 2.0 * t) + slope_a * t * u * u -
           slope_b * t * t * u;
}

/// Index of the knot of the profile at or before s, the last one excepted.
[[nodiscard]] std::size_t knot_before(double s) {
    std::size_t index = 0;
    while (index + 2 < profile.size() && s > profile[index + 1].s) ++index;
    return index;
}

[[nodiscard]] double interpolate(std::size_t index, double s, double Section::*member) {
    const auto value = [&](std::size_t k) { return profile[k].section.*member; };
    const auto slope = [&](std::size_t k) {
        const std::size_t low = k == 0 ? 0 : k - 1;
        const std::size_t high = std::min(k + 1, profile.size() - 1);
        return (value(high) - value(low)) / (profile[high].s - profile[low].s);
    };
    const double step = profile[index + 1].s - profile[index].s;
    const double t = (s - profile[index].s) / step;
    return hermite(value(index), value(index + 1), slope(index) * step, slope(index + 1) * step, t);
}

/// A row of the skin's grid. The rows around a slit (eyes, mouth) lie close together at rest and
/// are spread by the opening, so that the edges of lids and lips run along rows and stay smooth at
/// any resolution.
struct Row {
    double s;
    double eye_side;      ///< +1 above the eyes' line, -1 below, 0 for the row that is tucked in
    double mouth_side;    ///< the same for the mouth
    double lip_fraction;  ///< how far out on the lip: 0 at its edge, 1 from its border on
};

[[nodiscard]] std::vector<Row> skin_rows() {
    std::vector<Row> rows;
    const auto run = [&](double from, double to, int count) {
        for (int k = 0; k < count; ++k) {
            const double s = from + (to - from) * k / count;
            rows.push_back({s, s < 0.55 ? 1.0 : -1.0, s < 0.77 ? 1.0 : -1.0, 1.0});
        }
    };
    run(0.0, 0.44, 14);
    run(0.44, 0.535, 9);
    run(0.535, 0.5495, 4);
    rows.push_back({0.5495, 1.0, 1.0, 1.0});
    rows.push_back({0.55, 0.0, 1.0, 1.0});
    rows.push_back({0.5505, -1.0, 1.0, 1.0});
    run(0.553, 0.57, 4);
    run(0.57, 0.70, 17);
    run(0.70, 0.756, 8);
    for (const double fraction : {1.0, 0.75, 0.5, 0.25, 0.0})
        rows.push_back({0.7695 - 0.011 * fraction, -1.0, 1.0, fraction});
    rows.push_back({0.77, -1.0, 0.0, 0.0});
    for (const double fraction : {0.0, 0.25, 0.5, 0.75, 1.0})
        rows.push_back({0.7705 + 0.011 * fraction, -1.0, -1.0, fraction});
    run(0.785, 0.92, 15);
    run(0.92, 1.0001, 8);
    rows.push_back({1.0, -1.0, -1.0, 1.0});
    return rows;
}

/// Half the outline of an almond: 1 in the middle, 0 at |t| >= 1.
[[nodiscard]] double almond(double t, double power) {
    return std::pow(std::max(0.0, 1.0 - t * t), power);
}

/// Height of nose, brows, cheeks, chin over the loft.
[[nodiscard]] double relief(double x, double y, const HeadParameters& p) {
    const double side = std::abs(x);
    constexpr std::array<double, 9> nose_y{0.22,   0.10,   0.0,    -0.12, -0.21,
                                           -0.265, -0.315, -0.345, -0.40};
    const std::array<double, 9> nose_z{0.0,
                                       0.25 * p.nose_bridge,
                                       0.6 * p.nose_bridge,
                                       0.4 * p.nose_bridge + 0.40 * p.nose_height,
                                       0.92 * p.nose_height,
                                       p.nose_height,
                                       0.78 * p.nose_height,
                                       0.12 * p.nose_height,
                                       0.0};
    double ridge = 0.0;
    for (std::size_t k = 0; k + 1 < nose_y.size(); ++k) {
        if (y <= nose_y[k] && y > nose_y[k + 1]) {
            ridge =
                nose_z[k] + (nose_z[k + 1] - nose_z[k]) * smooth_step(nose_y[k], nose_y[k + 1], y);
        }
    }
    const double width = p.nose_width * (0.72 + 0.33 * smooth_step(0.05, -0.24, y));
    double z = ridge * gauss(side / width);
    z += p.nostrils * gauss((side - 1.22 * p.nose_width) / 0.042) * gauss((y + 0.285) / 0.05);
    z -= 0.075 * gauss((side - 0.29) / 0.17) * gauss((y - 0.06) / 0.11);
    z += 0.04 * gauss((side - 0.27) / 0.20) * gauss((y - 0.215) / 0.07);
    z += 0.035 * gauss((side - 0.40) / 0.17) * gauss((y + 0.16) / 0.13);
    z -= 0.03 * gauss((side - 0.44) / 0.14) * gauss((y + 0.45) / 0.16);
    z += 0.045 * gauss(x / 0.26) * gauss((y + 0.50) / 0.15);
    z -= 0.010 * gauss(x / 0.03) * gauss((y + 0.40) / 0.05);
    z -= 0.045 * gauss(x / 0.17) * gauss((y + 0.665) / 0.045);
    z += 0.065 * gauss(x / 0.15) * gauss((y + 0.80) / 0.10);
    return z;
}

struct SkinPoint {
    Eigen::Vector3d position;
    double lid;      ///< how much of the vertical opening of the eye lies at this x: 0 outside
    double lip;      ///< the same of the mouth
    double shading;  ///< factor on the albedo for creases that cast their own shadow
};

[[nodiscard]] double lid_shift(double x, double distance, const Row& row, const HeadParameters& p) {
    const double closure = 1.0 - (x < 0.0 ? p.lid_closure_left : p.lid_closure_right);
    const double t = (std::abs(x) - eye_spacing) / p.eye_width;
    const double tilt = p.eye_tilt * t * p.eye_width * 4.0 * gauss(t) * gauss(distance / 0.12);
    const double opening = row.eye_side > 0.0 ? p.upper_lid * almond(t + 0.12 * (1.0 - t * t), 0.75)
                                              : p.lower_lid * almond(t, 0.85);
    return tilt + row.eye_side * closure * opening * gauss(distance / 0.13) -
           (1.0 - closure) * 0.6 * p.lower_lid * almond(t, 0.85) * gauss(distance / 0.13);
}

[[nodiscard]] double lip_shift(double x, double distance, const Row& row, const HeadParameters& p) {
    const double t = x / p.mouth_width;
    const double curve =
        p.mouth_curve * (2.0 * t * t - 1.0) * gauss(0.8 * t) * gauss(distance / 0.14);
    const double bow = 1.0 - 0.22 * gauss(x / 0.035);
    const double thickness =
        row.mouth_side > 0.0 ? p.upper_lip * almond(t, 0.8) * bow : p.lower_lip * almond(t, 0.6);
    const double reach = row.lip_fraction < 1.0 ? 1.0 : gauss(distance / 0.15);
    return curve + row.mouth_side * thickness * row.lip_fraction * reach;
}

/// Weight with which a point follows the lower jaw: the lips part along their line, cheeks stretch
/// smoothly beside it.
[[nodiscard]] double jaw_weight(const Eigen::Vector3d& point, double mouth_side,
                                const HeadParameters& p) {
    const double apart = 1.0 - smooth_step(0.7, 1.25, std::abs(point[0]) / p.mouth_width);
    const double smooth = smooth_step(mouth_height + 0.18, mouth_height - 0.22, point[1]);
    const double weight = smooth + apart * ((mouth_side < 0.0   ? 1.0
                                             : mouth_side > 0.0 ? 0.0
                                                                : 0.5) -
                                            smooth);
    return weight * smooth_step(-0.35, 0.35, point[2]);
}

[[nodiscard]] Eigen::Vector3d opened_jaw(const Eigen::Vector3d& point, double weight,
                                         const HeadParameters& p) {
    const double angle = weight * p.jaw_open;
    constexpr double hinge_y = -0.12;
    constexpr double hinge_z = -0.02;
    const double y = point[1] - hinge_y;
    const double z = point[2] - hinge_z;
    return {point[0], hinge_y + y * std::cos(angle) - z * std::sin(angle),
            hinge_z + z * std::cos(angle) + y * std::sin(angle)};
}

/// Follows the eyeball where it protrudes from the face, and leaves the crease of the lid.
[[nodiscard]] double drape_over_eye(double x, double y, double z, const HeadParameters& p) {
    const double radius = eye_radius + 0.018;
    const double across = std::abs(x) - eye_spacing;
    const double square = radius * radius - across * across - (y - eye_height) * (y - eye_height);
    if (square <= 0.0) return z;
    const double sphere = eye_center(p)[2] + std::sqrt(square);
    const double gap = std::clamp(0.5 + (sphere - z) / 0.03, 0.0, 1.0);
    return z + (sphere - z) * gap + 0.015 * gap * (1.0 - gap);
}

[[nodiscard]] SkinPoint skin_point(const Row& row, double angle, const HeadParameters& p) {
    Eigen::Vector3d point = loft_point(row.s, angle);
    SkinPoint result{point, 0.0, 0.0, 1.0};
    const double facing = smooth_step(-0.1, 0.45, std::cos(angle));
    if (facing <= 0.0 || row.s > 0.985) return result;
    const double x = point[0];
    const double shift = facing * (lid_shift(x, point[1] - eye_height, row, p) +
                                   lip_shift(x, point[1] - mouth_height, row, p));
    const double slope =
        (section_at(row.s + 0.005).height - section_at(row.s - 0.005).height) / 0.01;
    const double depth_change =
        row.s < 0.9 ? loft_point(row.s + shift / slope, angle)[2] - point[2] : 0.0;
    point[1] += shift;
    point[2] += depth_change + facing * relief(x, point[1], p);
    result.lid = almond((std::abs(x) - eye_spacing) / p.eye_width, 0.75);
    result.lip = almond(x / p.mouth_width, 0.7);
    if (facing > 0.5) point[2] = drape_over_eye(x, point[1], point[2], p);
    if (row.eye_side == 0.0) point[2] -= 0.09 * result.lid;
    const double bulge = row.lip_fraction * (1.0 - row.lip_fraction) * 4.0;
    if (row.lip_fraction < 1.0) point[2] += facing * result.lip * p.lip_bulge * (0.25 + bulge);
    if (row.mouth_side == 0.0) point[2] -= 0.16 * result.lip;
    result.position = opened_jaw(point, jaw_weight(point, row.mouth_side, p), p);
    return result;
}

[[nodiscard]] Eigen::Vector3d skin_albedo(const Row& row, const SkinPoint& skin,
                                          const HeadParameters& p) {
    const double x = skin.position.x(), y = skin.position.y(), z = skin.position.z();
    const double side = std::abs(x);
    Eigen::Vector3d color = skin_color;
    if (z > 0.0) {
        color = mix(color, {0.80, 0.48, 0.41},
                    0.45 * gauss((side - 0.38) / 0.14) * gauss((y + 0.20) / 0.12));
        color = mix(color, {0.80, 0.50, 0.42}, 0.35 * gauss(x / 0.09) * gauss((y + 0.27) / 0.07));
        color = mix(color, {0.62, 0.42, 0.36},
                    0.50 * gauss((side - 0.30) / 0.17) * gauss((y - 0.13) / 0.06));
        color = mix(color, {0.60, 0.41, 0.35},
                    0.40 * gauss((side - 0.28) / 0.14) * gauss((y + 0.06) / 0.04));
        color =
            mix(color, {0.25, 0.11, 0.09},
                0.85 * gauss((side - 0.62 * p.nose_width) / 0.026) * gauss((y + 0.338) / 0.018));
        color = mix(color, {0.56, 0.37, 0.31},
                    0.40 * gauss((side - 1.9 * p.nose_width) / 0.03) * gauss((y + 0.30) / 0.06));
        color = mix(color, {0.58, 0.38, 0.32}, 0.35 * gauss(x / 0.10) * gauss((y + 0.655) / 0.03));
    }
    if (row.lip_fraction < 1.0) color = mix(color, lip_color, smooth_step(0.0, 0.25, skin.lip));
    if (row.mouth_side == 0.0)
        color = mix(color, {0.20, 0.06, 0.06}, smooth_step(0.0, 0.2, skin.lip));
    if (row.mouth_side != 0.0 && row.lip_fraction == 0.0)
        color = mix(color, {0.42, 0.17, 0.16}, 0.7 * smooth_step(0.0, 0.2, skin.lip));
    const bool lash = row.eye_side > 0.0 && row.s >= 0.5455;
    if (lash) color = mix(color, {0.12, 0.08, 0.06}, 0.85 * smooth_step(0.0, 0.35, skin.lid));
    if (row.eye_side == 0.0)
        color = mix(color, {0.70, 0.45, 0.40}, smooth_step(0.0, 0.2, skin.lid));
    if (row.s > 0.5501 && row.s < 0.551)
        color = mix(color, {0.45, 0.25, 0.22}, 0.6 * smooth_step(0.0, 0.35, skin.lid));
    const double throat = smooth_step(-0.88, -0.915, y) * smooth_step(0.6, 0.4, z);
    return mix(color, {0.40, 0.27, 0.22}, 0.7 * throat);
}

}  // namespace

double gauss(double x) {
    // Beyond 6.2 the value is less than the rounding of 1, and most calls are from there.
    return std::abs(x) > 6.2 ? 0.0 : std::exp(-x * x);
}

double smooth_step(double low, double high, double x) {
    const double t = std::clamp((x - low) / (high - low), 0.0, 1.0);
    return t * t * (3.0 - 2.0 * t);
}

Eigen::Vector3d mix(const Eigen::Vector3d& a, const Eigen::Vector3d& b, double weight) {
    return a + weight * (b - a);
}

Section section_at(double s) {
    s = std::clamp(s, 0.0, 1.0);
    const std::size_t index = knot_before(s);
    return {interpolate(index, s, &Section::height), interpolate(index, s, &Section::half_width),
            interpolate(index, s, &Section::front), interpolate(index, s, &Section::back)};
}

double profile_parameter(double height) {
    double low = 0.0;
    double high = 0.95;
    for (int iteration = 0; iteration < 40; ++iteration) {
        const double middle = 0.5 * (low + high);
        const double at_middle = interpolate(knot_before(middle), middle, &Section::height);
        (at_middle > height ? low : high) = middle;
    }
    return 0.5 * (low + high);
}

Eigen::Vector3d loft_point(double s, double angle) {
    const Section section = section_at(s);
    const double cosine = std::cos(angle);
    const double reach = cosine > 0.0 ? section.front - axis_depth : axis_depth - section.back;
    const double flatness = cosine > 0.0 ? 0.85 : 0.95;
    return {section.half_width * std::sin(angle), section.height,
            axis_depth + reach * std::copysign(std::pow(std::abs(cosine), flatness), cosine)};
}

Eigen::Vector3d face_point(double x, double y, const HeadParameters& parameters) {
    const double s = profile_parameter(y);
    const double angle = std::asin(std::clamp(x / section_at(s).half_width, -1.0, 1.0));
    return {x, y,
            loft_point(s, angle)[2] +
                smooth_step(-0.1, 0.45, std::cos(angle)) * relief(x, y, parameters)};
}

Eigen::Vector3d eye_center(const HeadParameters& parameters) {
    const Eigen::Vector3d socket = face_point(eye_spacing, eye_height, parameters);
    return {eye_spacing, eye_height, socket[2] + 0.030 - eye_radius};
}

void add_skin(HeadMesh& mesh, const HeadParameters& parameters) {
    const std::vector<Row> rows = skin_rows();
    for (const Row& row : rows) {
        for (std::int64_t column = 0; column < columns; ++column) {
            const double turn = 2.0 * std::numbers::pi * static_cast<double>(column) /
                                    static_cast<double>(columns) -
                                std::numbers::pi;
            // Denser at the front, where the face is.
            const double angle = turn - 0.5 * std::sin(turn);
            const SkinPoint skin = skin_point(row, angle, parameters);
            const bool on_lip = row.lip_fraction < 1.0 && skin.lip > 0.05 && std::cos(angle) > 0.0;
            const HeadPart part = !on_lip                 ? HeadPart::skin
                                  : row.mouth_side == 0.0 ? HeadPart::mouth
                                                          : HeadPart::lips;
            const double near_mouth =
                1.0 - smooth_step(0.8, 1.3, std::abs(skin.position[0]) / parameters.mouth_width);
            const double side = std::cos(angle) > 0.0 ? row.mouth_side * near_mouth : 0.0;
            mesh.add(skin.position, skin_albedo(row, skin, parameters), part, side);
        }
    }
    mesh.add_grid(static_cast<std::int64_t>(rows.size()), columns, true, true);
}

}  // namespace stymo::morphable
