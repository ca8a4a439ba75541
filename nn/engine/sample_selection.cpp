#include "nn/engine/sample_selection.h"

#include <algorithm>
#include <cmath>
#include <numeric>

namespace stymo {

void SampleSelection::resize(std::int64_t rays, std::int64_t per_ray) {
    samples_per_ray = per_ray;
    counts.resize(static_cast<std::size_t>(rays));
    tails.resize(static_cast<std::size_t>(rays));
    samples.resize(static_cast<std::size_t>(rays * per_ray));
    gaps.resize(static_cast<std::size_t>(rays * per_ray));
}

void SampleSelection::keep_all() {
    std::ranges::fill(counts, static_cast<std::int32_t>(samples_per_ray));
    std::ranges::fill(gaps, 0.0F);
    std::ranges::fill(tails, 0.0F);
    for (std::size_t first = 0; first < samples.size();
         first += static_cast<std::size_t>(samples_per_ray)) {
        const auto ray =
            std::span(samples).subspan(first, static_cast<std::size_t>(samples_per_ray));
        std::iota(ray.begin(), ray.end(), 0);
    }
}

void SampleSelection::keep_none(std::int64_t ray) {
    counts[static_cast<std::size_t>(ray)] = 0;
    tails[static_cast<std::size_t>(ray)] = 0.0F;
}

void select_samples(std::span<const DensityBounds> bounds, float delta, float tolerance,
                    std::int64_t ray, SampleSelection& selection) {
    const std::int64_t first = ray * selection.samples_per_ray;
    // For thin samples cheaper bounds replace the exponentials: 1 - exp(-x) <= x, and exp(-x) <= 1.
    constexpr float thin = 1e-2F;
    std::int32_t count = 0;
    float transmittance = 1.0F, left_out = 0.0F, gap = 0.0F;
    for (std::size_t i = 0; i < bounds.size(); ++i) {
        const float most = bounds[i].upper * delta, least = bounds[i].lower * delta;
        left_out += transmittance * (most < thin ? most : -std::expm1(-most));
        if (least >= thin) transmittance *= std::exp(-least);
        if (left_out < tolerance) {
            gap += bounds[i].estimate * delta;
            continue;
        }
        const auto slot = static_cast<std::size_t>(first + count++);
        selection.samples[slot] = static_cast<std::int32_t>(i);
        selection.gaps[slot] = gap;
        left_out = gap = 0.0F;
    }
    selection.counts[static_cast<std::size_t>(ray)] = count;
    selection.tails[static_cast<std::size_t>(ray)] = gap;
}

}  // namespace stymo
