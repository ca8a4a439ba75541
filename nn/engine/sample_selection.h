#pragma once

#include <algorithm>
#include <cstdint>
#include <span>
#include <vector>

namespace stymo {

/// What is known of the density at a sample without asking the field.
struct DensityBounds {
    float lower = 0.0F;
    float estimate = 0.0F;
    float upper = 0.0F;
};

/// The samples of several rays that go through a field: all of them, those that a density grid
/// finds significant (`select_samples`), or those that are marked (`keep_if`). Ray r owns the
/// elements from r * samples_per_ray on, of which the first counts[r] are in use.
struct SampleSelection {
    std::int64_t samples_per_ray = 0;
    std::vector<std::int32_t> counts;
    std::vector<std::int32_t> samples;  ///< index along the ray, ascending
    std::vector<float>
        gaps;  ///< estimated optical depth of what was left out in front of the sample
    std::vector<float> tails;  ///< (rays): of what was left out behind the last one

    /// Keeps what has been allocated.
    void resize(std::int64_t rays, std::int64_t per_ray);
    /// Every sample of every ray.
    void keep_all();
    /// No sample of this ray, which has next to no opacity.
    void keep_none(std::int64_t ray);
    /// Of all samples, those for which keep(ray, sample); the others count as empty.
    template <class Keep>
    void keep_if(const Keep& keep);

    [[nodiscard]] std::span<const std::int32_t> samples_of(std::int64_t ray) const {
        return std::span(samples).subspan(
            static_cast<std::size_t>(ray * samples_per_ray),
            static_cast<std::size_t>(counts[static_cast<std::size_t>(ray)]));
    }
    [[nodiscard]] std::span<const float> gaps_of(std::int64_t ray) const {
        return std::span(gaps).subspan(
            static_cast<std::size_t>(ray * samples_per_ray),
            static_cast<std::size_t>(counts[static_cast<std::size_t>(ray)]));
    }
};

template <class Keep>
void SampleSelection::keep_if(const Keep& keep) {
    keep_all();
    for (std::size_t ray = 0; ray < counts.size(); ++ray) {
        const auto first = samples.begin() + static_cast<std::int64_t>(ray) * samples_per_ray;
        const auto end = std::remove_if(first, first + samples_per_ray, [&](std::int32_t sample) {
            return !keep(static_cast<std::int64_t>(ray), sample);
        });
        counts[ray] = static_cast<std::int32_t>(end - first);
    }
}

/// Chooses samples of one ray, with an interval of length `delta` each, and enters them into
/// `selection` at `ray`. The weight of sample i is at most exp(-sum_{j<i} lower_j delta) (1 -
/// exp(-upper_i delta)). From front to back these bounds are added up, and where the sum reaches
/// `tolerance` a sample is kept and the sum begins anew. So if the bounds hold, no samples left out
/// in a row have a weight of `tolerance` together; 0 keeps every sample.
void select_samples(std::span<const DensityBounds> bounds, float delta, float tolerance,
                    std::int64_t ray, SampleSelection& selection);

}  // namespace stymo
