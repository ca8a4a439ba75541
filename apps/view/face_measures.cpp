#include "apps/view/face_measures.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <set>
#include <tuple>

namespace stymo {

namespace {

using Point = Eigen::Vector2d;

/// A face of which something is measured.
struct Seen {
    const Tensor& image;
    const Tensor& mask;
    const FacePoints& p;

    [[nodiscard]] double length(std::size_t a, std::size_t b) const { return (p[a] - p[b]).norm(); }
    [[nodiscard]] double width() const { return length(36, 45); }  ///< of both eyes
    [[nodiscard]] double height() const { return length(27, 8); }  ///< from eyes to chin
    [[nodiscard]] Point between(const Point& a, const Point& b, double part) const {
        return a + part * (b - a);
    }
    [[nodiscard]] Point up() const { return (p[27] - p[8]).normalized(); }
    [[nodiscard]] Point cheek(bool left) const {
        const Point inner = 0.5 * ((left ? p[40] : p[46]) + (left ? p[48] : p[54]));
        return between(inner, left ? p[3] : p[13], 0.3);
    }
    [[nodiscard]] Point above_brows(double widths) const {
        return 0.5 * (p[19] + p[24]) + widths * width() * up();
    }

    /// Calls `take` with the index of each pixel within `widths` of a point.
    template <class Take>
    void for_disc(const Point& center, double widths, Take take) const {
        const std::int64_t side = image.shape(0);
        const double radius = std::max(widths * width(), 0.6);
        const auto bound = [&](double at) {
            return std::clamp(static_cast<std::int64_t>(at), std::int64_t{0}, side);
        };
        for (std::int64_t y = bound(center.y() - radius); y < bound(center.y() + radius + 1); ++y)
            for (std::int64_t x = bound(center.x() - radius); x < bound(center.x() + radius + 1);
                 ++x) {
                const Point pixel(static_cast<double>(x) + 0.5, static_cast<double>(y) + 0.5);
                if ((pixel - center).norm() <= radius) take(static_cast<std::size_t>(y * side + x));
            }
    }
    [[nodiscard]] Eigen::Vector3d color(const Point& center, double widths = 0.08) const {
        Eigen::Vector3d sum = Eigen::Vector3d::Zero();
        double count = 1e-9;
        const auto values = image.values<float>();
        for_disc(center, widths, [&](std::size_t pixel) {
            for (std::size_t k = 0; k < 3; ++k)
                sum[static_cast<Eigen::Index>(k)] += static_cast<double>(values[3 * pixel + k]);
            count += 1.0;
        });
        return sum / count;
    }
    [[nodiscard]] double brightness(const Point& center, double widths = 0.08) const {
        return color(center, widths).mean();
    }
    [[nodiscard]] Eigen::Vector3d skin() const {
        return (color(cheek(true)) + color(cheek(false)) + color(above_brows(0.35))) / 3.0;
    }
    /// Standard deviation of green within a disc.
    [[nodiscard]] double contrast(const Point& center, double widths) const {
        double sum = 0.0, squares = 0.0, count = 1e-9;
        const auto values = image.values<float>();
        for_disc(center, widths, [&](std::size_t pixel) {
            const auto value = static_cast<double>(values[3 * pixel + 1]);
            sum += value;
            squares += value * value;
            count += 1.0;
        });
        return std::sqrt(std::max(squares / count - sum * sum / count / count, 0.0));
    }
    /// Area of the head beside and below the jaw, in squared widths of the eyes: hair.
    [[nodiscard]] double beside_jaw() const {
        const std::int64_t side = mask.shape(0);
        const auto values = mask.values<float>();
        const double margin = 0.1 * width();
        double area = 0.0;
        for (std::size_t i = 0; i < values.size(); ++i) {
            const auto x = static_cast<double>(static_cast<std::int64_t>(i) % side);
            const auto y = static_cast<double>(static_cast<std::int64_t>(i) / side);
            if (y > p[2].y() && (x < p[2].x() - margin || x > p[14].x() + margin))
                area += static_cast<double>(values[i]);
        }
        return area / (width() * width());
    }
    /// Area of the head above the brows, in squared widths of the eyes.
    [[nodiscard]] double crown() const {
        const std::int64_t side = mask.shape(0);
        const double brows = above_brows(0.0).y();
        const auto values = mask.values<float>();
        double area = 0.0;
        for (std::size_t i = 0; i < values.size(); ++i)
            if (static_cast<double>(static_cast<std::int64_t>(i) / side) < brows)
                area += static_cast<double>(values[i]);
        return area / (width() * width());
    }
};

double difference(double a, double b) {
    return (a - b) / std::max(a + b, 1e-3);
}

double share(double part, double whole) {
    return part / std::max(whole, 1e-3);
}

/// The groups of codes whose sliders a measure may name, in the order of `code_names`. What
/// happens to differ with something else, such as the light with the sex, names nothing.
using NamedGroups = std::array<bool, 4>;
constexpr NamedGroups identity{true, false, false, false}, expression{false, true, false, false},
    texture{false, false, true, false}, light{false, false, false, true},
    colors{false, false, true, true}, skin{true, false, true, false};

struct Measure {
    EndNames names;
    NamedGroups groups;
    double (*of)(const Seen&);
};

const std::vector<Measure>& measures() {
    static const std::vector<Measure> all{
        {{"wide face", "narrow face"},
         identity,
         [](const Seen& s) { return s.length(1, 15) / s.height(); }},
        {{"broad jaw", "slim jaw"},
         identity,
         [](const Seen& s) { return s.length(5, 11) / s.length(1, 15); }},
        {{"long chin", "short chin"},
         identity,
         [](const Seen& s) { return s.length(57, 8) / s.height(); }},
        {{"long nose", "short nose"},
         identity,
         [](const Seen& s) { return s.length(27, 33) / s.height(); }},
        {{"wide nose", "slim nose"},
         identity,
         [](const Seen& s) { return s.length(31, 35) / s.width(); }},
        {{"eyes apart", "eyes close"},
         identity,
         [](const Seen& s) { return s.length(39, 42) / s.width(); }},
        {{"full lips", "thin lips"},
         identity,
         [](const Seen& s) { return (s.length(51, 62) + s.length(66, 57)) / s.width(); }},
        {{"larger", "smaller"}, identity, [](const Seen& s) { return s.width(); }},
        {{"long hair", "short hair"}, identity, [](const Seen& s) { return s.beside_jaw(); }},
        {{"high hair", "flat hair"}, identity, [](const Seen& s) { return s.crown(); }},
        {{"high forehead", "fringe"},
         identity,
         [](const Seen& s) { return -(s.color(s.above_brows(0.65)) - s.skin()).norm(); }},
        {{"eyes open", "eyes narrow"},
         expression,
         [](const Seen& s) {
             return (s.length(37, 41) + s.length(38, 40) + s.length(43, 47) + s.length(44, 46)) /
                    s.width();
         }},
        {{"brows up", "brows down"},
         expression,
         [](const Seen& s) {
             return (s.above_brows(0.0) - 0.25 * (s.p[36] + s.p[39] + s.p[42] + s.p[45]))
                        .dot(s.up()) /
                    s.width();
         }},
        {{"wide mouth", "small mouth"},
         expression,
         [](const Seen& s) { return s.length(48, 54) / s.width(); }},
        {{"mouth open", "mouth closed"},
         expression,
         [](const Seen& s) { return s.length(62, 66) / s.width(); }},
        {{"smile", "no smile"},
         expression,
         [](const Seen& s) {
             return (0.5 * (s.p[48] + s.p[54]) - 0.5 * (s.p[51] + s.p[57])).dot(s.up()) / s.width();
         }},
        {{"turned right", "turned left"},
         expression,
         [](const Seen& s) { return (s.p[30] - 0.5 * (s.p[2] + s.p[14])).x() / s.width(); }},
        {{"chin up", "chin down"},
         expression,
         [](const Seen& s) { return (s.p[30] - s.p[27]).dot(s.up()) / s.height(); }},
        {{"light hair", "dark hair"},
         texture,
         [](const Seen& s) {
             return share(s.brightness(s.above_brows(1.0), 0.2), s.skin().mean());
         }},
        {{"light brows", "dark brows"},
         texture,
         [](const Seen& s) {
             return share(s.brightness(s.p[19], 0.04) + s.brightness(s.p[24], 0.04),
                          s.skin().mean());
         }},
        {{"no beard", "beard"},
         texture,
         [](const Seen& s) {
             return share(s.brightness(s.between(s.p[33], s.p[51], 0.5), 0.06) +
                              s.brightness(s.between(s.p[57], s.p[8], 0.5)),
                          s.skin().mean());
         }},
        {{"red lips", "pale lips"},
         texture,
         [](const Seen& s) {
             const Eigen::Vector3d lip = s.color(s.between(s.p[57], s.p[66], 0.5), 0.05);
             return share(lip[0], lip[1]) - share(s.skin()[0], s.skin()[1]);
         }},
        {{"lined skin", "smooth skin"},
         skin,
         [](const Seen& s) {
             return share(s.contrast(s.cheek(true), 0.15) + s.contrast(s.cheek(false), 0.15),
                          s.skin().mean());
         }},
        {{"light", "dark"}, colors, [](const Seen& s) { return s.skin().mean(); }},
        {{"warm", "cool"}, colors, [](const Seen& s) { return share(s.skin()[0], s.skin()[2]); }},
        {{"ruddy", "pale"}, colors, [](const Seen& s) { return share(s.skin()[0], s.skin()[1]); }},
        {{"from left", "from right"},
         light,
         [](const Seen& s) {
             return difference(s.brightness(s.cheek(true)), s.brightness(s.cheek(false)));
         }},
        {{"from above", "from below"},
         light,
         [](const Seen& s) {
             return difference(s.brightness(s.above_brows(0.35)),
                               s.brightness(s.between(s.p[57], s.p[8], 0.6)));
         }},
        {{"harsh", "soft"},
         light,
         [](const Seen& s) { return share(s.contrast(s.p[30], 0.8), s.skin().mean()); }},
    };
    return all;
}

}  // namespace

std::vector<double> face_measures(const Tensor& image, const Tensor& mask,
                                  const FacePoints& points) {
    const Seen seen{image, mask, points};
    std::vector<double> values;
    for (const Measure& measure : measures()) values.push_back(measure.of(seen));
    return values;
}

const std::vector<EndNames>& measure_names() {
    static const std::vector<EndNames> names = [] {
        std::vector<EndNames> all;
        for (const Measure& measure : measures()) all.push_back(measure.names);
        return all;
    }();
    return names;
}

std::vector<EndNames> names_of_changes(const std::vector<std::vector<double>>& changes,
                                       const std::vector<std::size_t>& groups) {
    constexpr double least_change = 0.25;
    std::vector<std::tuple<double, std::size_t, std::size_t>> choices;  // -change, direction, name
    for (std::size_t m = 0; m < measure_names().size(); ++m) {
        double squares = 0.0;
        for (const auto& of_direction : changes) squares += of_direction[m] * of_direction[m];
        const double unit = std::sqrt(squares / static_cast<double>(changes.size()));
        for (std::size_t d = 0; d < changes.size(); ++d)
            if (const double change = std::abs(changes[d][m]);
                measures()[m].groups[groups[d]] && change > least_change * unit)
                choices.emplace_back(-change / unit, d, m);
    }
    std::ranges::sort(choices);
    std::vector<EndNames> names(changes.size());
    std::set<std::pair<std::size_t, std::size_t>> taken;  // group and name
    for (const auto& [change, d, m] : choices) {
        if (!names[d].more.empty() || !taken.emplace(groups[d], m).second) continue;
        names[d] = measure_names()[m];
        if (changes[d][m] < 0.0) std::swap(names[d].more, names[d].less);
    }
    return names;
}

}  // namespace stymo
