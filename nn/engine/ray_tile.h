#pragma once

#include <cstdint>
#include <vector>

#include "nn/engine/compositing.h"
#include "nn/engine/packed_field.h"
#include "nn/engine/sample_selection.h"

namespace stymo {

/// A number of whole rays whose selected samples are evaluated together, with all buffers. It is
/// used by one thread at a time. Training, fitting and rendering differ in the samples that they
/// select and in the use that they make of the weights.
///
/// Why tiles. Layer by layer over all samples of an image, each activation would be written to
/// memory and read again, and memory would limit the speed. Sample by sample, the matrix products
/// would have one row. A tile of `tile_points` samples is in between: products are large, while the
/// activations of a tile and the weights of a layer stay in the second-level cache. Memory does not
/// grow with the number of samples.
///
/// Why whole rays. The weight of a sample depends on all samples in front of it on its ray, so a
/// divided ray would have to carry its transmittance and its composited features from tile to tile.
/// A tile of whole rays depends on no other tile, and threads can take tiles in any order.
///
/// The optical depth of a ray is summed in double and its transmittance is the exponential of that
/// sum, not a product of factors, which would accumulate their rounding (compositing.h).
///
/// The type Samples must have `append(ray, sample, points)`, which appends the 3 coordinates of a
/// sample, and `length(ray, sample)`, which returns the length of its interval.
template <class T>
struct RayTile {
    FieldTile<T> field;
    std::int64_t first_ray = 0, end_ray = 0;
    std::vector<T> points;
    std::vector<std::int64_t>
        begins;                     ///< index of each ray's first point, and the number of points
    std::vector<T> weights;         ///< compositing weight of each point
    std::vector<T> transmittances;  ///< behind each point

    [[nodiscard]] std::int64_t count() const { return begins.back(); }
    [[nodiscard]] std::int64_t begin_of(std::int64_t ray) const {
        return begins[static_cast<std::size_t>(ray - first_ray)];
    }
    [[nodiscard]] std::int64_t end_of(std::int64_t ray) const { return begin_of(ray + 1); }
    /// Transmittance behind all samples of a ray.
    [[nodiscard]] T transmittance_of(std::int64_t ray) const {
        return begin_of(ray) == end_of(ray)
                   ? T(1)
                   : transmittances[static_cast<std::size_t>(end_of(ray) - 1)];
    }

    void reserve(std::int64_t most_points, std::int64_t most_rays) {
        points.reserve(static_cast<std::size_t>(3 * most_points));
        begins.reserve(static_cast<std::size_t>(most_rays + 1));
        weights.reserve(static_cast<std::size_t>(most_points));
        transmittances.reserve(static_cast<std::size_t>(most_points));
    }

    /// Takes the selected samples of rays [first, end).
    template <class Samples>
    void take(const SampleSelection& selection, const Samples& samples, std::int64_t first,
              std::int64_t end) {
        first_ray = first;
        end_ray = end;
        points.clear();
        begins.assign(1, 0);
        for (std::int64_t ray = first; ray < end; ++ray) {
            const std::span<const std::int32_t> selected = selection.samples_of(ray);
            for (const std::int32_t sample : selected) samples.append(ray, sample, points);
            begins.push_back(begins.back() + std::ssize(selected));
        }
        weights.resize(static_cast<std::size_t>(count()));
        transmittances.resize(static_cast<std::size_t>(count()));
    }

    /// Computes weights and transmittances from the logits in `field`. The estimated optical depth
    /// of samples that the selection left out is added to the next selected sample of the ray, or
    /// to the last one if none follows.
    template <class Samples>
    void composite(const SampleSelection& selection, const Samples& samples) {
        for (std::int64_t ray = first_ray; ray < end_ray; ++ray) {
            const std::span<const std::int32_t> selected = selection.samples_of(ray);
            const std::span<const float> gaps = selection.gaps_of(ray);
            Transmittance<T> light;
            auto at = static_cast<std::size_t>(begin_of(ray));
            for (std::size_t i = 0; i < selected.size(); ++i, ++at) {
                weights[at] = light.pass(density_of_logit(field.logits[at]) *
                                             samples.length(ray, selected[i]) +
                                         static_cast<T>(gaps[i]));
                transmittances[at] = light.value();
            }
            const float tail = selection.tails[static_cast<std::size_t>(ray)];
            if (selected.empty() || tail == 0.0F) continue;
            weights[at - 1] += light.pass(static_cast<T>(tail));
            transmittances[at - 1] = light.value();
        }
    }
};

}  // namespace stymo
