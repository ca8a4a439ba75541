#pragma once

#include <algorithm>
#include <cstdint>
#include <vector>

#include "core/parallel.h"
#include "nn/engine/packed_field.h"

namespace stymo {

/// Evaluates a field at `count` points, tile by tile on several threads. position_of(i) returns a
/// range of 3 coordinates. Calls store(first, size, tile) for each tile, on any thread. The tile
/// holds the logits of points [first, first + size). `store` may compute the features of these
/// points with PackedField::features.
template <class T, class PositionOf, class Store>
void evaluate_points(const PackedField<T>& field, std::int64_t count, const PositionOf& position_of,
                     const Store& store) {
    constexpr std::int64_t points_per_chunk = 4 * tile_points;
    parallel_for(count, points_per_chunk, [&](std::int64_t chunk_begin, std::int64_t chunk_end) {
        FieldTile<T> tile;
        std::vector<T> points;
        for (std::int64_t begin = chunk_begin; begin < chunk_end; begin += tile_points) {
            const std::int64_t end = std::min(begin + tile_points, chunk_end);
            points.clear();
            for (std::int64_t i = begin; i < end; ++i) {
                for (const auto coordinate : position_of(i))
                    points.push_back(static_cast<T>(coordinate));
            }
            field.evaluate(points, tile);
            store(begin, end - begin, tile);
        }
    });
}

}  // namespace stymo
