#include "core/kernels/winograd_transforms.h"

#include "core/kernels/targets.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "core/kernels/winograd_transforms.cpp"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

// This file is compiled once for each instruction set. Code that does not depend on it is below,
// within HWY_ONCE.
HWY_BEFORE_NAMESPACE();
namespace stymo::kernels::HWY_NAMESPACE {

namespace simd = hwy::HWY_NAMESPACE;

using Tag = simd::CappedTag<float, 16>;
using Vector = simd::Vec<Tag>;

/// The interpolation points are 0, a, -a, b, -b and infinity. Rounding errors are smallest if their
/// powers are near one.
constexpr float a = 0.625F;
constexpr float b = 1.5F;
constexpr float a2 = a * a;
constexpr float b2 = b * b;

HWY_INLINE Vector times(Vector x, float factor) {
    return simd::Mul(x, simd::Set(Tag(), factor));
}
/// x + factor * y
HWY_INLINE Vector plus(Vector x, float factor, Vector y) {
    return simd::MulAdd(simd::Set(Tag(), factor), y, x);
}

/// B^T: the coefficients of the polynomials that vanish at all points but one.
struct PatchLine {
    static constexpr int from = 6;
    static constexpr int to = 6;
    HWY_INLINE void operator()(const Vector (&d)[6], Vector (&t)[6]) const {
        t[0] = plus(plus(d[4], -(a2 + b2), d[2]), a2 * b2, d[0]);
        t[5] = plus(plus(d[5], -(a2 + b2), d[3]), a2 * b2, d[1]);
        const Vector even_a = plus(d[4], -b2, d[2]);
        const Vector odd_a = times(plus(d[3], -b2, d[1]), a);
        t[1] = simd::Add(even_a, odd_a);
        t[2] = simd::Sub(even_a, odd_a);
        const Vector even_b = plus(d[4], -a2, d[2]);
        const Vector odd_b = times(plus(d[3], -a2, d[1]), b);
        t[3] = simd::Add(even_b, odd_b);
        t[4] = simd::Sub(even_b, odd_b);
    }
};

/// A^T: the powers of the points.
struct ProductLine {
    static constexpr int from = 6;
    static constexpr int to = 4;
    HWY_INLINE void operator()(const Vector (&m)[6], Vector (&y)[4]) const {
        const Vector even_a = simd::Add(m[1], m[2]);
        const Vector odd_a = simd::Sub(m[1], m[2]);
        const Vector even_b = simd::Add(m[3], m[4]);
        const Vector odd_b = simd::Sub(m[3], m[4]);
        y[0] = simd::Add(m[0], simd::Add(even_a, even_b));
        y[1] = plus(times(odd_a, a), b, odd_b);
        y[2] = plus(times(even_a, a2), b2, even_b);
        y[3] = plus(plus(m[5], a2 * a, odd_a), b2 * b, odd_b);
    }
};

/// A
struct TileLine {
    static constexpr int from = 4;
    static constexpr int to = 6;
    HWY_INLINE void operator()(const Vector (&g)[4], Vector (&m)[6]) const {
        m[0] = g[0];
        m[5] = g[3];
        const Vector even_a = plus(g[0], a2, g[2]);
        const Vector odd_a = plus(times(g[1], a), a2 * a, g[3]);
        m[1] = simd::Add(even_a, odd_a);
        m[2] = simd::Sub(even_a, odd_a);
        const Vector even_b = plus(g[0], b2, g[2]);
        const Vector odd_b = plus(times(g[1], b), b2 * b, g[3]);
        m[3] = simd::Add(even_b, odd_b);
        m[4] = simd::Sub(even_b, odd_b);
    }
};

/// Reciprocals of the polynomials at their own finite points.
constexpr float scale_0 = 1.0F / (a2 * b2);
constexpr float scale_a = 1.0F / (2.0F * a2 * (a2 - b2));
constexpr float scale_b = 1.0F / (2.0F * b2 * (b2 - a2));

/// G
struct FilterLine {
    static constexpr int from = 3;
    static constexpr int to = 6;
    HWY_INLINE void operator()(const Vector (&w)[3], Vector (&u)[6]) const {
        u[0] = times(w[0], scale_0);
        u[5] = w[2];
        const Vector even_a = times(plus(w[0], a2, w[2]), scale_a);
        const Vector odd_a = times(w[1], a * scale_a);
        u[1] = simd::Add(even_a, odd_a);
        u[2] = simd::Sub(even_a, odd_a);
        const Vector even_b = times(plus(w[0], b2, w[2]), scale_b);
        const Vector odd_b = times(w[1], b * scale_b);
        u[3] = simd::Add(even_b, odd_b);
        u[4] = simd::Sub(even_b, odd_b);
    }
};

/// G^T
struct FilterGradientLine {
    static constexpr int from = 6;
    static constexpr int to = 3;
    HWY_INLINE void operator()(const Vector (&m)[6], Vector (&w)[3]) const {
        const Vector even_a = times(simd::Add(m[1], m[2]), scale_a);
        const Vector odd_a = times(simd::Sub(m[1], m[2]), a * scale_a);
        const Vector even_b = times(simd::Add(m[3], m[4]), scale_b);
        const Vector odd_b = times(simd::Sub(m[3], m[4]), b * scale_b);
        w[0] = plus(simd::Add(even_a, even_b), scale_0, m[0]);
        w[1] = simd::Add(odd_a, odd_b);
        w[2] = plus(plus(m[5], a2, even_a), b2, even_b);
    }
};

/// Applies a line's map to the columns and then to the rows of the square that `load(row, column,
/// channel)` reads.
template <class Line, class Load, class Store>
HWY_INLINE void transform(std::int64_t channels, Load load, Store store) {
    const Line line;
    const auto lanes = static_cast<std::int64_t>(simd::Lanes(Tag()));
    for (std::int64_t c = 0; c < channels; c += lanes) {
        Vector middle[Line::to][Line::from];
        HWY_UNROLL(6)
        for (int column = 0; column < Line::from; ++column) {
            Vector in[Line::from];
            Vector out[Line::to];
            for (int row = 0; row < Line::from; ++row) in[row] = load(row, column, c);
            line(in, out);
            for (int row = 0; row < Line::to; ++row) middle[row][column] = out[row];
        }
        HWY_UNROLL(6)
        for (int row = 0; row < Line::to; ++row) {
            Vector out[Line::to];
            line(middle[row], out);
            for (int column = 0; column < Line::to; ++column) store(row, column, c, out[column]);
        }
    }
}

void transform_patch(const PatchPixels& patch, float* elements, std::int64_t element_stride,
                     std::int64_t channels) {
    transform<PatchLine>(
        channels,
        [&](int row, int column, std::int64_t c) {
            return simd::LoadU(Tag(), patch[static_cast<std::size_t>(row * 6 + column)] + c);
        },
        [&](int row, int column, std::int64_t c, Vector v) {
            simd::StoreU(v, Tag(), elements + (row * 6 + column) * element_stride + c);
        });
}

void transform_gated_patch(const PatchPixels& patch, const PatchPixels& signs, float slope,
                           float* elements, std::int64_t element_stride, std::int64_t channels) {
    transform<PatchLine>(
        channels,
        [&](int row, int column, std::int64_t c) {
            const auto pixel = static_cast<std::size_t>(row * 6 + column);
            const Vector value = simd::LoadU(Tag(), patch[pixel] + c);
            const auto positive = simd::Gt(simd::LoadU(Tag(), signs[pixel] + c), simd::Zero(Tag()));
            return simd::IfThenElse(positive, value, times(value, slope));
        },
        [&](int row, int column, std::int64_t c, Vector v) {
            simd::StoreU(v, Tag(), elements + (row * 6 + column) * element_stride + c);
        });
}

void transform_products(const float* elements, std::int64_t element_stride, const float* bias,
                        float slope, const TilePixels& tile, std::int64_t channels) {
    transform<ProductLine>(
        channels,
        [&](int row, int column, std::int64_t c) {
            return simd::LoadU(Tag(), elements + (row * 6 + column) * element_stride + c);
        },
        [&](int row, int column, std::int64_t c, Vector v) {
            const Vector sum = simd::Add(v, simd::LoadU(Tag(), bias + c));
            const Vector zero = simd::Zero(Tag());
            const Vector negative = slope == 0.0F ? zero : times(sum, slope);
            const Vector result = simd::IfThenElse(simd::Lt(sum, zero), negative, sum);
            simd::StoreU(result, Tag(), tile[static_cast<std::size_t>(row * 4 + column)] + c);
        });
}

void transform_tile(const ConstTilePixels& tile, float* elements, std::int64_t element_stride,
                    std::int64_t channels) {
    transform<TileLine>(
        channels,
        [&](int row, int column, std::int64_t c) {
            return simd::LoadU(Tag(), tile[static_cast<std::size_t>(row * 4 + column)] + c);
        },
        [&](int row, int column, std::int64_t c, Vector v) {
            simd::StoreU(v, Tag(), elements + (row * 6 + column) * element_stride + c);
        });
}

void transform_filter(const float* taps, bool turned, const PanelRows& rows,
                      std::int64_t channels) {
    transform<FilterLine>(
        channels,
        [&](int row, int column, std::int64_t c) {
            const int tap = row * 3 + column;
            return simd::LoadU(Tag(), taps + (turned ? 8 - tap : tap) * channels + c);
        },
        [&](int row, int column, std::int64_t c, Vector v) {
            simd::StoreU(v, Tag(),
                         rows.first + (row * 6 + column) * rows.element_stride +
                             c / rows.panel_width * rows.panel_stride + c % rows.panel_width);
        });
}

void transform_to_filter(const float* elements, std::int64_t element_stride, float* taps,
                         std::int64_t channels) {
    transform<FilterGradientLine>(
        channels,
        [&](int row, int column, std::int64_t c) {
            return simd::LoadU(Tag(), elements + (row * 6 + column) * element_stride + c);
        },
        [&](int row, int column, std::int64_t c, Vector v) {
            simd::StoreU(v, Tag(), taps + (row * 3 + column) * channels + c);
        });
}

}  // namespace stymo::kernels::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace stymo::kernels {

