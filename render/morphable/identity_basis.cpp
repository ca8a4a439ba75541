#include "render/morphable/displacement.h"

namespace stymo::morphable {

namespace {

const Eigen::Vector3d everywhere{100.0, 100.0, 100.0};

struct Measure {
    double HeadParameters::*member;
    double deviation;
};

constexpr std::array<Measure, 24> measures{{
    {&HeadParameters::eye_width, 0.010},      {&HeadParameters::upper_lid, 0.011},
    {&HeadParameters::lower_lid, 0.008},      {&HeadParameters::eye_tilt, 0.035},
    {&HeadParameters::nose_height, 0.035},    {&HeadParameters::nose_bridge, 0.03},
    {&HeadParameters::nose_width, 0.010},     {&HeadParameters::nostrils, 0.015},
    {&HeadParameters::brow_thickness, 0.010}, {&HeadParameters::brow_arch, 0.018},
    {&HeadParameters::mouth_width, 0.025},    {&HeadParameters::upper_lip, 0.013},
    {&HeadParameters::lower_lip, 0.016},      {&HeadParameters::lip_bulge, 0.010},
    {&HeadParameters::mouth_curve, 0.012},    {&HeadParameters::ear_size, 0.09},
    {&HeadParameters::ear_angle, 0.16},       {&HeadParameters::hair_top, 0.035},
    {&HeadParameters::hair_side, 0.035},      {&HeadParameters::hair_fringe, 0.03},
    {&HeadParameters::hairline, 0.055},       {&HeadParameters::hair_length, 0.20},
    {&HeadParameters::hair_parting, 0.40},    {&HeadParameters::hair_wave, 0.012},
}};

/// Proportions: of the head, jaw and chin, cheeks, positions of eyes, nose, mouth and brows.
[[nodiscard]] std::vector<Displacement> proportions() {
    std::vector<Displacement> result{
        {none, everywhere, none, {0.020, 0.0, 0.0}, Symmetry::mirrored},
        {none, everywhere, none, {0.0, 0.015, 0.0}, Symmetry::mirrored},
        {none, everywhere, none, {0.0, 0.0, 0.025}, Symmetry::mirrored},
        {{0.0, -0.75, 0.2}, {1.0, 0.45, 1.0}, none, {0.045, 0.0, 0.0}},
        {{0.0, -0.95, 0.5}, {0.6, 0.40, 0.9}, {0.0, -0.025, 0.0}},
        {{0.0, -0.82, 0.7}, {0.30, 0.20, 0.4}, {0.0, 0.0, 0.02}},
        {{0.0, -0.85, 0.7}, {0.40, 0.18, 0.5}, none, {0.10, 0.0, 0.0}},
        {{0.45, -0.42, 0.5}, {0.22, 0.25, 0.35}, {0.035, 0.0, 0.025}},
        {{0.45, -0.12, 0.6}, {0.20, 0.16, 0.30}, {0.025, 0.0, 0.020}},
        {{eye_spacing, eye_height, 0.7}, {0.38, 0.30, 0.50}, {0.016, 0.0, 0.0}},
        {{eye_spacing, eye_height, 0.7}, {0.38, 0.30, 0.50}, {0.0, 0.016, 0.0}},
        {{eye_spacing, eye_height, 0.7}, {0.36, 0.28, 0.40}, {0.0, 0.0, -0.014}},
        {{0.0, -0.28, 0.9}, {0.16, 0.16, 0.35}, {0.0, -0.014, 0.0}},
        {{0.0, -0.24, 0.95}, {0.12, 0.10, 0.20}, {0.0, 0.012, 0.010}},
        {{0.0, -0.05, 0.9}, {0.08, 0.12, 0.30}, {0.0, 0.0, 0.012}},
        {{0.0, mouth_height, 0.8}, {0.32, 0.16, 0.35}, {0.0, 0.014, 0.0}},
        {{0.0, mouth_height, 0.8}, {0.30, 0.16, 0.35}, {0.0, 0.0, 0.014}},
        {{0.0, 0.42, 0.75}, {0.50, 0.25, 0.40}, {0.0, 0.0, 0.020}},
        {{0.30, 0.20, 0.80}, {0.30, 0.10, 0.40}, {0.0, 0.0, 0.014}},
        {{0.30, 0.22, 0.80}, everywhere, {0.0, 0.015, 0.0}, none, Symmetry::none, HeadPart::brows},
        {{0.12, 0.22, 0.80},
         {0.14, 0.20, 0.40},
         {0.0, 0.018, 0.0},
         none,
         Symmetry::mirrored,
         HeadPart::brows},
        {{0.62, 0.30, 0.20}, {0.30, 0.40, 0.50}, {0.022, 0.0, 0.0}},
        {{0.0, 0.30, -0.9}, {0.80, 0.60, 0.60}, {0.0, 0.0, -0.04}},
        {{0.0, 1.0, 0.0}, {0.90, 0.50, 0.90}, {0.0, 0.025, 0.0}},
        {{0.0, -0.45, 0.4}, {0.80, 0.35, 0.8}, {0.0, -0.018, 0.0}},
        {{0.75, 0.4, 0.2},
         {0.35, 0.60, 0.70},
         {0.035, 0.0, 0.0},
         none,
         Symmetry::mirrored,
         HeadPart::hair},
        {{0.75, -0.5, -0.2},
         {0.45, 0.45, 0.60},
         {0.06, 0.0, 0.03},
         none,
         Symmetry::mirrored,
         HeadPart::hair},
        {{0.35, 0.75, 0.5},
         {0.35, 0.30, 0.50},
         {0.0, 0.035, 0.0},
         none,
         Symmetry::opposed,
         HeadPart::hair},
    };
    return result;
}

}  // namespace

std::vector<BasisRow> identity_basis(const HeadMesh& mesh) {
    std::vector<BasisRow> basis;
    for (const Displacement& proportion : proportions())
        basis.push_back(displaced(mesh, {&proportion, 1}));
    for (const Measure& measure : measures)
        basis.push_back(differentiated(measure.member, measure.deviation, false));
    const auto count = MorphableHead::identity_size - static_cast<std::int64_t>(basis.size());
    for (std::int64_t index = 0; index < count; ++index) {
        const Displacement mode = smooth_mode(index, count, -0.6, 1.0, 0.008);
        basis.push_back(displaced(mesh, {&mode, 1}));
    }
    return basis;
}

}  // namespace stymo::morphable
