#include "train/data/synthetic_people.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "core/angle.h"
#include "core/error.h"
#include "render/pose_json.h"
#include "train/data/synthetic_folder.h"

namespace stymo {

namespace {

using synthetic::truncated_normal;

/// A brightness and a slight colour.
[[nodiscard]] Eigen::Vector3f sample_tint(Rng& rng, double low, double high, double color) {
    const double brightness = rng.uniform(low, high);
    Eigen::Vector3f tint;
    for (float& channel : tint)
        channel = static_cast<float>(brightness * (1.0 + truncated_normal(rng, color, 2 * color)));
    return tint;
}

[[nodiscard]] TexturedPerson sample_person(const TexturedHeads& heads, Rng rng) {
    const std::int64_t count = heads.vertices.shape(0);
    TexturedPerson person{std::vector<float>(static_cast<std::size_t>(count), 0.0F)};
    // Exponential weights with a common divisor are a uniform Dirichlet distribution. A head that
    // is drawn twice gets both weights.
    float sum = 0.0F;
    for (std::int64_t mixed = 2 + rng.below(2); mixed > 0; --mixed) {
        const auto weight = static_cast<float>(1e-3 - std::log(1.0 - rng.uniform()));
        person.weights[static_cast<std::size_t>(rng.below(count))] += weight;
        sum += weight;
    }
    for (float& weight : person.weights) weight /= sum;
    const std::int64_t hair = std::ssize(heads.hair);
    if (hair > 0 && rng.uniform() < 0.4) person.hair = rng.below(hair);
    person.skin_tint = sample_tint(rng, 0.85, 1.15, 0.02);
    person.hair_tint = sample_tint(rng, 0.7, 1.6, 0.03);
    return person;
}

[[nodiscard]] std::vector<float> sample_expression(const TexturedHeads& heads, Rng rng) {
    const std::vector<std::string>& names = heads.expression_names;
    std::vector<float> weights(names.size(), 0.0F);
    const auto add = [&](std::string name, double weight) {
        const bool both = rng.uniform() < 0.75;
        for (int side = 0; side < 2; ++side) {
            const auto found = std::ranges::find(names, name);
            if (found != names.end())
                weights[static_cast<std::size_t>(found - names.begin())] =
                    static_cast<float>(weight);
            if (!both || (name[0] != 'L' && name[0] != 'R')) break;
            name[0] = name[0] == 'L' ? 'R' : 'L';
        }
    };
    const std::int64_t count = rng.below(5);
    for (std::int64_t k = 0; k < count && !names.empty(); ++k) {
        constexpr std::array<const char*, 4> frequent{"LsmileOpen", "LsmileClose", "MouthOpen",
                                                      "LeyeClose"};
        const std::string name =
            rng.uniform() < 0.4
                ? frequent[static_cast<std::size_t>(rng.below(std::ssize(frequent)))]
                : names[static_cast<std::size_t>(rng.below(std::ssize(names)))];
        add(name, k == 0 ? rng.uniform(0.3, 1.0) : rng.uniform(0.1, 0.6));
    }
    return weights;
}

/// A view in which the point before the head's middle that FFHQ's alignment centres is near the
/// middle of the image.
[[nodiscard]] Pose sample_pose(Rng rng, bool is_frontal) {
    const auto angle = [&](double deviation, double limit) {
        return radians_from_degrees(truncated_normal(rng, deviation, limit));
    };
    const double yaw =
        is_frontal ? angle(14.0, 35.0) : radians_from_degrees(rng.uniform(-80.0, 80.0));
    const double pitch = is_frontal ? angle(6.0, 15.0) : angle(9.0, 20.0);
    const double roll = angle(2.0, 5.0);
    const double distance = 5.25 + truncated_normal(rng, 0.1, 0.2);
    constexpr double pivot_depth = 0.65;
    Pose pose = pivot_pose(yaw, pitch, roll, distance, pivot_depth);
    const Eigen::Matrix3d rotation = rotation_from_angles(yaw, pitch, roll);
    const double right = truncated_normal(rng, 0.02, 0.04), up = truncated_normal(rng, 0.02, 0.04);
    pose.translation += right * rotation.col(0) + up * rotation.col(1);
    return pose;
}

/// Whether any of the first `vertices` of the head leaves the image at the top or the sides, or its
/// chin below.
[[nodiscard]] bool leaves_frame(const TexturedSurface& surface, const Camera& camera,
                                std::int64_t vertices) {
    constexpr double margin = 0.01;
    const auto outside = [&](const Eigen::Vector3d& point, bool below) {
        const Eigen::Vector3d at = project(camera, point);
        return at.x() < margin || at.x() > 1.0 - margin || at.y() < margin ||
               (below && at.y() > 1.0 - margin);
    };
    for (const Eigen::Vector3d& point : surface.landmarks)
        if (outside(point, true)) return true;
    const auto head = surface.head.values<float>().first(static_cast<std::size_t>(vertices));
    for (std::size_t vertex = 0; vertex < head.size(); ++vertex) {
        const Eigen::Map<const Eigen::Vector3f> point(
            &surface.vertices.values<float>()[3 * vertex]);
        if (head[vertex] >= 0.5F && outside(point.cast<double>(), false)) return true;
    }
    return false;
}

/// The surface in front of a background that fades from one colour to another. Where the head
/// covers at least half of a pixel, the pixel has the head's own colour, so that the masked image
/// has nothing of the background.
[[nodiscard]] synthetic::WrittenFace photo_of(const RasterImage& drawn, Rng rng) {
    const auto colors = [&](double middle, double range) {
        Eigen::Array3f result;
        for (float& channel : result)
            channel = static_cast<float>(std::clamp(middle + rng.uniform(-range, range), 0.0, 1.0));
        return result;
    };
    const double grey = rng.uniform(0.1, 0.95);
    const Eigen::Array3f above = colors(grey, 0.15), below = colors(grey, 0.15);
    const std::int64_t side = drawn.coverage.shape(0);
    synthetic::WrittenFace face{Tensor({side, side, 3}), Tensor({side, side, 1}), {}};
    const auto image = face.image.mutable_values<float>();
    const auto mask = face.mask.mutable_values<float>();
    for (std::size_t pixel = 0; pixel < mask.size(); ++pixel) {
        const float* const from = &drawn.color.values<float>()[7 * pixel];
        const Eigen::Map<const Eigen::Array3f> all(from), head(from + 3);
        const float share = mask[pixel] = from[6];
        const float down =
            static_cast<float>(static_cast<std::int64_t>(pixel) / side) / static_cast<float>(side);
        const float behind = 1.0F - drawn.coverage.values<float>()[pixel];
        const Eigen::Array3f rest = all - head + behind * (above + down * (below - above));
        const float own = std::min(2.0F * share, 1.0F);
        Eigen::Map<Eigen::Array3f> to(&image[3 * pixel]);
        to.setZero();
        if (own > 0.0F) to += own / share * head;
        if (own < 1.0F) to += (1.0F - own) / (1.0F - share) * rest;
    }
    return face;
}

}  // namespace

SyntheticView sample_synthetic_view(const TexturedHeads& heads, const Rng& rng, std::int64_t view,
                                    const Intrinsics& intrinsics) {
    const Rng of_view = rng.split(static_cast<std::uint64_t>(view));
    SyntheticView result{
        sample_person(heads, rng.split("person")),
        sample_expression(heads, of_view.split("expression")),
        synthetic::sample_light(of_view.split("light")),
        synthetic::at_focal(sample_pose(of_view.split("pose"), view % 3 == 0), intrinsics.focal),
        {}};
    result.surface = textured_surface(heads, result.person, result.expression);
    const Eigen::Vector3d back =
        rotation_from_angles(result.pose.yaw, result.pose.pitch, result.pose.roll).col(2);
    const Eigen::Vector3d start = result.pose.translation;
    const double distance = start.dot(back);
    // As in stymo-prep; what is still outside is long hair, if it is no profile.
    for (const double wider : {1.0, 1.15, 1.3, 1.5, 1.6, 1.7, 1.8}) {
        result.pose.translation = start + (wider - 1.0) * distance * back;
        const std::int64_t vertices =
            wider < 1.5 ? result.surface.vertices.shape(0) : heads.vertices.shape(1);
        if (!leaves_frame(result.surface, camera_from_pose(result.pose, intrinsics), vertices))
            break;
    }
    return result;
}

void write_synthetic_people(const TexturedHeads& heads, const SyntheticPeopleSettings& settings,
                            const Rng& rng, const std::filesystem::path& folder,
                            const std::function<void(std::int64_t)>& progress) {
    if (settings.people < 1 || settings.views < 1)
        fail<ValueError>("[synthetic people] needs at least 1 person and 1 view; got ",
                         settings.people, " and ", settings.views);
    if (settings.prefix.find('/') != std::string::npos)
        fail<ValueError>("[synthetic people] the prefix \"", settings.prefix,
                         "\" is no beginning of a file's name");
    std::vector<std::string> ids;
    const auto person_of = [&](std::int64_t index) {
        return settings.prefix + synthetic::padded_number(index / settings.views);
    };
    for (std::int64_t index = 0; index < settings.people * settings.views; ++index)
        ids.push_back(person_of(index) + "_" + std::to_string(index % settings.views));
    const auto render = [&](std::int64_t index) {
        const std::int64_t number = index % settings.views;
        const Rng of_person = rng.split(static_cast<std::uint64_t>(index / settings.views));
        const SyntheticView view =
            sample_synthetic_view(heads, of_person, number, settings.intrinsics);
        const Camera camera = camera_from_pose(view.pose, settings.intrinsics);
        std::vector<std::vector<double>> landmarks;
        for (const Eigen::Vector3d& point : view.surface.landmarks) {
            const Eigen::Vector3d at = project(camera, point) * static_cast<double>(settings.side);
            landmarks.push_back({at.x(), at.y()});
        }
        const Rng of_view = of_person.split(static_cast<std::uint64_t>(number));
        synthetic::WrittenFace face =
            photo_of(render_textured(view.surface, view.light, camera, settings.side),
                     of_view.split("background"));
        face.record = JsonValue::object({{"id", ids[static_cast<std::size_t>(index)]},
                                         {"pose", to_json(view.pose)},
                                         {"landmarks", landmarks},
                                         {"person", person_of(index)},
                                         {"series", std::to_string(number)},
                                         {"source", "synthetic"}});
        return face;
    };
    synthetic::write_faces(ids, settings.intrinsics, folder, render, progress);
}

}  // namespace stymo
