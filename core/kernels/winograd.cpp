// 3x3 convolutions by Winograd's minimal filtering.
//
// A 4x4 tile of outputs of a 3x3 convolution needs 16 * 9 = 144 multiplications for each pair of
// channels. The tile depends on a 6x6 patch d of the input, and can be had with 36:
//
//     Y = A^T [ (G g G^T) * (B^T d B) ] A         (* is elementwise)
//
// In one dimension this is the transpose of multiplying polynomials by evaluation at six points and
// interpolation: G evaluates the filter, B^T transposes the interpolation and acts on the data, A^T
// transposes the evaluation and acts on the products. Two dimensions apply it along columns and
// rows (Lavin and Gray 2016, F(4x4, 3x3)). Larger tiles save more multiplications but round much
// worse.
//
// Input channels are summed before the last transformation, so each of the 36 elements is a matrix
// product of its own, (tiles, in) x (in, out), and runs in the packed kernel. The transformations
// treat all channels alike, and channels are contiguous, so they work on whole vectors.
//
// Gradients use the same maps. The one of the input is a convolution with the filters turned by 180
// degrees. The one of the filter transposes the algorithm:
//
//     dL/dg = G^T [ sum over tiles of (A dL/dY A^T) * (B^T d B) ] G,
//
// which is 36 products with the tiles as the inner dimension.
//
// Rounding. Errors are smallest if the powers of the points are near 1. The points 0, 5/8, -5/8,
// 3/2, -3/2 and infinity give half the error of the usual 0, 1, -1, 2, -2 and infinity, about twice
// that of the direct convolution (`test_core "[winograd]" -s` prints both). float64, in which
// gradients are checked, uses the direct convolution.
//
// Memory. The transformed filters are four times the filters. With up to 128 x 128 channels they
// fit into the second-level cache, and each thread takes its own block of tiles through all three
// steps. With more channels each block would read the filters from memory again, so all threads
// share one larger block, and each filter is read once for it. Transformed filters are not kept
// from call to call: those of VGG-16 would take 450 MiB. Small images do not repay transforming
// them and use the direct form (`winograd_pays`).

#include <algorithm>
#include <memory>
#include <vector>

#include "core/kernels/conv_algorithms.h"
#include "core/kernels/gemm.h"
#include "core/kernels/winograd_transforms.h"
#include "core/parallel.h"

namespace stymo::kernels {

namespace {

/// Whether the transformed filters are too large for the second-level cache of one thread;
/// `channels` is the product of both numbers of channels.
constexpr bool shares_blocks(std::int64_t channels) {
    return channels > 128 * 128;
}
/// Tiles that are computed at once: few enough to stay in that cache, or so many that reading the
/// filters again is worthwhile.
constexpr std::int64_t tiles_of_block(std::int64_t channels) {
    if (shares_blocks(channels)) return 256;
    return channels > 64 * 64 ? 96 : 48;
}
/// The same for a weight's gradient, whose sums are read and written once for each block.
std::int64_t tiles_of_sum(std::int64_t in, std::int64_t out) {
    return std::clamp<std::int64_t>(in * out / 128, 48, 192);
}
/// Blocks that share their buffers; also a bound on the number of chunks.
constexpr std::int64_t runs = 16;

/// Pixels of a batch of images, cut into tiles of the outputs' side.
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

/// Pointers at a tile's square of pixels, whose first one is `padding` rows and columns outside the
/// tile; `outside` stands for what lies beyond the image.
template <class T, std::size_t pixel_count>
void point_at_square(std::array<T*, pixel_count>& pixels, T* images, T* outside, const Image& image,
                     const Tiling& tiling, std::int64_t tile, std::int64_t padding) {
    constexpr std::int64_t side = pixel_count == 36 ? winograd_patch : winograd_tile;
    const std::int64_t tile_in_image = tile % (tiling.rows * tiling.columns);
    T* const first = images + tile / (tiling.rows * tiling.columns) * image.height * image.width *
                                  image.channels;
    const std::int64_t row = tile_in_image / tiling.columns * winograd_tile - padding;
    const std::int64_t column = tile_in_image % tiling.columns * winograd_tile - padding;
    for (std::int64_t i = 0; i < side; ++i) {
        for (std::int64_t j = 0; j < side; ++j) {
            const bool inside = row + i >= 0 && row + i < image.height && column + j >= 0 &&
                                column + j < image.width;
            pixels[static_cast<std::size_t>(i * side + j)] =
                inside ? first + ((row + i) * image.width + column + j) * image.channels : outside;
        }
    }
}

using Buffer = std::unique_ptr<float[]>;

Buffer uninitialised(std::int64_t size) {
    return std::make_unique_for_overwrite<float[]>(static_cast<std::size_t>(size));
}

/// Elements of a buffer that would lie a multiple of 4 KiB apart compete for the same few lines of
/// the caches.
std::int64_t element_stride(std::int64_t tiles, std::int64_t channels) {
    return tiles * channels + 16;
}

/// Weights (out, 3, 3, in) as (in, 3, 3, out), a cache line of both at a time.
Buffer input_first(const float* weight, std::int64_t out, std::int64_t in) {
    constexpr std::int64_t line = 16;
    Buffer result = uninitialised(in * 9 * out);
    parallel_for(in / line, 1, [&](std::int64_t index, std::int64_t) {
        for (std::int64_t first_out = 0; first_out < out; first_out += line) {
            for (std::int64_t tap = 0; tap < 9; ++tap) {
                for (std::int64_t i = index * line; i < (index + 1) * line; ++i) {
                    for (std::int64_t o = first_out; o < first_out + line; ++o)
                        result[static_cast<std::size_t>((i * 9 + tap) * out + o)] =
                            weight[(o * 9 + tap) * in + i];
                }
            }
        }
    });
    return result;
}

/// Filters (from, 3, 3, to) for all elements, as right operands from one kind of channels to the
/// other.
class TransformedFilters {
public:
    TransformedFilters(const float* taps, bool turned, std::int64_t from, std::int64_t to)
        : from_(from), to_(to) {
        const std::int64_t width = PackedMatrix<float>::usual_panel_width();
        const std::int64_t panels = chunk_count(to, width);
        stride_ = element_stride(from, panels * width);
        storage_ = uninitialised(winograd_elements * stride_ + line);
        void* start = storage_.get();
        std::size_t space = line * sizeof(float) * 2;
        first_ = static_cast<float*>(std::align(line * sizeof(float), sizeof(float), start, space));
        // The last panel has columns that no filter writes.
        if (to % width != 0) std::fill_n(first_, winograd_elements * stride_, 0.0F);
        parallel_for(from, 8, [&](std::int64_t begin, std::int64_t end) {
            for (std::int64_t i = begin; i < end; ++i)
                winograd_transform_filter(taps + i * 9 * to, turned,
                                          {first_ + i * width, stride_, width, from * width}, to);
        });
    }

