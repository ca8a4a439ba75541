#include "nn/models/realtime/sample_selection.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

namespace stymo {
namespace {

/// Largest bound such that all bounds up to it sum to no more than `tolerance`; -1 if none.
float largest_left_out(std::span<const float> weights, float tolerance, std::vector<float>& sorted) {
    sorted.assign(weights.begin(), weights.end());
    std::ranges::sort(sorted);
    float sum = 0.0F, largest = -1.0F;
    for (std::size_t i = 0; i < sorted.size(); ++i) {
        sum += sorted[i];
        if (sum > tolerance) break;
        // Equal bounds are left out together or not at all.
        if (i + 1 == sorted.size() || sorted[i + 1] > sorted[i]) largest = sorted[i];
    }
    return largest;
}

}  // namespace

void SampleSelection::resize(std::int64_t rays, std::int64_t per_ray) {
    samples_per_ray = per_ray;
    counts.resize(static_cast<std::size_t>(rays));
    samples.resize(static_cast<std::size_t>(rays * per_ray));
    gaps.resize(static_cast<std::size_t>(rays * per_ray));
}

void SampleSelection::keep_all() {
    std::ranges::fill(counts, static_cast<std::int32_t>(samples_per_ray));
    std::ranges::fill(gaps, 0.0F);
    for (std::size_t first = 0; first < samples.size(); first += static_cast<std::size_t>(samples_per_ray)) {
        const auto ray = std::span(samples).subspan(first, static_cast<std::size_t>(samples_per_ray));
        std::iota(ray.begin(), ray.end(), 0);
    }
}

void select_samples(std::span<const DensityBounds> bounds, float delta, float tolerance, std::int64_t ray,
                    SelectionScratch& scratch, SampleSelection& selection) {
    std::vector<float>& weights = scratch.weights;
    weights.resize(bounds.size());
    float transmittance = 1.0F, total = 0.0F;
    for (std::size_t i = 0; i < bounds.size(); ++i) {
        weights[i] = -transmittance * std::expm1(-bounds[i].upper * delta);
        total += weights[i];
        if (bounds[i].lower > 0.0F) transmittance *= std::exp(-bounds[i].lower * delta);
    }
    std::int32_t& count = selection.counts[static_cast<std::size_t>(ray)];
    count = 0;
    if (total <= tolerance) return;

    const float largest = largest_left_out(weights, tolerance, scratch.sorted);
    const std::int64_t first = ray * selection.samples_per_ray;
    float gap = 0.0F;
    for (std::size_t i = 0; i < bounds.size(); ++i) {
        if (weights[i] <= largest) {
            gap += bounds[i].estimate * delta;
            continue;
        }
        const auto slot = static_cast<std::size_t>(first + count++);
        selection.samples[slot] = static_cast<std::int32_t>(i);
        selection.gaps[slot] = gap;
        gap = 0.0F;
    }
}

}  // namespace stymo
