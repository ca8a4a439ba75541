#include "core/kernels/sine_rays.h"

#include "core/kernels/ray_run.h"
#include "core/work_counts.h"

namespace stymo::kernels {

namespace {

/// `arguments`: the face's, null where they are not kept.
template <class T>
void render_run(RayRun<T>& run, const RayExtents& extents, std::int64_t first, std::int64_t end, T* arguments, T* result) {
    const std::int64_t width = extents.width;
    const auto even = scratch<T>(extents.largest_tile() * width), odd = scratch<T>(extents.largest_tile() * width);
    const std::size_t features = extents.inputs.size() - 1;
    for (std::int64_t ray = first; ray < end; ray = run.tile().end_ray) {
        run.take(ray, end);
        work::count_field_points(run.tile().points());
        T* x = odd.get();
        for (std::size_t layer = 0; layer <= features; ++layer) {
            const T* before = x;
            if (layer == features) run.composite(before);
            x = layer % 2 == 0 ? even.get() : odd.get();
            if (arguments == nullptr) {
                run.multiply(layer, before, x, Activation::sine);
                continue;
            }
            T* const z = arguments + extents.kept_offset(layer, ray);
            run.multiply(layer, before, z, Activation::none);
            take_sines(z, x, run.tile().points() * width);
        }
        const RayTile<T>& tile = run.tile();
        for (std::int64_t at = tile.first_ray; at < tile.end_ray; ++at) {
            T* row = result + at * extents.columns();
            std::fill_n(row, extents.columns(), T(0));
            T* composited = row + extents.samples + 1;
            for (std::int64_t point = tile.begin_of(at); point < tile.end_of(at); ++point) {
                const T weight = tile.weights[static_cast<std::size_t>(point)];
                row[tile.samples[static_cast<std::size_t>(point)] - at * extents.samples] = weight;
                for (std::int64_t i = 0; i < width; ++i) composited[i] += weight * x[point * width + i];
            }
            row[extents.samples] = run.transmittances(at)[tile.end_of(at) - tile.begin_of(at)];
        }
    }
}

}  // namespace

SineRaysResult sine_rays(const RayPoints& rays, const SineNetworkOf<Tensor>& network, bool keep_arguments) {
    const RayExtents extents(rays, network);
    SineRaysResult result{Tensor({extents.faces, extents.rays, extents.columns()}, rays.deltas.dtype()), {}};
    if (keep_arguments) {
        result.arguments = Tensor({extents.faces, std::ssize(extents.inputs), extents.rays * extents.samples, extents.width},
                                  rays.deltas.dtype());
    }
    dispatch(result.value.dtype(), [&]<class T>(T) {
        T* const values = result.value.mutable_values<T>().data();
        T* const arguments = keep_arguments ? result.arguments.mutable_values<T>().data() : nullptr;
        for (std::int64_t face = 0; face < extents.faces; ++face) {
            const PackedFace<T> packed = pack<T>(network, extents, face, false);
            T* const of_face = keep_arguments ? arguments + face * extents.kept_numbers() : nullptr;
            for_each_run(extents, [&](std::int64_t first, std::int64_t end, std::int64_t) {
                RayRun<T> run(rays, packed, extents, face);
                render_run(run, extents, first, end, of_face, values + face * extents.rays * extents.columns());
            });
        }
    });
    return result;
}

}  // namespace stymo::kernels
