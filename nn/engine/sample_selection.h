#pragma once

#include <algorithm>
#include <cstdint>
#include <span>
#include <vector>

namespace stymo {

/// Bounds and an estimate of the density at a sample, known without evaluating the field.
struct DensityBounds {
    float lower = 0.0F;
    float estimate = 0.0F;
    float upper = 0.0F;
};

/// The samples of several rays at which a field is evaluated: all of them, those that a density
/// grid finds significant (`select_samples`), or those that satisfy a predicate (`keep_if`). The
/// elements of ray r in `samples` and `gaps` begin at r * samples_per_ray; the first counts[r] are
/// in use.
struct SampleSelection {
    std::int64_t samples_per_ray = 0;
    std::vector<std::int32_t> counts;
    std::vector<std::int32_t> samples;  ///< index along the ray, ascending
    /// Estimated optical depth of the samples left out directly in front of the sample.
    std::vector<float> gaps;
    std::vector<float> tails;  ///< (rays): the same behind the last selected sample

    /// Sets the sizes and never releases memory. The contents are unspecified until the next call.
    void resize(std::int64_t rays, std::int64_t per_ray);
    /// Selects every sample of every ray.
    void keep_all();
    /// Selects samples [first, end) of this ray. The others count as empty.
    void keep_range(std::int64_t ray, std::int32_t first, std::int32_t end);
    /// Selects the samples for which keep(ray, sample) is true. The others count as empty.
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

/// Selects among consecutive samples of one ray, from number `first` on, each with an interval of
/// length `delta`, and stores them in `selection` at `ray`. Other samples of the ray count as
/// empty. The compositing weight of sample i is at most exp(-sum_{j<i} lower_j delta) (1 -
/// exp(-upper_i delta)). These bounds are summed from front to back. Where the sum reaches
/// `tolerance`, the sample is kept and the sum restarts at 0. If the bounds hold, consecutive
/// samples that are left out therefore have a total weight below `tolerance`. A tolerance of 0
/// keeps every sample.
void select_samples(std::span<const DensityBounds> bounds, std::int32_t first, float delta,
                    float tolerance, std::int64_t ray, SampleSelection& selection);

}  // namespace stymo
