#include "nn/engine/rays_of_face.h"
#include "nn/engine/render_field_passes.h"

namespace stymo {

namespace {

/// `arguments`: those of this face, or null if they are not kept.
template <class T>
void render_run(const PackedField<T>& field, const FaceSamples<T>& samples,
                const RayExtents& extents, std::int64_t first, std::int64_t end, T* arguments,
                T* result) {
    RayTile<T> tile;
    for_each_tile(samples, extents, first, end, tile, [&] {
        SineArgumentRows<T> kept;
        if (arguments != nullptr) {
            kept = {arguments + tile.first_ray * extents.samples * extents.width,
                    extents.layer_arguments()};
        }
        field.evaluate(tile.points, tile.field, kept);
        tile.composite(samples.selection, samples);
        field.features(tile.count(), tile.field, kept);
        for (std::int64_t ray = tile.first_ray; ray < tile.end_ray; ++ray) {
            T* row = result + ray * extents.columns();
            std::fill_n(row, extents.columns(), T(0));
            const T* features = tile.field.features.data() + tile.begin_of(ray) * extents.width;
            auto at = static_cast<std::size_t>(tile.begin_of(ray));
            for (const std::int32_t sample : samples.selection.samples_of(ray)) {
                row[sample] = tile.weights[at];
                add_weighted(row + extents.samples + 1, tile.weights[at], features, extents.width);
                features += extents.width;
                ++at;
            }
            row[extents.samples] = tile.transmittance_of(ray);
        }
    });
}

}  // namespace

FieldPassResult render_field_forward(const RayPoints& rays, const SineNetworkOf<Tensor>& network,
                                     bool keep_arguments) {
    const RayExtents extents(rays, network);
    FieldPassResult result{
        Tensor({extents.faces, extents.rays, extents.columns()}, rays.deltas.dtype()), {}};
    if (keep_arguments) {
        result.arguments =
            Tensor({extents.faces, extents.layers, extents.rays * extents.samples, extents.width},
                   rays.deltas.dtype());
    }
    dispatch(result.value.dtype(), [&]<class T>(T) {
        T* const values = result.value.mutable_values<T>().data();
        T* const arguments = keep_arguments ? result.arguments.mutable_values<T>().data() : nullptr;
        for (std::int64_t face = 0; face < extents.faces; ++face) {
            const PackedField<T> field(folded(network, face));
            const FaceSamples<T> samples(rays, extents, face);
            for_each_run(extents, [&](std::int64_t first, std::int64_t end, std::int64_t) {
                render_run(field, samples, extents, first, end,
                           keep_arguments ? arguments + face * extents.face_arguments() : nullptr,
                           values + face * extents.rays * extents.columns());
            });
        }
    });
    return result;
}

}  // namespace stymo
