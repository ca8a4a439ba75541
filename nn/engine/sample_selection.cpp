// Which samples of a ray must be evaluated?
//
// Most of a ray is empty, or hidden by the surface in front, and evaluating the field takes most of
// the time of an exact frame. A sample matters by its compositing weight
//
//     w_i = T_i (1 - exp(-sigma_i delta)),    T_i = exp(-sum_{j<i} sigma_j delta),
//
// which is known only after evaluation. From bounds lower_i <= sigma_i <= upper_i follows
//
//     w_i <= exp(-sum_{j<i} lower_j delta) (1 - exp(-upper_i delta)) = u_i.
//
// Leaving out every sample with a small u_i would not bound the error: a ray through thin haze has
// many small weights whose sum is large, and would lose all of them. Leaving out the smallest u_i
// of a ray up to a given total would bound it, but needs a sort. Instead the u_i are added up from
// front to back. Samples are left out while the sum is below the tolerance; the sample that reaches
// it is kept, and the sum starts again at 0. So each stretch that is left out has a total weight
// below the tolerance (the whole ray may have more), what is left out is spread along the ray, and
// one pass suffices.
//
// A sample that is left out does not become empty space. Its estimated optical depth (`gaps`, and
// `tails` behind the last selected sample) is added to that of the next selected sample, which so
// stands for the whole stretch with its own features (ray_tile.h). Opacity and occlusion are then
// nearly right; only the features of the stretch are those of one sample.
//
// The bounds of a density grid (nn/realtime/density_grid.h) are not guaranteed, so the error of a
// tolerance is measured (nn/realtime/chosen_tolerance.h). Fits select by the weights of an earlier
// evaluation instead and count the other samples as empty (`keep_if`;
// docs/studies/samples-of-a-fit.md).

#include "nn/engine/sample_selection.h"

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

void SampleSelection::keep_range(std::int64_t ray, std::int32_t first, std::int32_t end) {
    const auto begin = static_cast<std::size_t>(ray * samples_per_ray),
               size = static_cast<std::size_t>(end - first);
    std::iota(samples.begin() + static_cast<std::ptrdiff_t>(begin),
              samples.begin() + static_cast<std::ptrdiff_t>(begin + size), first);
    std::ranges::fill(std::span(gaps).subspan(begin, size), 0.0F);
    counts[static_cast<std::size_t>(ray)] = end - first;
    tails[static_cast<std::size_t>(ray)] = 0.0F;
}

void select_samples(std::span<const DensityBounds> bounds, std::int32_t first, float delta,
                    float tolerance, std::int64_t ray, SampleSelection& selection) {
    const std::int64_t begin = ray * selection.samples_per_ray;
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
        const auto slot = static_cast<std::size_t>(begin + count++);
        selection.samples[slot] = first + static_cast<std::int32_t>(i);
        selection.gaps[slot] = gap;
        left_out = gap = 0.0F;
    }
    selection.counts[static_cast<std::size_t>(ray)] = count;
    selection.tails[static_cast<std::size_t>(ray)] = gap;
}

}  // namespace stymo