    [[nodiscard]] PackedMatrix<float> at(std::int64_t element) const {
        return PackedMatrix<float>::of_panels(first_ + element * stride_, from_, to_);
    }

private:
    static constexpr std::int64_t line = 16;

    std::int64_t from_, to_, stride_;
    Buffer storage_;
    float* first_;
};

/// One correlation of x with filters that are already transformed; both images may have any extent.
struct Correlation {
    const float* x;
    ConvGate<float> gate;  ///< of x
    Image in;
    const TransformedFilters* filters;
    ConvFinish<float> finish;
    float* y;
    Image out;
    std::int64_t padding;
    Tiling tiling;
};

struct TileBuffers {
    Buffer patches, products;
    std::int64_t patch_stride, product_stride;  ///< from element to element

    TileBuffers(std::int64_t tiles, std::int64_t in, std::int64_t out)
        : patches(uninitialised(winograd_elements * element_stride(tiles, in))),
          products(uninitialised(winograd_elements * element_stride(tiles, out))),
          patch_stride(element_stride(tiles, in)),
          product_stride(element_stride(tiles, out)) {}
};

/// The tiles [first, first + count), by one thread within a parallel loop and by all of them
/// otherwise.
void correlate_block(const Correlation& c, const TileBuffers& buffers, std::int64_t first,
                     std::int64_t count) {
    const std::vector<float> zeros(
        static_cast<std::size_t>(std::max(c.in.channels, c.out.channels)));
    parallel_for(count, 16, [&](std::int64_t begin, std::int64_t end) {
        PatchPixels patch;
        for (std::int64_t i = begin; i < end; ++i) {
            point_at_square(patch, c.x, zeros.data(), c.in, c.tiling, first + i, c.padding);
            float* const elements = buffers.patches.get() + i * c.in.channels;
            if (c.gate.signs == nullptr) {
                winograd_transform_patch(patch, elements, buffers.patch_stride, c.in.channels);
                continue;
            }
            PatchPixels signs;
            point_at_square(signs, c.gate.signs, zeros.data(), c.in, c.tiling, first + i,
                            c.padding);
            winograd_transform_gated_patch(patch, signs, c.gate.slope, elements,
                                           buffers.patch_stride, c.in.channels);
        }
    });
    parallel_for(winograd_elements, 1, [&](std::int64_t element, std::int64_t) {
        multiply_packed<float>(
            buffers.products.get() + element * buffers.product_stride, c.out.channels,
            {buffers.patches.get() + element * buffers.patch_stride, c.in.channels, 1}, count,
            c.filters->at(element));
    });
    parallel_for(count, 16, [&](std::int64_t begin, std::int64_t end) {
        const Buffer sink = uninitialised(c.out.channels);
        TilePixels tile;
        for (std::int64_t i = begin; i < end; ++i) {
            point_at_square(tile, c.y, sink.get(), c.out, c.tiling, first + i, 0);
            winograd_transform_products(buffers.products.get() + i * c.out.channels,
                                        buffers.product_stride,
                                        c.finish.bias == nullptr ? zeros.data() : c.finish.bias,
                                        c.finish.slope, tile, c.out.channels);
        }
    });
}

void correlate(const Correlation& c) {
    const std::int64_t channels = c.in.channels * c.out.channels;
    const std::int64_t blocks = chunk_count(c.tiling.count, tiles_of_block(channels));
    const std::int64_t block = chunk_count(c.tiling.count, blocks);
    // Filters that do not fit into a thread's cache are read once for each block, on which all
    // threads work together.
    const std::int64_t run = shares_blocks(channels) ? blocks : chunk_count(blocks, runs);
    parallel_for(blocks, run, [&](std::int64_t begin, std::int64_t end) {
        const TileBuffers buffers(std::min(block, c.tiling.count), c.in.channels, c.out.channels);
        for (std::int64_t first = begin * block; first < std::min(end * block, c.tiling.count);
             first += block)
            correlate_block(c, buffers, first, std::min(block, c.tiling.count - first));
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
    return g.kernel_height == 3 && g.kernel_width == 3 && g.stride == 1 && g.groups == 1 &&
           g.in_channels % 16 == 0 && g.out_channels % 16 == 0;
}

bool winograd_pays(const ConvGeometry& g) {
    return winograd_serves(g) && g.batch * g.out_height * g.out_width >= 1024;
}

void winograd_conv2d(const float* x, const float* weight, const ConvFinish<float>& finish, float* y,
                     const ConvGeometry& g) {
    const Buffer taps = input_first(weight, g.out_channels, g.in_channels);
    const TransformedFilters filters(taps.get(), false, g.in_channels, g.out_channels);
    correlate({x,
               {},
               input_of(g),
               &filters,
               finish,
               y,
               output_of(g),
               g.padding,
               Tiling(g.batch, g.out_height, g.out_width)});
}

void winograd_conv2d_transpose(const float* dL_dy, const ConvGate<float>& gate, const float* weight,
                               float* dL_dx, const ConvGeometry& g) {
    // The correlation with the rotated filters. The square of an input pixel begins 2 - padding
    // pixels before it.
    const TransformedFilters filters(weight, true, g.out_channels, g.in_channels);
    correlate({dL_dy,
               gate,
               output_of(g),
               &filters,
               {},
               dL_dx,
               input_of(g),
               2 - g.padding,
               Tiling(g.batch, g.in_height, g.in_width)});
}

void winograd_conv2d_weight_grad(const float* dL_dy, const float* x, float* dL_dweight,
                                 const ConvGeometry& g) {
    const Tiling tiling(g.batch, g.out_height, g.out_width);
    const Image in = input_of(g);
    const Image out = output_of(g);
    const std::int64_t block = tiles_of_sum(in.channels, out.channels);
    const std::int64_t stride_in = element_stride(block, in.channels);
    const std::int64_t stride_out = element_stride(block, out.channels);
    const std::int64_t stride_sum = element_stride(out.channels, in.channels);
    const Buffer patches = uninitialised(winograd_elements * stride_in);
    const Buffer gradients = uninitialised(winograd_elements * stride_out);
    const Buffer sums = uninitialised(winograd_elements * stride_sum);
    const std::vector<float> zeros(static_cast<std::size_t>(std::max(in.channels, out.channels)));
    for (std::int64_t first = 0; first < tiling.count; first += block) {
        const std::int64_t count = std::min(block, tiling.count - first);
        parallel_for(count, 8, [&](std::int64_t begin, std::int64_t end) {
            PatchPixels patch;
            ConstTilePixels tile;
            for (std::int64_t i = begin; i < end; ++i) {
                point_at_square(patch, x, zeros.data(), in, tiling, first + i, g.padding);
                winograd_transform_patch(patch, patches.get() + i * in.channels, stride_in,
                                         in.channels);
                point_at_square(tile, dL_dy, zeros.data(), out, tiling, first + i, 0);
                winograd_transform_tile(tile, gradients.get() + i * out.channels, stride_out,
                                        out.channels);
            }
        });
        parallel_for(winograd_elements, 1, [&](std::int64_t element, std::int64_t) {
            const PackedMatrix<float> right(patches.get() + element * stride_in, count, in.channels,
                                            in.channels, 1);
            multiply_packed<float>(sums.get() + element * stride_sum, in.channels,
                                   {gradients.get() + element * stride_out, 1, out.channels},
                                   out.channels, right, {.present_values = first > 0});
        });
    }
    parallel_for(out.channels, 16, [&](std::int64_t begin, std::int64_t end) {
        for (std::int64_t o = begin; o < end; ++o)
            winograd_transform_to_filter(sums.get() + o * in.channels, stride_sum,
                                         dL_dweight + o * 9 * in.channels, in.channels);
    });
}

}  // namespace stymo::kernels
