#pragma once

#include <array>
#include <cstdint>

/// The learnt upsampling of an image, row by row, on the calling thread. The instruction set is
/// chosen at run time.
namespace stymo::kernels {

/// Pixels [begin, end) of one row of an image that is to be upsampled.
struct DetailedRow {
    std::int64_t begin = 0;
    std::int64_t end = 0;
    const float* features = nullptr;  ///< (pixels, channels)
    /// (pixels, 4, channels). Index 2 i + j belongs to row i, column j of the upsampled pixel.
    const float* detail = nullptr;
};

/// Pixels [begin, end) of one row of the upsampled image: (pixels, channels).
struct UpsampledRow {
    std::int64_t begin = 0;
    std::int64_t end = 0;
    float* features = nullptr;
};

/// A row of an image of `side` columns, its neighbouring rows (the row itself at the image's
/// border), and the two upsampled rows that it gives.
struct RowUpsampling {
    DetailedRow above;
    DetailedRow middle;
    DetailedRow below;
    std::array<UpsampledRow, 2> upsampled;
    std::int64_t side = 0;
    std::int64_t channels = 0;
};

/// The learnt upsampling (reference: Upsampler), blur(detail + nearest neighbour), of one row. A
/// pixel of the first upsampled row reads its own column and the neighbouring columns of `above`
/// and `middle`; a pixel of the second row reads those of `middle` and `below`.
void blur_upsampled_rows(const RowUpsampling& rows);

/// The gradient of an upsampled image (2 height, 2 width, channels), and the destination of row
/// `row` of the gradients of the features and the detail.
struct UpsamplingGradient {
    const float* dL_dy = nullptr;
    float* dL_dfeatures = nullptr;  ///< (width, channels)
    float* dL_ddetail = nullptr;    ///< (width, 4, channels), like DetailedRow::detail
    std::int64_t row = 0;
    std::int64_t height = 0;
    std::int64_t width = 0;
    std::int64_t channels = 0;
};

/// The adjoint of `blur_upsampled_rows`, for one row.
void differentiate_blur_upsampled_row(const UpsamplingGradient& gradient);

}  // namespace stymo::kernels
