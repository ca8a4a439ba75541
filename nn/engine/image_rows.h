#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

namespace stymo {

/// The interval [begin, end) of pixels in one row of an image. `offset` is the number of pixels in
/// the intervals of all rows before it, that is, the index of its first pixel in packed storage.
struct PixelRow {
    std::int64_t begin = 0;
    std::int64_t end = 0;
    std::int64_t offset = 0;

    [[nodiscard]] std::int64_t size() const { return end - begin; }
};

/// A set of pixels of a square image: one interval in each row.
class PixelRows {
public:
    /// Makes `side` empty rows.
    void reset(std::int64_t side);
    /// Sets the smallest intervals that hold all non-zero elements of `pixels` (side, side).
    void set_nonzero(std::span<const std::uint8_t> pixels);
    /// Sets the pixels of the image of twice the side whose value depends on pixels of `rows`
    /// through the learnt upsampling with its blur.
    void set_reached(const PixelRows& rows);
    /// Sets the pixels that the learnt upsampling reads to compute the pixels of
    /// `set_reached(rows)`: the pixels of `rows` and their neighbours.
    void set_read(const PixelRows& rows);
    /// Sets the union of `rows` and of the pixels that depend on `below` through the linear
    /// upsampling of RGB and mask. Each interval begins and ends at an even pixel.
    void set_upsampled(const PixelRows& below, const PixelRows& rows);

    [[nodiscard]] std::int64_t side() const { return static_cast<std::int64_t>(rows_.size()); }
    [[nodiscard]] std::int64_t pixels() const { return pixels_; }
    [[nodiscard]] const PixelRow& operator[](std::int64_t row) const {
        return rows_[static_cast<std::size_t>(row)];
    }

private:
    void set(std::int64_t row, std::int64_t begin, std::int64_t end);

    std::vector<PixelRow> rows_;
    std::int64_t pixels_ = 0;
};

}  // namespace stymo

/// Operations on rows of the images and masks that are summed over the render blocks. All functions
/// run on the calling thread.
namespace stymo::kernels {

/// A linear upsampling with the same weights on both axes and clamped edges. `even` has the weights
/// of the pixels before, at and after m for pixel 2 m of the upsampled axis; mirrored, they belong
/// to pixel 2 m + 1. `first` has the weights of the first pixel and, mirrored, of the last one.
struct UpsampleFilter {
    std::array<float, 3> even;
    std::array<float, 3> first;
};
inline constexpr UpsampleFilter bilinear_upsample{{0.25F, 0.75F, 0.0F}, {0.0F, 1.0F, 0.0F}};
/// Bilinear, then [1,2,1]/4 with mirrored border (reference: upsample_smoothly).
inline constexpr UpsampleFilter smooth_upsample{{0.3125F, 0.625F, 0.0625F}, {0.0F, 0.875F, 0.125F}};

/// Upsamples columns [begin, end) of an image (side, side, channels) for row `row` of the upsampled
/// image -> out (2 (end - begin), channels). `scratch` has room for (end - begin + 2) * channels
/// numbers.
void upsample_row(float* out, float* scratch, const float* image, std::int64_t row,
                  std::int64_t begin, std::int64_t end, std::int64_t side, std::int64_t channels,
                  const UpsampleFilter& filter);

/// to (pixels, channels) += x - background (channels)
void add_difference(float* to, const float* x, const float* background, std::int64_t pixels,
                    std::int64_t channels);

/// Final colours in [0, 1]: out = (1 + tanh(x + background)) / 2, with an error of about 1e-7. Not
/// a number where the sum is not finite; so is the mask.
void color_row(float* out, const float* x, const float* background, std::int64_t count);
/// Final mask in [0, 1] of x (pixels, channels): out = sigmoid(x . weight + bias), with an error of
/// about 1e-7.
void mask_row(float* out, const float* x, std::span<const float> weight, float bias,
              std::int64_t pixels);

}  // namespace stymo::kernels
