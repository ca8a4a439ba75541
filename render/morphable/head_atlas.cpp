#include "render/morphable/head_atlas.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <iterator>
#include <map>
#include <numbers>

#include "core/tensor_eigen.h"
#include "render/rasterizer.h"
#include "render/triangle_mesh.h"

namespace stymo {

namespace {

using Triangle = std::array<std::int32_t, 3>;

/// A piece of the surface that becomes one rectangle of the atlas.
struct Chart {
    std::vector<std::size_t> triangles;
    double size = 0.0;  ///< square root of its area; more for eyes, less for what is in the mouth
    Eigen::AlignedBox3f box;
    float width_used = 1.0F;  ///< largest u, beyond 1 for the triangles that cross the seam
    Eigen::Array2f origin = Eigen::Array2f::Zero(), extent = Eigen::Array2f::Ones();
};

Eigen::Vector3f point_of(const MorphableHead& head, std::int32_t vertex) {
    return matrix_map<float>(head.mean).row(vertex).transpose();
}

/// Place of a vertex on its chart: u in [0, 1] around the vertical axis, v in [0, 1] downwards.
Eigen::Array2f position_of(const MorphableHead& head, const Chart& chart, std::int32_t vertex) {
    if (head.grid_uv.defined()) return matrix_map<float>(head.grid_uv).row(vertex).transpose();
    const Eigen::Vector3f from = point_of(head, vertex) - chart.box.center();
    return {std::atan2(from[0], from[2]) / (2.0F * std::numbers::pi_v<float>)+0.5F,
            0.5F - from[1] / std::max(chart.box.sizes()[1], 1e-6F)};
}

/// The corners' positions, in which u does not jump from 1 to 0.
std::array<Eigen::Array2f, 3> positions_of(const MorphableHead& head, const Chart& chart,
                                           const Triangle& triangle) {
    std::array<Eigen::Array2f, 3> positions;
    std::ranges::transform(triangle, positions.begin(),
                           [&](std::int32_t vertex) { return position_of(head, chart, vertex); });
    const auto [low, high] = std::minmax({positions[0][0], positions[1][0], positions[2][0]});
    if (high - low > 0.5F)
        for (Eigen::Array2f& position : positions)
            if (position[0] < 0.5F) position[0] += 1.0F;
    return positions;
}

void add(const MorphableHead& head, std::size_t triangle, Chart& chart) {
    chart.triangles.push_back(triangle);
    const auto [a, b, c] = head.triangles[triangle];
    for (const std::int32_t vertex : {a, b, c}) chart.box.extend(point_of(head, vertex));
    const Eigen::Vector3f u = point_of(head, b) - point_of(head, a);
    chart.size += 0.5 * double(u.cross(point_of(head, c) - point_of(head, a)).norm());
}

void measure_width(const MorphableHead& head, Chart& chart) {
    for (const std::size_t triangle : chart.triangles)
        for (const auto& position : positions_of(head, chart, head.triangles[triangle]))
            chart.width_used = std::max(chart.width_used, position[0]);
}

/// For each triangle of a cylinder whether another part of the head stands before it, seen from
/// outside, as a nostril's wing before its inside: both would have the same texels.
std::vector<bool> hidden_triangles(const MorphableHead& head, const Chart& chart) {
    float radius = 1e-6F;
    const auto radius_of = [&](std::int32_t vertex) {
        const Eigen::Vector3f from = point_of(head, vertex) - chart.box.center();
        return std::hypot(from[0], from[2]);
    };
    for (const std::size_t t : chart.triangles)
        for (const std::int32_t vertex : head.triangles[t])
            radius = std::max(radius, radius_of(vertex));
    const std::int64_t count = std::ssize(chart.triangles);
    Tensor corners({3 * count, 3});
    auto rows = mutable_matrix_map<float>(corners);
    std::vector<Triangle> triangles;
    for (std::int32_t i = 0; i < count; ++i) {
        const Triangle& triangle = head.triangles[chart.triangles[static_cast<std::size_t>(i)]];
        const auto positions = positions_of(head, chart, triangle);
        for (std::int32_t k = 0; k < 3; ++k) {
            const auto corner = static_cast<std::size_t>(k);
            // Nearer where it is farther from the axis.
            const float depth = 2.0F - radius_of(triangle[corner]) / radius;
            rows.row(3 * i + k) << depth * positions[corner][0] / chart.width_used,
                depth * positions[corner][1], depth;
        }
        triangles.push_back({3 * i, 3 * i + 1, 3 * i + 2});
    }
    constexpr std::int64_t side = 1024;
    constexpr double gap = 0.004;  // of the radius
    const Camera camera{.intrinsics = {1.0, 0.0, 0.0}};
    const RasterImage drawn = rasterize(corners, corners, triangles, camera, {side, side, 1});
    std::vector<bool> hidden(static_cast<std::size_t>(count));
    for (std::int32_t i = 0; i < count; ++i) {
        const Eigen::Vector3d middle =
            rows.middleRows(3 * i, 3).colwise().mean().transpose().cast<double>();
        const Eigen::Vector3d seen = project(camera, middle);
        const auto pixel = [](double at) {
            return std::clamp(static_cast<std::int64_t>(at * side), std::int64_t{0}, side - 1);
        };
        const auto at = static_cast<std::size_t>(pixel(seen[1]) * side + pixel(seen[0]));
        const std::int32_t first = drawn.triangle[at];
        if (first < 0 || seen[2] <= double{drawn.depth.values<float>()[at]} + gap) continue;
        const Triangle& own = head.triangles[chart.triangles[static_cast<std::size_t>(i)]];
        const Triangle& other = head.triangles[chart.triangles[static_cast<std::size_t>(first)]];
        hidden[static_cast<std::size_t>(i)] = std::ranges::find_first_of(own, other) == own.end();
    }
    return hidden;
}

/// The connected pieces of what a cylinder hides. Small ones stay where they are: alone they would
/// have hardly a texel.
std::vector<Chart> hidden_pieces(const MorphableHead& head, const Chart& chart,
                                 std::vector<bool>& hidden) {
    constexpr std::size_t least_triangles = 48;
    std::vector<Triangle> triangles;
    for (std::size_t i = 0; i < hidden.size(); ++i)
        if (hidden[i]) triangles.push_back(head.triangles[chart.triangles[i]]);
    const std::vector<std::int32_t> piece = pieces_of(head.vertex_count(), triangles);
    std::map<std::int32_t, std::vector<std::size_t>> members;
    for (std::size_t i = 0; i < hidden.size(); ++i)
        if (hidden[i])
            members[piece[static_cast<std::size_t>(head.triangles[chart.triangles[i]][0])]]
                .push_back(i);
    std::vector<Chart> pieces;
    for (const auto& [key, own] : members) {
        if (own.size() >= least_triangles) pieces.emplace_back();
        for (const std::size_t i : own) {
            hidden[i] = own.size() >= least_triangles;
            if (hidden[i]) add(head, chart.triangles[i], pieces.back());
        }
    }
    return pieces;
}

HeadPart part_of(const MorphableHead& head, const Chart& chart) {
    return head.parts[static_cast<std::size_t>(head.triangles[chart.triangles[0]][0])];
}

bool is_skin(const MorphableHead& head, const Chart& chart) {
    const HeadPart part = part_of(head, chart);
    return part != HeadPart::eyes && part != HeadPart::mouth;
}

/// Gives each piece that a cylinder hides a cylinder of its own, and so on.
void split_hidden(const MorphableHead& head, std::vector<Chart>& charts) {
    constexpr int most_layers = 4;
    std::vector<Chart> split;
    for (int layer = 1; layer < most_layers; ++layer) {
        std::vector<Chart> below;
        for (Chart& chart : charts) {
            measure_width(head, chart);
            std::vector<bool> hidden(chart.triangles.size());
            // Of eyes and teeth only the outside is ever seen.
            if (is_skin(head, chart)) hidden = hidden_triangles(head, chart);
            for (Chart& piece : hidden_pieces(head, chart, hidden))
                below.push_back(std::move(piece));
            Chart& shown = split.emplace_back();
            for (std::size_t i = 0; i < hidden.size(); ++i)
                if (!hidden[i]) add(head, chart.triangles[i], shown);
        }
        charts = std::move(below);
    }
    std::ranges::move(charts, std::back_inserter(split));
    charts = std::move(split);
}

std::vector<Chart> charts_of(const MorphableHead& head) {
    // The inside of a scanned mouth is another piece than the face: both stand at the same
    // position.
    const auto count = static_cast<std::int32_t>(head.vertex_count());
    std::vector<Triangle> nodes = head.triangles;
    const auto in_mouth = [&](std::int32_t vertex) {
        return head.parts[static_cast<std::size_t>(vertex)] == HeadPart::mouth;
    };
    for (Triangle& triangle : nodes)
        if (!head.grid_uv.defined() && std::ranges::any_of(triangle, in_mouth))
            for (std::int32_t& vertex : triangle) vertex += count;
    const std::vector<std::int32_t> piece = pieces_of(2 * head.vertex_count(), nodes);
    std::map<std::int32_t, Chart> charts;
    for (std::size_t i = 0; i < nodes.size(); ++i) {
        add(head, i, charts[piece[static_cast<std::size_t>(nodes[i][0])]]);
    }
    std::vector<Chart> sorted;
    for (auto& [key, chart] : charts) sorted.push_back(std::move(chart));
    const bool is_scan = !head.grid_uv.defined();
    if (is_scan) split_hidden(head, sorted);
    for (Chart& chart : sorted) {
        const HeadPart part = part_of(head, chart);
        chart.size = std::sqrt(chart.size);
        // Small pieces of skin get more, so that filters do not mix them with their neighbours.
        constexpr double small = 0.5;
        const bool counts_twice = part == HeadPart::eyes || (is_scan && chart.size < small);
        chart.size *= part == HeadPart::mouth ? 0.4 : counts_twice ? 2.0 : 1.0;
        constexpr double least_size = 1e-9;  // of triangles without area
        chart.size = std::max(chart.size, least_size);
    }
    std::ranges::stable_sort(sorted, std::ranges::greater(), &Chart::size);
    return sorted;
}

/// The largest charts have a row of the texture each, the others share one.
void arrange(std::vector<Chart>& charts) {
    constexpr double large = 0.3, shared_height = 0.4;
    const auto is_small = [&](const Chart& chart) { return chart.size < large * charts[0].size; };
    const auto first_small = std::ranges::find_if(charts, is_small);
    double height = 0.0, width = 0.0;
    for (auto chart = charts.begin(); chart != first_small; ++chart) height += chart->size;
    for (auto chart = first_small; chart != charts.end(); ++chart) width += chart->size;
    if (width > 0.0) height += shared_height * charts[0].size;
    Eigen::Array2f corner = Eigen::Array2f::Zero();
    for (auto chart = charts.begin(); chart != charts.end(); ++chart) {
        const bool is_alone = chart < first_small;
        const double tall = is_alone ? chart->size : shared_height * charts[0].size;
        const Eigen::Array2f extent(is_alone ? 1.0F : float(chart->size / width),
                                    float(tall / height));
        // A margin on all sides, so that charts do not mix.
        const float margin = std::min(0.003F, 0.2F * extent.minCoeff());
        chart->origin = corner + margin;
        chart->extent = extent - 2.0F * margin;
        corner[is_alone ? 1 : 0] += extent[is_alone ? 1 : 0];
    }
}

}  // namespace

HeadAtlas head_atlas(const MorphableHead& head) {
    std::vector<Chart> charts = charts_of(head);
    if (charts.empty()) return {{}, Tensor({0, 2}), {}};
    for (Chart& chart : charts) measure_width(head, chart);
    arrange(charts);
    HeadAtlas atlas{{}, {}, std::vector<Triangle>(head.triangles.size())};
    std::vector<float> uv;
    for (const Chart& chart : charts) {
        std::map<std::pair<std::int32_t, bool>, std::int32_t> number;
        for (const std::size_t t : chart.triangles) {
            const std::array<Eigen::Array2f, 3> positions =
                positions_of(head, chart, head.triangles[t]);
            for (std::size_t k = 0; k < 3; ++k) {
                const std::int32_t vertex = head.triangles[t][k];
                const bool beyond = positions[k][0] > position_of(head, chart, vertex)[0];
                const auto [entry, is_new] = number.try_emplace(
                    {vertex, beyond}, static_cast<std::int32_t>(atlas.vertex.size()));
                atlas.triangles[t][k] = entry->second;
                if (!is_new) continue;
                atlas.vertex.push_back(vertex);
                const Eigen::Array2f at =
                    chart.origin + chart.extent * Eigen::Array2f(positions[k][0] / chart.width_used,
                                                                 positions[k][1]);
                uv.insert(uv.end(), at.begin(), at.end());
            }
        }
    }
    atlas.uv = Tensor::from({static_cast<std::int64_t>(atlas.vertex.size()), 2},
                            std::span<const float>(uv));
    return atlas;
}

Tensor at_atlas_vertices(const HeadAtlas& atlas, const Tensor& values) {
    Tensor result({static_cast<std::int64_t>(atlas.vertex.size()), values.shape(1)});
    auto rows = mutable_matrix_map<float>(result);
    for (std::size_t i = 0; i < atlas.vertex.size(); ++i)
        rows.row(static_cast<Eigen::Index>(i)) = matrix_map<float>(values).row(atlas.vertex[i]);
    return result;
}

}  // namespace stymo
