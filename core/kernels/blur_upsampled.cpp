#include "core/kernels/blur_upsampled.h"

#include <algorithm>

#include "core/kernels/targets.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "core/kernels/blur_upsampled.cpp"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

// This file is compiled once for each instruction set. Code that does not depend on it is below,
// within HWY_ONCE.
HWY_BEFORE_NAMESPACE();
namespace stymo::kernels::HWY_NAMESPACE {

namespace simd = hwy::HWY_NAMESPACE;

/// Blurs one row of the upsampled image along the columns. Columns, already summed over the rows of
/// the blur, are passed once, from left to right.
template <class D>
class BlurredRow {
public:
    using Vector = simd::Vec<D>;

    HWY_INLINE BlurredRow(const UpsampledRow& to, std::int64_t channels, std::int64_t channel)
        : to_(to), channels_(channels), channel_(channel) {}

    /// The mirrored column before an image's first column is the second one.
    HWY_INLINE void start(Vector column0, Vector column1) {
        before0_ = column0;
        before1_ = column1;
    }
    /// Adds columns x and x + 1; results up to x are then complete.
    HWY_INLINE void add(std::int64_t x, Vector column0, Vector column1) {
        put(x - 1, before0_, before1_, column0);
        put(x, before1_, column0, column1);
        before0_ = column0;
        before1_ = column1;
    }
    /// The mirrored column after an image's last column, `x`, is the last but one.
    HWY_INLINE void finish(std::int64_t x) { put(x, before0_, before1_, before0_); }

private:
    HWY_INLINE void put(std::int64_t x, Vector left, Vector at, Vector right) {
        if (x < to_.begin || x >= to_.end) return;
        const D tag;
        const auto sum = simd::MulAdd(simd::Set(tag, 2.0F), at, simd::Add(left, right));
        simd::StoreU(simd::Mul(sum, simd::Set(tag, 0.0625F)), tag,
                     to_.features + (x - to_.begin) * channels_ + channel_);
    }

