#include "apps/bench/report/quadrature_rules.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <queue>

#include "core/autograd/grad.h"
#include "core/ops/ops.h"
#include "core/parallel.h"
#include "render/composite.h"
#include "render/rays.h"

namespace stymo {

namespace {

using Cut = std::vector<RayInterval>;

struct CutRay {
    Cut intervals;
    std::int64_t evaluations = 0;
};

CutRays each_ray(std::span<const RayProfile> rays, const std::function<CutRay(const RayProfile&, std::size_t)>& cut) {
    std::vector<CutRay> cuts(rays.size());
    parallel_for(std::ssize(rays), 4, [&](std::int64_t begin, std::int64_t end) {
        for (auto i = static_cast<std::size_t>(begin); i < static_cast<std::size_t>(end); ++i) cuts[i] = cut(rays[i], i);
    });
    CutRays result;
    for (CutRay& one : cuts) {
        result.rays.push_back(std::move(one.intervals));
        result.evaluations += one.evaluations;
    }
    return result;
}

RayInterval interval_at(const RayProfile& ray, double place, double length) {
    return {ray.density(place), length, ray.colour(place)};
}

/// By the renderer's own sampling of a frontal camera's rays, each stretched to the length 1.
CutRays renderer_cut(std::span<const RayProfile> rays, std::int64_t evaluations, Rng* jitter) {
    RaySampling sampling;
    sampling.samples_per_ray = evaluations;
    sampling.rays_per_side = std::llround(std::ceil(std::sqrt(static_cast<double>(rays.size()))));
    const Camera camera = camera_from_pose({}, {});
    const RaySamples samples = sample_rays({camera}, sampling, jitter, DType::float64);
    const auto depths = samples.depths.values<double>(), deltas = samples.deltas.values<double>();
    const auto count = static_cast<std::size_t>(evaluations);
    return each_ray(rays, [&](const RayProfile& ray, std::size_t index) {
        const auto pixel = static_cast<std::int64_t>(index);
        const Ray line = camera_ray(camera, sampling, pixel / sampling.rays_per_side, pixel % sampling.rays_per_side);
        const double length = line.far_distance - line.near_distance;
        CutRay cut{{}, evaluations};
        for (std::size_t k = index * count; k < (index + 1) * count; ++k)
            cut.intervals.push_back(interval_at(ray, (depths[k] - line.near_distance) / length, deltas[k] / length));
        return cut;
    });
}

CutRays left_rectangle(std::span<const RayProfile> rays, std::int64_t evaluations, const Rng&) {
    return renderer_cut(rays, evaluations, nullptr);
}

CutRays jittered(std::span<const RayProfile> rays, std::int64_t evaluations, const Rng& rng) {
    Rng jitter = rng;
    return renderer_cut(rays, evaluations, &jitter);
}

/// The sum to N - 1 of the paper's equation (3): N samples from plane to plane, the last of which has no interval.
CutRays one_interval_less(std::span<const RayProfile> rays, std::int64_t evaluations, const Rng&) {
    return each_ray(rays, [=](const RayProfile& ray, std::size_t) {
        CutRay cut{{}, evaluations};
        const double length = 1.0 / static_cast<double>(evaluations - 1);
        for (std::int64_t i = 0; i + 1 < evaluations; ++i)
            cut.intervals.push_back(interval_at(ray, static_cast<double>(i) * length, length));
        return cut;
    });
}

CutRays midpoint(std::span<const RayProfile> rays, std::int64_t evaluations, const Rng&) {
    return each_ray(rays, [=](const RayProfile& ray, std::size_t) {
        CutRay cut{{}, evaluations};
        const double length = 1.0 / static_cast<double>(evaluations);
        for (std::int64_t i = 0; i < evaluations; ++i)
            cut.intervals.push_back(interval_at(ray, (static_cast<double>(i) + 0.5) * length, length));
        return cut;
    });
}

CutRays stratified(std::span<const RayProfile> rays, std::int64_t evaluations, const Rng& rng) {
    return each_ray(rays, [&](const RayProfile& ray, std::size_t index) {
        Rng own = rng.split(index);
        CutRay cut{{}, evaluations};
        const double length = 1.0 / static_cast<double>(evaluations);
        for (std::int64_t i = 0; i < evaluations; ++i)
            cut.intervals.push_back(interval_at(ray, (static_cast<double>(i) + own.uniform()) * length, length));
        return cut;
    });
}

/// A point of a ray that was evaluated.
struct Node {
    double place = 0.0;
    double density = 0.0;
    double colour = 0.0;
};

Node node_at(const RayProfile& ray, double place) {
    return {place, ray.density(place), ray.colour(place)};
}

/// With the density linear in between the optical depth is exact; the colour counts as the mean of both ends.
RayInterval between(const Node& left, const Node& right) {
    return {(left.density + right.density) / 2.0, right.place - left.place, (left.colour + right.colour) / 2.0};
}

CutRays piecewise_linear(std::span<const RayProfile> rays, std::int64_t evaluations, const Rng&) {
    return each_ray(rays, [=](const RayProfile& ray, std::size_t) {
        CutRay cut{{}, evaluations};
        Node left = node_at(ray, 0.0);
        for (std::int64_t i = 1; i < evaluations; ++i) {
            const Node right = node_at(ray, static_cast<double>(i) / static_cast<double>(evaluations - 1));
            cut.intervals.push_back(between(left, right));
            left = right;
        }
        return cut;
    });
}

/// Weights of intervals of one length, widened to their neighbours, as in mip-NeRF: the sample that meets a surface stands up to
/// an interval behind it.
std::vector<double> widened_weights(const std::vector<Node>& nodes, double length) {
    std::vector<double> weights{0.0};
    double depth = 0.0;
    for (const Node& node : nodes) {
        const double x = node.density * length;
        weights.push_back(-std::exp(-depth) * std::expm1(-x));
        depth += x;
    }
    weights.push_back(0.0);
    // So much of them is spread evenly, for what the coarse pass has not met.
    constexpr double everywhere = 0.01;
    std::vector<double> widened;
    for (std::size_t i = 1; i + 1 < weights.size(); ++i)
        widened.push_back((std::max(weights[i - 1], weights[i]) + std::max(weights[i], weights[i + 1])) / 2.0 +
                          everywhere / static_cast<double>(nodes.size()));
    return widened;
}

/// Places with equal parts of the weights between them.
std::vector<double> quantiles(const std::vector<double>& weights, std::int64_t count) {
    double total = 0.0;
    for (const double weight : weights) total += weight;
    std::vector<double> places;
    double before = 0.0;
    std::size_t bin = 0;
    for (std::int64_t i = 0; i < count; ++i) {
        const double target = total * (static_cast<double>(i) + 0.5) / static_cast<double>(count);
        while (bin + 1 < weights.size() && before + weights[bin] < target) before += weights[bin++];
        const double part = std::min((target - before) / weights[bin], 1.0);
        places.push_back((static_cast<double>(bin) + part) / static_cast<double>(weights.size()));
    }
    return places;
}

/// Half of the samples at equal steps, the others where these have found the weight; all of them in one left rectangle rule.
CutRays resampled(std::span<const RayProfile> rays, std::int64_t evaluations, const Rng&) {
    return each_ray(rays, [=](const RayProfile& ray, std::size_t) {
        const std::int64_t coarse = evaluations / 2;
        const double length = 1.0 / static_cast<double>(coarse);
        std::vector<Node> nodes;
        for (std::int64_t i = 0; i < coarse; ++i) nodes.push_back(node_at(ray, static_cast<double>(i) * length));
        for (const double place : quantiles(widened_weights(nodes, length), evaluations - coarse))
            nodes.push_back(node_at(ray, place));
        std::ranges::sort(nodes, {}, &Node::place);
        CutRay cut{{}, evaluations};
        for (std::size_t i = 0; i < nodes.size(); ++i) {
            const double end = i + 1 < nodes.size() ? nodes[i + 1].place : 1.0;
            cut.intervals.push_back({nodes[i].density, end - nodes[i].place, nodes[i].colour});
        }
        return cut;
    });
}

/// Two intervals with what the rule makes of them together and apart.
struct Panel {
    Node begin, middle, end;
    double depth = 0.0;  ///< before it, as far as known when it was made
    double error = 0.0;  ///< of colour and opacity, if it were one interval

