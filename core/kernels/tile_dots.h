#pragma once

#include "core/kernels/tile_product.h"

namespace stymo::kernels {

/// Whether blocks of tiles are multiplied by the dot products of AVX512-BF16, which every processor
/// with AVX512-BF16 and without AMX does.
[[nodiscard]] bool multiplies_dots();

/// `multiply_tiles` by those instructions, for one part. Leaves the other rows of the block's
/// tiles undefined.
void multiply_tile_dots(int column_tiles, const TileBlock& block);

}  // namespace stymo::kernels