    UpsampledRow to_;
    std::int64_t channels_;
    std::int64_t channel_;
    Vector before0_ = simd::Zero(D());
    Vector before1_ = simd::Zero(D());
};

/// As many channels as the vector has, from `channel` on.
template <class D>
HWY_INLINE void blur_channels(D tag, const RowUpsampling& image, std::int64_t channel) {
    const std::int64_t channels = image.channels;
    const auto& [first_row, second_row] = image.upsampled;
    const bool first_empty = first_row.begin == first_row.end,
               second_empty = second_row.begin == second_row.end;
    const std::int64_t begin = first_empty    ? second_row.begin
                               : second_empty ? first_row.begin
                                              : std::min(first_row.begin, second_row.begin);
    const std::int64_t end = std::max(first_row.end, second_row.end);
    const std::int64_t first = std::max<std::int64_t>(begin - 1, 0) / 2,
                       last = std::min(end / 2, image.side - 1);
    // Pixels outside a row's interval are read by no pixel that is stored.
    const auto stored_index = [](const DetailedRow& row, std::int64_t pixel) {
        return std::min(std::max(pixel, row.begin), row.end - 1) - row.begin;
    };
    const auto three = simd::Set(tag, 3.0F);
    BlurredRow<D> upper(first_row, channels, channel), lower(second_row, channels, channel);
    for (std::int64_t pixel = first; pixel <= last; ++pixel) {
        const std::int64_t at = pixel - image.middle.begin;
        const std::int64_t at_above = stored_index(image.above, pixel),
                           at_below = stored_index(image.below, pixel);
        const auto center =
            simd::Mul(three, simd::LoadU(tag, image.middle.features + at * channels + channel));
        const auto center_above = simd::Add(
            center, simd::LoadU(tag, image.above.features + at_above * channels + channel));
        const auto center_below = simd::Add(
            center, simd::LoadU(tag, image.below.features + at_below * channels + channel));
        const float* detail = image.middle.detail + at * 4 * channels + channel;
        const float* detail_above = image.above.detail + (at_above * 4 + 2) * channels + channel;
        const float* detail_below = image.below.detail + at_below * 4 * channels + channel;
        simd::Vec<D> columns_above[2], columns_below[2];
        for (int j = 0; j < 2; ++j) {
            const auto upper_half = simd::LoadU(tag, detail + j * channels),
                       lower_half = simd::LoadU(tag, detail + (2 + j) * channels);
            const auto both = simd::Add(upper_half, lower_half);
            columns_above[j] =
                simd::Add(simd::Add(both, upper_half),
                          simd::Add(center_above, simd::LoadU(tag, detail_above + j * channels)));
            columns_below[j] =
                simd::Add(simd::Add(both, lower_half),
                          simd::Add(center_below, simd::LoadU(tag, detail_below + j * channels)));
        }
        if (pixel == 0) {
            upper.start(columns_above[0], columns_above[1]);
            lower.start(columns_below[0], columns_below[1]);
        }
        upper.add(2 * pixel, columns_above[0], columns_above[1]);
        lower.add(2 * pixel, columns_below[0], columns_below[1]);
    }
    if (last == image.side - 1) {
        upper.finish(2 * image.side - 1);
        lower.finish(2 * image.side - 1);
    }
}

void blur(const RowUpsampling& image) {
    const simd::ScalableTag<float> tag;
    const auto lanes = static_cast<std::int64_t>(simd::Lanes(tag));
    std::int64_t channel = 0;
    for (; channel + lanes <= image.channels; channel += lanes) blur_channels(tag, image, channel);
    for (; channel < image.channels; ++channel)
        blur_channels(simd::CappedTag<float, 1>(), image, channel);
}

/// Weights of the gradients before and after an upsampled pixel's own gradient, whose weight is 2.
/// Because the border is mirrored, the first pixel contributes twice to the second one, and the
/// last pixel to the last but one.
struct BlurWeights {
    float before;
    float after;
};

HWY_INLINE BlurWeights transposed_blur(std::int64_t at, std::int64_t length) {
    return {at == 0 ? 0.0F : (at == 1 ? 2.0F : 1.0F),
            at == length - 1 ? 0.0F : (at == length - 2 ? 2.0F : 1.0F)};
}

/// As many channels as the vector has, from `channel` on.
template <class D>
HWY_INLINE void differentiate_channels(D tag, const UpsamplingGradient& g, std::int64_t channel) {
    using Vector = simd::Vec<D>;
    struct Weights {
        Vector before;
        Vector after;
    };
    const auto weights_at = [&](std::int64_t at, std::int64_t length) HWY_ATTR {
        const BlurWeights w = transposed_blur(at, length);
        return Weights{simd::Set(tag, w.before), simd::Set(tag, w.after)};
    };
    const auto weighted = [&](const Weights& w, Vector before, Vector at, Vector after) HWY_ATTR {
        return simd::MulAdd(w.before, before, simd::MulAdd(w.after, after, simd::Add(at, at)));
    };
    const std::int64_t columns = 2 * g.width, rows = 2 * g.height;
    const float* row[4];
    for (std::int64_t i = 0; i < 4; ++i) {
        const std::int64_t y = std::clamp<std::int64_t>(2 * g.row - 1 + i, 0, rows - 1);
        row[i] = g.dL_dy + y * columns * g.channels + channel;
    }
    const Weights vertical[2] = {weights_at(2 * g.row, rows), weights_at(2 * g.row + 1, rows)};
    struct Column {
        Vector upper;
        Vector lower;
    };
    const auto column_at = [&](std::int64_t x) HWY_ATTR {
        Vector y[4];
        for (int i = 0; i < 4; ++i) y[i] = simd::LoadU(tag, row[i] + x * g.channels);
        return Column{weighted(vertical[0], y[0], y[1], y[2]),
                      weighted(vertical[1], y[1], y[2], y[3])};
    };
    const Vector scale = simd::Set(tag, 0.0625F);
    Column before = column_at(0), left = before;
    for (std::int64_t x = 0; x < g.width; ++x) {
        const Weights at_left = weights_at(2 * x, columns),
                      at_right = weights_at(2 * x + 1, columns);
        const Column right = column_at(2 * x + 1),
                     next = column_at(std::min(2 * x + 2, columns - 1));
        const Vector detail[4] = {
            simd::Mul(scale, weighted(at_left, before.upper, left.upper, right.upper)),
            simd::Mul(scale, weighted(at_right, left.upper, right.upper, next.upper)),
            simd::Mul(scale, weighted(at_left, before.lower, left.lower, right.lower)),
            simd::Mul(scale, weighted(at_right, left.lower, right.lower, next.lower))};
        for (int k = 0; k < 4; ++k)
            simd::StoreU(detail[k], tag, g.dL_ddetail + (4 * x + k) * g.channels + channel);
        simd::StoreU(simd::Add(simd::Add(detail[0], detail[1]), simd::Add(detail[2], detail[3])),
                     tag, g.dL_dfeatures + x * g.channels + channel);
        before = right;
        left = next;
    }
}

void differentiate_row(const UpsamplingGradient& gradient) {
    const simd::ScalableTag<float> tag;
    const auto lanes = static_cast<std::int64_t>(simd::Lanes(tag));
    std::int64_t channel = 0;
    for (; channel + lanes <= gradient.channels; channel += lanes)
        differentiate_channels(tag, gradient, channel);
    for (; channel < gradient.channels; ++channel)
        differentiate_channels(simd::CappedTag<float, 1>(), gradient, channel);
}

}  // namespace stymo::kernels::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace stymo::kernels {

HWY_EXPORT(blur);
HWY_EXPORT(differentiate_row);

void blur_upsampled_rows(const RowUpsampling& rows) {
    HWY_DYNAMIC_DISPATCH(blur)(rows);
}

void differentiate_blur_upsampled_row(const UpsamplingGradient& gradient) {
    HWY_DYNAMIC_DISPATCH(differentiate_row)(gradient);
}

}  // namespace stymo::kernels
#endif
