#include "core/kernels/winograd.h"

#include <algorithm>
#include <memory>
#include <vector>

#include "core/kernels/gemm.h"
#include "core/kernels/winograd_transforms.h"
#include "core/parallel.h"

namespace stymo::kernels {

namespace {

/// Tiles that one thread handles at once, in whole blocks of a product's rows. Where the filters fit beside them into the
/// second-level cache, few enough to stay there; else so many that the filters are worth reading again.
std::int64_t tiles_of_block(std::int64_t in, std::int64_t out) {
    return in * out <= 64 * 64 ? 48 : 96;
}
/// The same for a weight's gradient, whose sums are read and written once for each block.
std::int64_t tiles_of_sum(std::int64_t in, std::int64_t out) {
    return std::clamp<std::int64_t>(in * out / 128, 48, 192);
}
/// Blocks that share their buffers; also a bound on the number of chunks.
constexpr std::int64_t runs = 16;

/// Pixels of a batch of images, cut into tiles of the outputs' side; `offset` is the row and column of the first pixel of the
/// first tile's square, which may lie outside the image.
struct Tiling {
    std::int64_t rows, columns, count;

    Tiling(std::int64_t batch, std::int64_t out_height, std::int64_t out_width)
        : rows(chunk_count(out_height, winograd_tile)),
          columns(chunk_count(out_width, winograd_tile)),
          count(batch * rows * columns) {}
};

struct Image {
    std::int64_t height, width, channels;
};

/// Pointers at a tile's square of pixels, whose first one is `padding` rows and columns outside the tile; `outside` stands for
/// what lies beyond the image.
template <class T, std::size_t places>
void point_at_square(std::array<T*, places>& pixels, T* images, T* outside, const Image& image, const Tiling& tiling,
                     std::int64_t tile, std::int64_t padding) {
    constexpr std::int64_t side = places == 36 ? winograd_patch : winograd_tile;
    const std::int64_t tile_in_image = tile % (tiling.rows * tiling.columns);
    T* const first = images + tile / (tiling.rows * tiling.columns) * image.height * image.width * image.channels;
    const std::int64_t row = tile_in_image / tiling.columns * winograd_tile - padding;
    const std::int64_t column = tile_in_image % tiling.columns * winograd_tile - padding;
    for (std::int64_t i = 0; i < side; ++i) {
        for (std::int64_t j = 0; j < side; ++j) {
            const bool inside = row + i >= 0 && row + i < image.height && column + j >= 0 && column + j < image.width;
            pixels[static_cast<std::size_t>(i * side + j)] =
                inside ? first + ((row + i) * image.width + column + j) * image.channels : outside;
        }
    }
}

using Buffer = std::unique_ptr<float[]>;

Buffer uninitialised(std::int64_t size) {
    return std::make_unique_for_overwrite<float[]>(static_cast<std::size_t>(size));
}

/// Places of a buffer that would lie a multiple of 4 KiB apart compete for the same few lines of the caches.
std::int64_t place_stride(std::int64_t tiles, std::int64_t channels) {
    return tiles * channels + 16;
}

/// The filters (out, 3, 3, in) at all places, as right operands: from input to output channels, or, turned by 180 degrees, back.
std::vector<PackedMatrix<float>> transformed_filters(const float* weight, std::int64_t out, std::int64_t in, bool back) {
    const std::int64_t stride = place_stride(out, in);
    const Buffer places = uninitialised(winograd_places * stride);
    parallel_for(out, 16, [&](std::int64_t begin, std::int64_t end) {
        for (std::int64_t o = begin; o < end; ++o)
            winograd_transform_filter(weight + o * 9 * in, back, places.get() + o * in, stride, in);
    });
    std::vector<PackedMatrix<float>> filters(static_cast<std::size_t>(winograd_places));
    parallel_for(winograd_places, 1, [&](std::int64_t place, std::int64_t) {
        const float* matrix = places.get() + place * stride;
        filters[static_cast<std::size_t>(place)] =
            back ? PackedMatrix<float>(matrix, out, in, in, 1) : PackedMatrix<float>(matrix, in, out, 1, in);
    });
    return filters;
}

/// y = correlation of x with filters that are already transformed, both with any extent.
void convolve(const float* x, const Image& in, const std::vector<PackedMatrix<float>>& filters, const ConvFinish<float>& finish,
              float* y, const Image& out, std::int64_t batch, std::int64_t padding) {
    const Tiling tiling(batch, out.height, out.width);
    const std::int64_t block = tiles_of_block(in.channels, out.channels);
    const std::int64_t blocks = chunk_count(tiling.count, block);
    const std::vector<float> zeros(static_cast<std::size_t>(std::max(in.channels, out.channels)));
    const float* const bias = finish.bias == nullptr ? zeros.data() : finish.bias;
    parallel_for(blocks, chunk_count(blocks, runs), [&](std::int64_t first_block, std::int64_t last_block) {
        const std::int64_t stride_in = place_stride(block, in.channels);
        const std::int64_t stride_out = place_stride(block, out.channels);
        const Buffer patches = uninitialised(winograd_places * stride_in);
        const Buffer products = uninitialised(winograd_places * stride_out);
        const Buffer sink = uninitialised(out.channels);
        for (std::int64_t first = first_block * block; first < std::min(last_block * block, tiling.count); first += block) {
            const std::int64_t count = std::min(block, tiling.count - first);
            PatchPixels patch;
            for (std::int64_t i = 0; i < count; ++i) {
                point_at_square(patch, x, zeros.data(), in, tiling, first + i, padding);
                winograd_transform_patch(patch, patches.get() + i * in.channels, stride_in, in.channels);
            }
            for (std::int64_t place = 0; place < winograd_places; ++place) {
                multiply_packed<float>(products.get() + place * stride_out, out.channels,
                                       {patches.get() + place * stride_in, in.channels, 1}, count,
                                       filters[static_cast<std::size_t>(place)]);
            }
            TilePixels tile;
            for (std::int64_t i = 0; i < count; ++i) {
                point_at_square(tile, y, sink.get(), out, tiling, first + i, 0);
                winograd_transform_products(products.get() + i * out.channels, stride_out, bias, finish.slope, tile,
                                            out.channels);
            }
        }
    });
}

Image input_of(const ConvGeometry& g) {
    return {g.in_height, g.in_width, g.in_channels};
}
Image output_of(const ConvGeometry& g) {
    return {g.out_height, g.out_width, g.out_channels};
}

}  // namespace

bool winograd_serves(const ConvGeometry& g) {
    return g.kernel_height == 3 && g.kernel_width == 3 && g.stride == 1 && g.groups == 1 && g.in_channels % 16 == 0 &&
           g.out_channels % 16 == 0;
}

bool winograd_pays(const ConvGeometry& g) {
    return winograd_serves(g) && g.batch * g.out_height * g.out_width >= 1024;
}

void winograd_conv2d(const float* x, const float* weight, const ConvFinish<float>& finish, float* y, const ConvGeometry& g) {
    const auto filters = transformed_filters(weight, g.out_channels, g.in_channels, false);
    convolve(x, input_of(g), filters, finish, y, output_of(g), g.batch, g.padding);
}

void winograd_conv2d_transpose(const float* dL_dy, const float* weight, float* dL_dx, const ConvGeometry& g) {
    // The correlation with the turned filters, whose square begins two pixels before an input pixel less the padding.
    const auto filters = transformed_filters(weight, g.out_channels, g.in_channels, true);
    convolve(dL_dy, output_of(g), filters, {}, dL_dx, input_of(g), g.batch, 2 - g.padding);
}

void winograd_conv2d_weight_grad(const float* dL_dy, const float* x, float* dL_dweight, const ConvGeometry& g) {
    const Tiling tiling(g.batch, g.out_height, g.out_width);
    const Image in = input_of(g);
    const Image out = output_of(g);
    const std::int64_t block = tiles_of_sum(in.channels, out.channels);
    const std::int64_t stride_in = place_stride(block, in.channels);
    const std::int64_t stride_out = place_stride(block, out.channels);
    const std::int64_t stride_sum = place_stride(out.channels, in.channels);
    const Buffer patches = uninitialised(winograd_places * stride_in);
    const Buffer gradients = uninitialised(winograd_places * stride_out);
    const Buffer sums = uninitialised(winograd_places * stride_sum);
    const std::vector<float> zeros(static_cast<std::size_t>(std::max(in.channels, out.channels)));
    for (std::int64_t first = 0; first < tiling.count; first += block) {
        const std::int64_t count = std::min(block, tiling.count - first);
        parallel_for(count, 8, [&](std::int64_t begin, std::int64_t end) {
            PatchPixels patch;
            ConstTilePixels tile;
            for (std::int64_t i = begin; i < end; ++i) {
                point_at_square(patch, x, zeros.data(), in, tiling, first + i, g.padding);
                winograd_transform_patch(patch, patches.get() + i * in.channels, stride_in, in.channels);
                point_at_square(tile, dL_dy, zeros.data(), out, tiling, first + i, 0);
                winograd_transform_tile(tile, gradients.get() + i * out.channels, stride_out, out.channels);
            }
        });
        parallel_for(winograd_places, 1, [&](std::int64_t place, std::int64_t) {
            const PackedMatrix<float> right(patches.get() + place * stride_in, count, in.channels, in.channels, 1);
            multiply_packed<float>(sums.get() + place * stride_sum, in.channels,
                                   {gradients.get() + place * stride_out, 1, out.channels}, out.channels, right,
                                   {.present_values = first > 0});
        });
    }
    parallel_for(out.channels, 16, [&](std::int64_t begin, std::int64_t end) {
        for (std::int64_t o = begin; o < end; ++o) {
            winograd_transform_to_filter(sums.get() + o * in.channels, stride_sum, dL_dweight + o * 9 * in.channels, in.channels);
        }
    });
}

}  // namespace stymo::kernels
