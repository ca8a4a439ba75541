#include <cmath>
#include <functional>

#include "core/parallel.h"
#include "render/morphable/displacement.h"
#include "render/morphable/skin_surface.h"

namespace stymo::morphable {

namespace {

struct Surface {
    Eigen::Vector3d point;
    HeadPart part;
    Eigen::Vector3d albedo;

    [[nodiscard]] bool skin() const { return part == HeadPart::skin || part == HeadPart::ears; }
    [[nodiscard]] double side() const { return std::abs(point[0]); }
};

/// A colour and how much of it each point takes for a coefficient of 1.
struct Tint {
    Eigen::Vector3d color;
    std::function<double(const Surface&)> weight;
};

[[nodiscard]] double on(const Surface& s, HeadPart part) {
    return s.part == part ? 1.0 : 0.0;
}
[[nodiscard]] double on_iris(const Surface& s) {
    return s.part == HeadPart::eyes && s.albedo[0] > 0.2 && s.albedo[0] < 0.6 ? 1.0 : 0.0;
}
[[nodiscard]] double front(const Surface& s) {
    return s.skin() ? smooth_step(0.1, 0.4, s.point[2]) : 0.0;
}

[[nodiscard]] std::vector<Tint> tints() {
    return {
        // lighter and darker skin, lips with it
        {{0.095, 0.100, 0.095},
         [](const Surface& s) { return s.skin()                   ? 1.0
                                       : s.part == HeadPart::lips ? 0.7
                                                                  : 0.0; }},
        // warmer and cooler
        {{0.014, -0.002, -0.018}, [](const Surface& s) { return s.skin() ? 1.0 : 0.0; }},
        {{0.008, -0.010, -0.005}, [](const Surface& s) { return s.skin() ? 1.0 : 0.0; }},
        // hair: lighter, redder, greyer; brows follow less
        {{0.150, 0.120, 0.085},
         [](const Surface& s) { return on(s, HeadPart::hair) + 0.3 * on(s, HeadPart::brows); }},
        {{0.060, 0.000, -0.022},
         [](const Surface& s) { return on(s, HeadPart::hair) + 0.3 * on(s, HeadPart::brows); }},
        {{-0.010, 0.008, 0.022}, [](const Surface& s) { return on(s, HeadPart::hair); }},
        // brows
        {{0.070, 0.055, 0.045}, [](const Surface& s) { return on(s, HeadPart::brows); }},
        // lips: redder, paler
        {{0.022, -0.026, -0.020}, [](const Surface& s) { return on(s, HeadPart::lips); }},
        {{0.020, 0.018, 0.018}, [](const Surface& s) { return on(s, HeadPart::lips); }},
        // eyes: brown to blue, lighter, greener
        {{-0.090, 0.020, 0.130}, on_iris},
        {{0.070, 0.070, 0.060}, on_iris},
        {{-0.020, 0.060, -0.020}, on_iris},
        // red cheeks, red nose
        {{0.022, -0.022, -0.016},
         [](const Surface& s) {
             return front(s) * gauss((s.side() - 0.38) / 0.15) * gauss((s.point[1] + 0.22) / 0.13);
         }},
        {{0.018, -0.020, -0.018},
         [](const Surface& s) {
             return front(s) * gauss(s.point[0] / 0.12) * gauss((s.point[1] + 0.26) / 0.10);
         }},
        // beard
        {{-0.050, -0.043, -0.036},
         [](const Surface& s) {
             const double chin =
                 smooth_step(-0.40, -0.56, s.point[1]) * smooth_step(-0.2, 0.2, s.point[2]);
             const double lip = gauss(s.point[0] / 0.22) * gauss((s.point[1] + 0.42) / 0.05) *
                                smooth_step(0.3, 0.5, s.point[2]);
             return s.skin() ? std::min(1.0, chin + 0.8 * lip) : 0.0;
         }},
        // shadows of the eyes, of the lids
        {{-0.040, -0.040, -0.025},
         [](const Surface& s) {
             return front(s) * gauss((s.side() - 0.28) / 0.13) * gauss((s.point[1] + 0.06) / 0.05);
         }},
        {{-0.030, -0.045, -0.020},
         [](const Surface& s) {
             return front(s) * gauss((s.side() - 0.30) / 0.15) * gauss((s.point[1] - 0.13) / 0.05);
         }},
        // hair darker at its tips, lighter on top, streaks
        {{0.070, 0.055, 0.040},
         [](const Surface& s) {
             return on(s, HeadPart::hair) * smooth_step(0.4, -0.4, s.point[1]);
         }},
        {{0.060, 0.048, 0.036},
         [](const Surface& s) {
             return on(s, HeadPart::hair) * smooth_step(0.6, 1.0, s.point[1]);
         }},
        {{0.060, 0.048, 0.036},
         [](const Surface& s) {
             return on(s, HeadPart::hair) *
                    std::sin(7.0 * std::atan2(s.point[0], s.point[2] + 0.1));
         }},
        // forehead and chin lighter
        {{0.025, 0.022, 0.020},
         [](const Surface& s) { return front(s) * gauss((s.point[1] - 0.42) / 0.2); }},
        {{0.025, 0.022, 0.020},
         [](const Surface& s) {
             return front(s) * gauss(s.point[0] / 0.2) * gauss((s.point[1] + 0.8) / 0.15);
         }},
        // ears redder
        {{0.025, -0.018, -0.012}, [](const Surface& s) { return on(s, HeadPart::ears); }},
    };
}

/// A smooth stain on skin or hair, in one of three colours.
[[nodiscard]] Tint stain(std::int64_t index, std::int64_t count) {
    const std::array<Eigen::Vector3d, 3> colors{
        {{0.010, 0.010, 0.010}, {0.007, -0.005, -0.005}, {0.006, 0.002, -0.007}}};
    const Displacement mode = smooth_mode(index, count, -0.7, 1.0, 1.0);
    return {colors[static_cast<std::size_t>(index % 3)], [mode](const Surface& s) {
                if (!s.skin() && s.part != HeadPart::hair) return 0.0;
                const auto bump = [&](double x) {
                    const Eigen::Vector3d offset =
                        Eigen::Vector3d(x, s.point[1], s.point[2]) - mode.center;
                    return std::exp(-offset.cwiseQuotient(mode.radius).squaredNorm());
                };
                return bump(s.point[0]) +
                       (mode.symmetry == Symmetry::opposed ? -1.0 : 1.0) * bump(-s.point[0]);
            }};
}

}  // namespace

std::vector<BasisRow> texture_basis(std::span<const Eigen::Vector3d> vertices,
                                    std::span<const HeadPart> parts,
                                    std::span<const Eigen::Vector3d> albedo) {
    std::vector<Tint> rows = tints();
    const auto count = MorphableHead::texture_size - static_cast<std::int64_t>(rows.size());
    for (std::int64_t index = 0; index < count; ++index) rows.push_back(stain(index, count));
    std::vector<BasisRow> basis(rows.size(), BasisRow(vertices.size()));
    const auto fill = [&](const Tint& tint, BasisRow& row) {
        for (std::size_t vertex = 0; vertex < row.size(); ++vertex) {
            const double weight = tint.weight({vertices[vertex], parts[vertex], albedo[vertex]});
            row[vertex] = weight * tint.color;
        }
    };
    parallel_items(std::ssize(rows),
                   [&](std::size_t row, int /*thread*/) { fill(rows[row], basis[row]); });
    return basis;
}

}  // namespace stymo::morphable