    bool operator<(const Panel& other) const { return error < other.error; }
};

Panel make_panel(const RayProfile& ray, const Node& begin, const Node& end, double depth) {
    Panel panel{begin, node_at(ray, (begin.place + end.place) / 2.0), end, depth};
    const bool divisible = begin.place < panel.middle.place && panel.middle.place < end.place;
    if (!divisible) return panel;
    const RayInterval whole = between(begin, end), first = between(begin, panel.middle), second = between(panel.middle, end);
    const auto transparency = [](const RayInterval& part) { return std::exp(-part.density * part.length); };
    const double once = 1.0 - transparency(whole);
    const double front = 1.0 - transparency(first), behind = transparency(first) * (1.0 - transparency(second));
    panel.error = std::exp(-depth) * (std::abs(front * first.colour + behind * second.colour - once * whole.colour) +
                                      std::abs(front + behind - once));
    return panel;
}

CutRay bisected(const RayProfile& ray, std::int64_t evaluations) {
    // Half goes to equal steps: what none of them meets is never refined.
    const std::int64_t equal = std::max<std::int64_t>(evaluations / 4, 1);
    std::priority_queue<Panel> open;
    Node left = node_at(ray, 0.0);
    double depth = 0.0;
    for (std::int64_t i = 1; i <= equal; ++i) {
        const Node right = node_at(ray, static_cast<double>(i) / static_cast<double>(equal));
        const Panel panel = make_panel(ray, left, right, depth);
        for (const RayInterval& half : {between(left, panel.middle), between(panel.middle, right)})
            depth += half.density * half.length;
        open.push(panel);
        left = right;
    }
    std::int64_t used = 2 * equal + 1;
    // Smaller ones are lost in the sum.
    constexpr double negligible = 1e-16;
    for (; used + 2 <= evaluations && open.top().error > negligible; used += 2) {
        const Panel panel = open.top();
        open.pop();
        const RayInterval first = between(panel.begin, panel.middle);
        open.push(make_panel(ray, panel.begin, panel.middle, panel.depth));
        open.push(make_panel(ray, panel.middle, panel.end, panel.depth + first.density * first.length));
    }
    std::vector<Panel> panels;
    for (; !open.empty(); open.pop()) panels.push_back(open.top());
    std::ranges::sort(panels, {}, [](const Panel& panel) { return panel.begin.place; });
    CutRay cut{{}, used};
    for (const Panel& panel : panels) {
        cut.intervals.push_back(between(panel.begin, panel.middle));
        cut.intervals.push_back(between(panel.middle, panel.end));
    }
    return cut;
}

CutRays adaptive(std::span<const RayProfile> rays, std::int64_t evaluations, const Rng&) {
    return each_ray(rays, [=](const RayProfile& ray, std::size_t) { return bisected(ray, evaluations); });
}

/// One number of every interval, (1, rays, longest); rays with fewer intervals have empty ones behind.
Tensor packed(const CutRays& cut, double RayInterval::*member, DType dtype) {
    std::size_t longest = 0;
    for (const Cut& ray : cut.rays) longest = std::max(longest, ray.size());
    std::vector<double> values(cut.rays.size() * longest, 0.0);
    for (std::size_t i = 0; i < cut.rays.size(); ++i)
        for (std::size_t k = 0; k < cut.rays[i].size(); ++k) values[i * longest + k] = cut.rays[i][k].*member;
    return Tensor::from({1, std::ssize(cut.rays), static_cast<std::int64_t>(longest)}, values).to(dtype);
}

RayResults exponential(const CutRays& cut, DType dtype, bool with_gradient) {
    const Tensor lengths = packed(cut, &RayInterval::length, dtype);
    const Tensor colours = packed(cut, &RayInterval::colour, dtype);
    const std::int64_t rays = lengths.shape(1);
    const Tensor ones = Tensor::full({1, rays, 1}, 1.0, dtype);
    const Variable scale = with_gradient ? Variable::leaf(ones) : Variable(ones);
    const CompositeWeights weights = composite_weights(Variable(packed(cut, &RayInterval::density, dtype)) * scale, lengths);
    const Variable colour = composite(weights.weights, Variable(colours.reshaped({1, colours.size(), 1})));
    RayResults results{colour.value().to_vector(), weights.transmittance.value().to_vector(), {}};
    if (with_gradient) results.colour_by_log_density = grad(sum(colour), scale).value().to_vector();
    return results;
}

RayResults euler(const CutRays& cut) {
    RayResults results;
    for (const Cut& ray : cut.rays) {
        double transmittance = 1.0, transmittance_slope = 0.0, colour = 0.0, colour_slope = 0.0;
        for (const auto& [density, length, value] : ray) {
            const double x = density * length;
            colour += transmittance * x * value;
            colour_slope += (transmittance_slope + transmittance) * x * value;
            transmittance_slope = transmittance_slope * (1.0 - x) - transmittance * x;
            transmittance *= 1.0 - x;
        }
        results.colour.push_back(colour);
        results.transmittance.push_back(transmittance);
        results.colour_by_log_density.push_back(colour_slope);
    }
    return results;
}

}  // namespace

std::vector<QuadratureRule> quadrature_rules() {
    return {
        {.name = "left rectangle", .what = "equations (3) to (5) as the renderer has them: N intervals", .cut = left_rectangle},
        {.name = "left rectangle, float32",
         .what = "the same, composited in the renderer's number format",
         .cut = left_rectangle,
         .dtype = DType::float32},
        {.name = "N - 1 intervals", .what = "the sum of equation (3) as printed", .cut = one_interval_less},
        {.name = "jittered", .what = "the renderer's in training: every bound moves within its stratum", .cut = jittered},
        {.name = "stratified", .what = "one random place in each of N equal intervals", .cut = stratified},
        {.name = "midpoint", .what = "density and colour in the middle of N intervals", .cut = midpoint},
        {.name = "piecewise linear",
         .what = "density linear between N samples, its optical depth exact; colour the mean of both ends",
         .cut = piecewise_linear},
        {.name = "resampled", .what = "N / 2 samples at equal steps, N / 2 where these found weight", .cut = resampled},
        {.name = "adaptive",
         .what = "piecewise linear; the interval that bisection changes most is bisected next",
         .cut = adaptive},
        {.name = "Euler",
         .what = "explicit Euler on dT/ds = -sigma T, a warning",
         .cut = left_rectangle,
         .compositing = Compositing::euler}};
}

RayResults composited(const CutRays& cut, const QuadratureRule& rule, bool with_gradient) {
    return rule.compositing == Compositing::euler ? euler(cut) : exponential(cut, rule.dtype, with_gradient);
}

}  // namespace stymo
