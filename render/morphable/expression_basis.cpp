#include <algorithm>

#include "render/morphable/displacement.h"

namespace stymo::morphable {

namespace {

const Eigen::Vector3d mouth_corner{0.24, mouth_height, 0.70};
const Eigen::Vector3d mirrored_corner{-0.24, mouth_height, 0.70};

/// One expression that several displacements make together.
struct Expression {
    std::vector<Displacement> displacements;
    bool one_sided = false;
};

[[nodiscard]] Expression smile(const Eigen::Vector3d& corner, Symmetry symmetry) {
    const double out = corner[0] < 0.0 ? -1.0 : 1.0;
    return {{{corner, {0.13, 0.13, 0.35}, {0.022 * out, 0.028, -0.015}, none, symmetry},
             {{1.5 * corner[0], -0.22, 0.60},
              {0.16, 0.13, 0.30},
              {0.010 * out, 0.016, 0.014},
              none,
              symmetry}}};
}

[[nodiscard]] Expression brow_raise(const Eigen::Vector3d& center, Symmetry symmetry) {
    return {{{center, {0.17, 0.13, 0.40}, {0.0, 0.018, 0.0}, none, symmetry}}};
}

[[nodiscard]] std::vector<Expression> expressions() {
    const Eigen::Vector3d mouth{0.0, mouth_height, 0.80};
    return {
        smile(mouth_corner, Symmetry::mirrored),
        smile(mouth_corner, Symmetry::none),
        smile(mirrored_corner, Symmetry::none),
        brow_raise({0.30, 0.24, 0.80}, Symmetry::mirrored),
        brow_raise({0.30, 0.24, 0.80}, Symmetry::none),
        brow_raise({-0.30, 0.24, 0.80}, Symmetry::none),
        brow_raise({0.13, 0.22, 0.80}, Symmetry::mirrored),
        brow_raise({0.45, 0.22, 0.70}, Symmetry::mirrored),
        // knitted brows
        {{{{0.15, 0.21, 0.80}, {0.13, 0.10, 0.40}, {-0.010, -0.012, 0.004}}}},
        // pucker, and its opposite
        {{{mouth, {0.30, 0.16, 0.40}, {0.0, 0.0, 0.012}, {-0.055, 0.0, 0.0}}}},
        {{{mouth, {0.30, 0.12, 0.40}, {0.0, 0.014, 0.0}, none, Symmetry::none, std::nullopt, 1}},
         true},
        {{{mouth, {0.30, 0.12, 0.40}, {0.0, -0.014, 0.0}, none, Symmetry::none, std::nullopt, -1}},
         true},
        // fuller and thinner lips
        {{{mouth, {0.25, 0.10, 0.35}, none, {0.0, 0.09, 0.0}}}},
        // mouth and jaw to one side, jaw forward
        {{{mouth, {0.35, 0.20, 0.40}, {0.011, 0.0, 0.0}, none, Symmetry::none}}},
        {{{{0.0, -0.80, 0.60}, {0.60, 0.35, 0.60}, {0.011, 0.0, 0.0}, none, Symmetry::none}}},
        {{{{0.0, -0.78, 0.60}, {0.50, 0.30, 0.60}, {0.0, 0.0, 0.016}, none, Symmetry::none}}},
        // puffed cheeks
        {{{{0.42, -0.42, 0.55}, {0.20, 0.18, 0.35}, {0.022, 0.0, 0.016}}}},
        // wrinkled nose
        {{{{0.10, -0.27, 0.85}, {0.09, 0.10, 0.30}, {0.004, 0.012, 0.0}}}},
        // raised cheeks
        {{{{0.34, -0.10, 0.68}, {0.18, 0.10, 0.30}, {0.0, 0.014, 0.010}}}},
        // raised chin
        {{{{0.0, -0.76, 0.75}, {0.20, 0.12, 0.30}, {0.0, 0.012, 0.006}}}},
    };
}

struct Movement {
    double HeadParameters::*member;
    double amount;
    bool one_sided;
};

constexpr std::array<Movement, 5> movements{{{&HeadParameters::jaw_open, 0.08, true},
                                             {&HeadParameters::lid_closure_left, 0.22, true},
                                             {&HeadParameters::lid_closure_right, 0.22, true},
                                             {&HeadParameters::gaze_x, 0.13, false},
                                             {&HeadParameters::gaze_y, 0.07, false}}};

}  // namespace

std::vector<std::string> expression_names() {
    return {"jawOpen",      "eyeBlink_R",     "eyeBlink_L",   "gazeLeft",    "gazeUp",
            "mouthSmile",   "mouthSmile_L",   "mouthSmile_R", "browRaise",   "browRaise_L",
            "browRaise_R",  "browInnerUp",    "browOuterUp",  "browKnit",    "mouthPucker",
            "mouthUpperUp", "mouthLowerDown", "lipsFull",     "mouthLeft",   "jawLeft",
            "jawForward",   "cheekPuff",      "noseSneer",    "cheekSquint", "mouthShrugLower"};
}

std::vector<BasisRow> expression_basis(const HeadMesh& mesh, std::span<bool> one_sided) {
    std::fill(one_sided.begin(), one_sided.end(), false);
    std::vector<BasisRow> basis;
    for (const Movement& movement : movements) {
        one_sided[basis.size()] = movement.one_sided;
        basis.push_back(differentiated(movement.member, movement.amount, movement.one_sided));
    }
    for (const Expression& expression : expressions()) {
        one_sided[basis.size()] = expression.one_sided;
        basis.push_back(displaced(mesh, expression.displacements));
    }
    const auto count = MorphableHead::expression_size - static_cast<std::int64_t>(basis.size());
    for (std::int64_t index = 0; index < count; ++index) {
        Displacement mode = smooth_mode(index, count, 0.35, 1.0, 0.004);
        mode.radius = {0.20, 0.20, 0.35};
        basis.push_back(displaced(mesh, {&mode, 1}));
    }
    return basis;
}

}  // namespace stymo::morphable
