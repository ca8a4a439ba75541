#include "train/landmarks/face_paint.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <tuple>
#include <utility>

#include "train/landmarks/random.h"

namespace stymo {
namespace {

using Color = Eigen::Vector3d;

/// The lines, in the order of their construction.
enum LineName : std::size_t {
    brows,
    upper_lids = brows + 2,
    lower_lids = upper_lids + 2,
    lid_creases = lower_lids + 2,
    eye_bags = lid_creases + 2,
    folds = eye_bags + 2,
    nostrils = folds + 2,
    mouth = nostrils + 2,
    below_lips,
    forehead,
};
constexpr std::size_t forehead_lines = 3;

void mix(Color& color, const Color& other, double share) {
    color += share * (other - color);
}

[[nodiscard]] Color jittered(const Color& color, double deviation, Rng& rng) {
    const double common = 1.0 + deviation * rng.normal();
    Color result;
    for (int k = 0; k < 3; ++k)
        result[k] = std::clamp(color[k] * (common + 0.3 * deviation * rng.normal()), 0.02, 0.97);
    return result;
}

[[nodiscard]] bool inside(const Eigen::Vector2d& point,
                          const std::vector<Eigen::Vector2d>& polygon) {
    bool result = false;
    for (std::size_t k = 0; k < polygon.size(); ++k) {
        const Eigen::Vector2d& a = polygon[k];
        const Eigen::Vector2d& b = polygon[(k + 1) % polygon.size()];
        if ((a.y() > point.y()) != (b.y() > point.y()) &&
            point.x() < a.x() + (b.x() - a.x()) * (point.y() - a.y()) / (b.y() - a.y()))
            result = !result;
    }
    return result;
}

/// A sum of random waves in space, about normal with deviation 1.
struct Waves {
    std::array<Eigen::Vector4d, 5> waves;