HWY_EXPORT(transform_patch);
HWY_EXPORT(transform_gated_patch);
HWY_EXPORT(transform_products);
HWY_EXPORT(transform_tile);
HWY_EXPORT(transform_filter);
HWY_EXPORT(transform_to_filter);

void winograd_transform_patch(const PatchPixels& patch, float* elements,
                              std::int64_t element_stride, std::int64_t channels) {
    HWY_DYNAMIC_DISPATCH(transform_patch)(patch, elements, element_stride, channels);
}

void winograd_transform_gated_patch(const PatchPixels& patch, const PatchPixels& signs, float slope,
                                    float* elements, std::int64_t element_stride,
                                    std::int64_t channels) {
    HWY_DYNAMIC_DISPATCH(transform_gated_patch)
    (patch, signs, slope, elements, element_stride, channels);
}

void winograd_transform_products(const float* elements, std::int64_t element_stride,
                                 const float* bias, float slope, const TilePixels& tile,
                                 std::int64_t channels) {
    HWY_DYNAMIC_DISPATCH(transform_products)(elements, element_stride, bias, slope, tile, channels);
}

void winograd_transform_tile(const ConstTilePixels& tile, float* elements,
                             std::int64_t element_stride, std::int64_t channels) {
    HWY_DYNAMIC_DISPATCH(transform_tile)(tile, elements, element_stride, channels);
}

void winograd_transform_filter(const float* taps, bool turned, const PanelRows& rows,
                               std::int64_t channels) {
    HWY_DYNAMIC_DISPATCH(transform_filter)(taps, turned, rows, channels);
}

void winograd_transform_to_filter(const float* elements, std::int64_t element_stride, float* taps,
                                  std::int64_t channels) {
    HWY_DYNAMIC_DISPATCH(transform_to_filter)(elements, element_stride, taps, channels);
}

}  // namespace stymo::kernels
#endif