    Waves(Rng& rng, double frequency) {
        for (Eigen::Vector4d& wave : waves)
            wave = {frequency * rng.normal(), frequency * rng.normal(), frequency * rng.normal(),
                    between(rng, 0.0, 6.28)};
    }
    [[nodiscard]] double at(const Eigen::Vector3d& point) const {
        double sum = 0.0;
        for (const Eigen::Vector4d& wave : waves)
            sum += std::sin(wave.head<3>().dot(point) + wave[3]);
        return 0.63 * sum;
    }
};

}  // namespace

FacePaint::FacePaint(const MorphableHead& head) : parts_(head.parts) {
    const auto mean = head.mean.values<float>();
    const auto albedo = head.mean_albedo.values<float>();
    for (std::size_t vertex = 0; vertex < parts_.size(); ++vertex) {
        points_.push_back(Eigen::Map<const Eigen::Vector3f>(&mean[3 * vertex]).cast<double>());
        albedo_.push_back(Eigen::Map<const Eigen::Vector3f>(&albedo[3 * vertex]).cast<double>());
        const HeadPart part = parts_[vertex];
        if ((part == HeadPart::skin || part == HeadPart::lips || part == HeadPart::brows) &&
            points_[vertex].z() > 0.2)
            front_.push_back(vertex);
    }
    const auto at = [&](std::size_t k) -> Eigen::Vector2d {
        return points_[static_cast<std::size_t>(head.landmarks[k])].head<2>();
    };
    const auto run = [&](std::vector<std::size_t> landmarks, double right, double up) {
        Line line;
        for (const std::size_t k : landmarks) line.emplace_back(at(k) + Eigen::Vector2d(right, up));
        return line;
    };
    add_line(run({17, 18, 19, 20, 21}, 0.0, 0.0));
    add_line(run({26, 25, 24, 23, 22}, 0.0, 0.0));
    const std::vector<std::size_t> upper_left{36, 37, 38, 39}, upper_right{45, 44, 43, 42};
    const std::vector<std::size_t> lower_left{36, 41, 40, 39}, lower_right{45, 46, 47, 42};
    for (const double up : {0.0, 0.035, -0.08}) {
        if (up >= 0.0) {
            add_line(run(upper_left, 0.0, up));
            add_line(run(upper_right, 0.0, up));
        }
        if (up <= 0.0) {
            add_line(run(lower_left, 0.0, up));
            add_line(run(lower_right, 0.0, up));
        }
    }
    for (const auto& [wing, corner, out] :
         {std::tuple{31UL, 48UL, -1.0}, std::tuple{35UL, 54UL, 1.0}})
        add_line({at(wing) + Eigen::Vector2d(0.04 * out, 0.04),
                  0.5 * (at(wing) + at(corner)) + Eigen::Vector2d(0.07 * out, 0.03),
                  at(corner) + Eigen::Vector2d(0.06 * out, -0.02)});
    for (const auto& [wing, inner] : {std::pair{31UL, 32UL}, std::pair{35UL, 34UL}})
        add_line({0.35 * at(wing) + 0.65 * at(inner) + Eigen::Vector2d(0.0, 0.012),
                  0.8 * at(inner) + 0.2 * at(33) + Eigen::Vector2d(0.0, 0.012)});
    add_line({at(48), at(60), 0.5 * (at(61) + at(67)), 0.5 * (at(62) + at(66)),
              0.5 * (at(63) + at(65)), at(64), at(54)});
    add_line(run({58, 57, 56}, 0.0, -0.05));
    for (std::size_t k = 0; k < forehead_lines; ++k)
        add_line(run({18, 19, 24, 25}, 0.0, 0.12 + 0.09 * static_cast<double>(k)));
    const Line lips = run({48, 49, 50, 51, 52, 53, 54, 55, 56, 57, 58, 59}, 0.0, 0.0);
    const double nose_y = at(33).y(), mouth_y = at(62).y(), half_mouth = at(54).x();
    const double chin_y = at(8).y(), jaw_x = at(14).x();
    for (const std::size_t vertex : front_) {
        const Eigen::Vector2d point = points_[vertex].head<2>();
        lip_.push_back(inside(point, lips) ? 1.0F : 0.0F);
        const double side = std::abs(point.x());
        const double cheek = mouth_y + 0.75 * (nose_y - mouth_y) * ramp(0.3, 1.0, side / jaw_x) +
                             0.5 * (mouth_y - chin_y) * (ramp(0.0, 0.6, side / jaw_x) - 0.75);
        beard_.push_back(static_cast<float>(ramp(cheek + 0.05, cheek - 0.05, point.y())));
        moustache_.push_back(static_cast<float>(ramp(nose_y + 0.01, nose_y - 0.04, point.y()) *
                                                ramp(mouth_y - 0.06, mouth_y, point.y()) *
                                                ramp(half_mouth + 0.06, half_mouth - 0.02, side)));
    }
}

void FacePaint::add_line(const Line& line) {
    std::vector<Place> places;
    for (const std::size_t vertex : front_) {
        const Eigen::Vector2d point = points_[vertex].head<2>();
        Place best{0.0F, 1e9F};
        for (std::size_t k = 0; k + 1 < line.size(); ++k) {
            const Eigen::Vector2d along = line[k + 1] - line[k];
            const double t = std::clamp(
                (point - line[k]).dot(along) / std::max(along.squaredNorm(), 1e-12), 0.0, 1.0);
            const Eigen::Vector2d offset = point - line[k] - t * along;
            const auto distance = static_cast<float>(offset.norm());
            if (distance >= std::abs(best.above)) continue;
            best = {static_cast<float>((static_cast<double>(k) + t) /
                                       static_cast<double>(line.size() - 1)),
                    offset.y() < 0.0 ? -distance : distance};
        }
        places.push_back(best);
    }
    places_.push_back(std::move(places));
}

void FacePaint::stroke(std::vector<Color>& colors, std::size_t line, const Stroke& stroke) const {
    const std::vector<Place>& places = places_[line];
    for (std::size_t i = 0; i < front_.size(); ++i) {
        const double along = places[i].along;
        const double ends = 1.0 - stroke.taper * std::pow(2.0 * along - 1.0, 2.0);
        const double width = stroke.width * std::max(ends, 0.05);
        const double distance = std::abs(static_cast<double>(places[i].above) - stroke.shift);
        if (distance > width) continue;
        mix(colors[front_[i]], stroke.color, stroke.opacity * ramp(width, 0.5 * width, distance));
    }
}

Color FacePaint::skin_color(Rng& rng) {
    static const std::array<Color, 5> tones{Color{0.20, 0.12, 0.08}, Color{0.38, 0.24, 0.17},
                                            Color{0.60, 0.42, 0.32}, Color{0.80, 0.60, 0.49},
                                            Color{0.92, 0.75, 0.67}};
    // Light skin more often, as in most collections of portraits.
    const double tone = 4.0 * std::pow(rng.uniform(), 0.45);
    const auto index = std::min<std::size_t>(static_cast<std::size_t>(tone), 3);
    Color color = tones[index];
    mix(color, tones[index + 1], tone - static_cast<double>(index));
    return jittered(color, 0.06, rng);
}

Color FacePaint::hair_color(Rng& rng) {
    static const std::array<Color, 7> colors{Color{0.05, 0.04, 0.04}, Color{0.12, 0.08, 0.06},
                                             Color{0.25, 0.16, 0.10}, Color{0.45, 0.30, 0.18},
                                             Color{0.70, 0.55, 0.35}, Color{0.50, 0.49, 0.48},
                                             Color{0.80, 0.79, 0.77}};
    return jittered(colors[static_cast<std::size_t>(rng.below(7))], 0.15, rng);
}

void FacePaint::draw_features(std::vector<Color>& colors, const Color& skin, const Color& hair,
                              Rng& rng) const {
    const auto both = [&](std::size_t first, const Stroke& one) {
        for (std::size_t k = 0; k < 2; ++k) {
            Stroke other = one;
            other.width *= 1.0 + 0.1 * rng.normal();
            stroke(colors, first + k, other);
        }
    };
    Color brow = jittered(0.75 * hair, 0.15, rng);
    if (chance(rng, 0.3)) mix(brow, {0.15, 0.10, 0.08}, 0.7);
    both(brows, {between(rng, 0.022, 0.06), between(rng, -0.012, 0.012), between(rng, 0.0, 0.8),
                 chance(rng, 0.1) ? between(rng, 0.1, 0.3) : between(rng, 0.4, 1.0), brow});
    const Color dark = 0.25 * skin;
    const double lashes = std::pow(rng.uniform(), 1.5);
    both(lid_creases, {between(rng, 0.012, 0.03), between(rng, -0.01, 0.02), 0.5,
                       between(rng, 0.0, 0.6), chance(rng, 0.2) ? dark : Color(0.55 * skin)});
    both(upper_lids, {between(rng, 0.012, 0.022), 0.0, 0.3, 0.3 + 0.7 * lashes, 0.4 * dark});
    both(lower_lids, {between(rng, 0.008, 0.016), 0.0, 0.3, 0.6 * lashes * rng.uniform(), dark});
    both(eye_bags, {between(rng, 0.02, 0.05), between(rng, -0.02, 0.03), 0.6,
                    between(rng, 0.0, 0.45), 0.55 * skin});
    both(folds, {between(rng, 0.015, 0.045), 0.0, 0.6, between(rng, 0.0, 0.6), 0.5 * skin});
    both(nostrils, {between(rng, 0.018, 0.034), between(rng, -0.005, 0.01), 0.0,
                    between(rng, 0.4, 1.0), 0.15 * skin});
    stroke(colors, below_lips,
           {between(rng, 0.02, 0.05), 0.0, 0.7, between(rng, 0.0, 0.5), 0.6 * skin});
    const double lines = between(rng, -0.5, 0.4);
    for (std::size_t k = 0; k < forehead_lines; ++k)
        stroke(colors, forehead + k,
               {0.015, between(rng, -0.03, 0.03), 0.5, std::max(lines, 0.0), 0.6 * skin});
}

void FacePaint::draw_lips(std::vector<Color>& colors, const Color& skin, Rng& rng) const {
    Color lip = skin.cwiseProduct(
        Color(between(rng, 0.75, 1.05), between(rng, 0.5, 0.85), between(rng, 0.55, 0.9)));
    if (chance(rng, 0.25))  // lipstick
        lip = {between(rng, 0.4, 0.8), between(rng, 0.05, 0.3), between(rng, 0.1, 0.35)};
    const double opacity = between(rng, 0.25, 1.0);
    for (std::size_t i = 0; i < front_.size(); ++i)
        if (lip_[i] > 0.0F) mix(colors[front_[i]], lip, opacity);
    stroke(colors, mouth,
           {between(rng, 0.008, 0.02), 0.0, 0.3, between(rng, 0.3, 1.0), 0.25 * skin});
}

void FacePaint::draw_beard(std::vector<Color>& colors, const Color& hair, Rng& rng) const {
    const bool stubble = chance(rng, 0.35);
    const double beard = chance(rng, 0.15) ? between(rng, 0.4, 0.95)
                         : stubble         ? between(rng, 0.05, 0.35)
                                           : 0.0;
    const double moustache = chance(rng, 0.1) ? between(rng, 0.4, 1.0) : beard;
    if (beard == 0.0 && moustache == 0.0) return;
    const Waves patches(rng, 12.0);
    for (std::size_t i = 0; i < front_.size(); ++i) {
        if (lip_[i] > 0.0F) continue;
        const double share = std::max(beard * static_cast<double>(beard_[i]),
                                      moustache * static_cast<double>(moustache_[i]));
        if (share == 0.0) continue;
        const double density = std::clamp(1.0 + 0.2 * patches.at(points_[front_[i]]), 0.0, 1.2);
        mix(colors[front_[i]], hair, std::min(share * density, 1.0));
    }
}

void FacePaint::draw_hair(std::vector<Color>& colors, const Color& hair, Rng& rng) const {
    const double line_shift =
        chance(rng, 0.15) ? between(rng, 0.2, 1.0) : between(rng, -0.12, 0.15);
    const double side_shift = between(rng, -0.2, 0.1);
    const double reach = between(rng, 0.68, 0.92);
    const double soft = between(rng, 0.02, 0.1);
    const Waves strands(rng, 25.0);
    for (std::size_t vertex = 0; vertex < points_.size(); ++vertex) {
        const HeadPart part = parts_[vertex];
        if (part == HeadPart::eyes || part == HeadPart::mouth || part == HeadPart::lips) continue;
        const Eigen::Vector3d& point = points_[vertex];
        const double front = ramp(0.05, 0.55, point.z());
        const double line =
            0.02 + (point.z() > 0.0 ? 0.60 * front + front * line_shift + (1.0 - front) * side_shift
                                    : -0.55 * ramp(0.25, 0.6, -point.z()));
        const double ear = ramp(0.62, 0.68, std::abs(point.x())) * ramp(0.36, 0.26, point.y());
        const double cover = ramp(line - soft, line + soft, point.y()) *
                             ramp(reach, reach - 0.1, point.z()) * (1.0 - ear);
        if (cover > 0.0)
            mix(colors[vertex], hair * std::max(0.3, 1.0 + 0.15 * strands.at(point)), cover);
    }
}

void FacePaint::draw_eyes(std::vector<Color>& colors, Rng& rng) const {
    static const std::array<Color, 4> irises{Color{0.10, 0.06, 0.04}, Color{0.22, 0.13, 0.08},
                                             Color{0.30, 0.40, 0.50}, Color{0.30, 0.35, 0.22}};
    const Color iris = jittered(irises[static_cast<std::size_t>(rng.below(4))], 0.2, rng);
    const Color white = between(rng, 0.5, 0.95) * Color(1.0, 0.96, 0.94);
    const double mouth = between(rng, 0.6, 1.1);
    for (std::size_t vertex = 0; vertex < points_.size(); ++vertex) {
        const Color& color = albedo_[vertex];
        if (parts_[vertex] == HeadPart::mouth) colors[vertex] = mouth * color;
        if (parts_[vertex] != HeadPart::eyes) continue;
        colors[vertex] = color.x() > 0.6 ? white : color.x() > 0.2 ? iris : color;
    }
}

Tensor FacePaint::draw(Rng rng) const {
    const Color skin = skin_color(rng);
    const Color hair = hair_color(rng);
    const Waves coarse(rng, 3.0), medium(rng, 9.0), fine(rng, 30.0);
    const double roughness = between(rng, 0.0, 0.05);
    const double blush = between(rng, 0.0, 0.05);
    std::vector<Color> colors(points_.size());
    for (std::size_t vertex = 0; vertex < points_.size(); ++vertex) {
        const Eigen::Vector3d& point = points_[vertex];
        const double light = 1.0 + 0.05 * coarse.at(point) + 0.03 * medium.at(point) +
                             0.02 * fine.at(point) + roughness * rng.normal();
        const double red = blush * medium.at(point + Eigen::Vector3d(7.0, 0.0, 0.0));
        colors[vertex] = light * skin.cwiseProduct(Color(1.0 + red, 1.0 - red, 1.0 - red));
    }
    draw_features(colors, skin, hair, rng);
    draw_beard(colors, jittered(hair, 0.2, rng), rng);
    draw_lips(colors, skin, rng);
    draw_hair(colors, hair, rng);
    draw_eyes(colors, rng);
    Tensor result({static_cast<std::int64_t>(colors.size()), 3});
    auto value = result.mutable_values<float>().begin();
    for (const Color& color : colors)
        for (int k = 0; k < 3; ++k) *value++ = static_cast<float>(std::clamp(color[k], 0.01, 1.0));
    return result;
}

}  // namespace stymo
