#include "nn/engine/block_step.h"

#include <algorithm>

#include "core/kernels/blur_upsampled.h"
#include "nn/engine/colors.h"

namespace stymo {

namespace {

/// Channel c of sub-pixel k is the detail's output 4 c + k. With the channels of a sub-pixel side
/// by side nothing has to be shuffled afterwards.
FoldedLayer ordered_by_subpixel(const FoldedLayer& detail) {
    const std::int64_t channels = detail.weight.shape(1);
    FoldedLayer ordered{Tensor(detail.weight.shape()), Tensor(detail.bias.shape()),
                        detail.activation};
    const std::span<const float> weight = detail.weight.values<float>(),
                                 bias = detail.bias.values<float>();
    const std::span<float> to_weight = ordered.weight.mutable_values<float>(),
                           to_bias = ordered.bias.mutable_values<float>();
    for (std::int64_t c = 0; c < channels; ++c) {
        for (std::int64_t k = 0; k < 4; ++k) {
            const std::int64_t from = 4 * c + k, to = k * channels + c;
            std::copy_n(weight.data() + from * channels, channels,
                        to_weight.data() + to * channels);
            to_bias[static_cast<std::size_t>(to)] = bias[static_cast<std::size_t>(from)];
        }
    }
    return ordered;
}

}  // namespace

PackedBlock::PackedBlock(const FoldedRenderBlock& block, const FoldedLayer* mask_lateral,
                         MatmulPrecision precision_of_layers)
    : detail(ordered_by_subpixel(block.detail), precision_of_layers),
      rgb_weight(values_of<float>(block.to_rgb.weight)),
      rgb_bias(values_of<float>(block.to_rgb.bias)),
      precision(precision_of_layers) {
    if (mask_lateral != nullptr) lateral = PackedLayer<float>(*mask_lateral, precision);
    set_style(block);
}

void PackedBlock::set_style(const FoldedRenderBlock& block) {
    modulated0 = PackedLayer<float>(block.modulated0, precision);
    modulated1 = PackedLayer<float>(block.modulated1, precision);
}

namespace {

/// Bytes of a strip's detail that are kept at a time. With all buffers that depend on it, this is
/// half of the second-level cache.
constexpr std::int64_t detail_bytes = 256 << 10;

}  // namespace

std::int64_t BlockStep::detail_pixels() const {
    const std::int64_t pixel_bytes = 4 * block.in() * static_cast<std::int64_t>(sizeof(float));
    return std::max(2 * below.side, detail_bytes / pixel_bytes);
}

void BlockStep::prepare(StripBuffers& buffers) const {
    const auto mask_channels = static_cast<std::int64_t>(canvas.logit_weight.size());
    const std::int64_t pixels = batch_pixels();
    for (AlignedVector<float>& detail : buffers.detail)
        grow(detail, detail_pixels() * 4 * block.in());
    grow(buffers.detail_rows, below.side);
    grow(buffers.blurred, pixels * block.in());
    grow(buffers.hidden, pixels * block.out());
    grow(buffers.features, pixels * block.out());
    grow(buffers.lateral, above.side * mask_channels);
    grow(buffers.scratch, (below.side + 2) * std::max(colors, mask_channels));
    grow(buffers.rgb_row, above.side * colors);
    grow(buffers.mask_row, above.side * mask_channels);
}

void BlockStep::run_background(StripBuffers& buffers) const {
    const AlignedVector<float>& features = below.background.features;
    Background& background = above.background;
    block.detail.apply(buffers.detail[0].data(), features.data(), 1);
    const kernels::DetailedRow pixel{0, 1, features.data(), buffers.detail[0].data()};
    const kernels::UpsampledRow upsampled{0, 1, buffers.blurred.data()};
    kernels::blur_upsampled_rows({pixel, pixel, pixel, {upsampled, {}}, 1, block.in()});
    block.modulated0.apply(buffers.hidden.data(), buffers.blurred.data(), 1);
    background.features.resize(static_cast<std::size_t>(block.out()));
    block.modulated1.apply(background.features.data(), buffers.hidden.data(), 1);
    background.rgb.assign(colors, 0.0F);
    kernels::add_colors(background.rgb.data(), background.features.data(), block.rgb_weight.data(),
                        background.rgb.data(), 1, block.out());
    background.mask.resize(canvas.logit_weight.size());
    if (!background.mask.empty())
        block.lateral.apply(background.mask.data(), background.features.data(), 1);
}

void BlockStep::blur_rows(std::int64_t row, std::span<const float* const> detail_rows,
                          float* out) const {
    const std::int64_t channels = block.in();
    const auto detailed = [&](std::int64_t y) {
        // No pixel reads a row that is empty, so any other row may be read instead.
        if (y < 0 || y >= below.side || below.read[y].size() == 0) y = row;
        const PixelRow& pixels = below.read[y];
        return kernels::DetailedRow{pixels.begin, pixels.end,
                                    below.features.data() + pixels.offset * channels,
                                    detail_rows[static_cast<std::size_t>(y)]};
    };
    const PixelRow &upper = above.occupied[2 * row], &lower = above.occupied[2 * row + 1];
    if (upper.size() + lower.size() == 0) return;
    kernels::blur_upsampled_rows(
        {detailed(row - 1),
         detailed(row),
         detailed(row + 1),
         {kernels::UpsampledRow{upper.begin, upper.end, out},
          kernels::UpsampledRow{lower.begin, lower.end, out + upper.size() * channels}},
         below.side,
         channels});
}

void BlockStep::run(std::int64_t begin, std::int64_t end, StripBuffers& buffers) const {
    const PixelRows& pixels = above.occupied;
    const auto upsampled_size = [&](std::int64_t row) {
        return pixels[2 * row].size() + pixels[2 * row + 1].size();
    };
    const std::int64_t last_read = std::min(end + 1, below.side);
    std::int64_t read = std::max<std::int64_t>(begin - 1, 0), done = begin;
    for (std::size_t turn = 0; done < end; turn ^= 1) {
        // The rows of the previous turn, at least two, stay in the other buffer: its last row could
        // not be blurred before the next row was known, and its blur reads the row before it too.
        std::int64_t count = 0;
        const std::int64_t first_read = read;
        for (; read < last_read &&
               (read < first_read + 2 || count + below.read[read].size() <= detail_pixels());
             ++read) {
            buffers.detail_rows[static_cast<std::size_t>(read)] =
                buffers.detail[turn].data() + count * 4 * block.in();
            count += below.read[read].size();
        }
        block.detail.apply(buffers.detail[turn].data(),
                           below.features.data() + below.read[first_read].offset * block.in(),
                           count);

        const std::int64_t ready = read == last_read ? end : read - 1;
        while (done < ready) {
            const std::int64_t batch_begin = done;
            std::int64_t batch = 0;
            for (; done < ready && batch + upsampled_size(done) <= batch_pixels(); ++done) {
                blur_rows(done, buffers.detail_rows, buffers.blurred.data() + batch * block.in());
                batch += upsampled_size(done);
            }
            finish_rows(2 * batch_begin, 2 * done, buffers.blurred.data(), buffers);
        }
    }
}

void BlockStep::run_blurred(std::int64_t begin, std::int64_t end, std::span<const float> blurred,
                            StripBuffers& buffers) const {
    const PixelRows& pixels = above.occupied;
    for (std::int64_t row = 2 * begin; row < 2 * end;) {
        const std::int64_t batch_begin = row;
        std::int64_t batch = 0;
        for (; row < 2 * end && batch + pixels[row].size() <= batch_pixels(); ++row)
            batch += pixels[row].size();
        finish_rows(batch_begin, row, blurred.data() + pixels[batch_begin].offset * block.in(),
                    buffers);
    }
}

/// Computes everything after the blur for whole rows of the upsampled image.
void BlockStep::finish_rows(std::int64_t begin, std::int64_t end, const float* blurred,
                            StripBuffers& buffers) const {
    const std::int64_t offset = above.occupied[begin].offset;
    const std::int64_t count =
        above.occupied[end - 1].offset + above.occupied[end - 1].size() - offset;
    block.modulated0.apply(buffers.hidden.data(), blurred, count);
    if (last) block.modulated1.apply(buffers.features.data(), buffers.hidden.data(), count);
    for (std::int64_t y = begin; y < end; ++y) {
        const PixelRow& row = above.occupied[y];
        const std::int64_t at = (row.offset - offset) * block.out();
        float* features = last ? buffers.features.data() + at : surround_with_background(y);
        if (!last) block.modulated1.apply(features, buffers.hidden.data() + at, row.size());
        finish_rgb_row(y, features, buffers);
        if (canvas.mask.empty()) continue;
        block.lateral.apply(buffers.lateral.data(), features, row.size());
        finish_mask_row(y, buffers);
    }
}

/// Fills the pixels of row y that the next block reads but that are not computed. Returns a
/// pointer to the first computed pixel.
float* BlockStep::surround_with_background(std::int64_t y) const {
    const std::int64_t channels = block.out();
    const PixelRow &occupied = above.occupied[y], &read = above.read[y];
    float* row = above.features.data() + read.offset * channels;
    const auto fill = [&](std::int64_t from, std::int64_t to) {
        for (; from < to; ++from)
            std::copy_n(above.background.features.data(), channels,
                        row + (from - read.begin) * channels);
    };
    if (occupied.size() == 0) {
        fill(read.begin, read.end);
        return row;
    }
    fill(read.begin, occupied.begin);
    fill(occupied.end, read.end);
    return row + (occupied.begin - read.begin) * channels;
}

/// Upsamples one row of the sum over the blocks below; zero where only the background is shown.
void BlockStep::upsample_sum(float* to, const AlignedVector<float>& sum, std::int64_t row,
                             std::int64_t channels, const kernels::UpsampleFilter& filter,
                             StripBuffers& buffers) const {
    const PixelRow& shown = above.shown[row];
    if (first || shown.size() == 0) {
        std::fill_n(to, above.side * channels, 0.0F);
        return;
    }
    std::fill_n(to, shown.begin * channels, 0.0F);
    kernels::upsample_row(to + shown.begin * channels, buffers.scratch.data(), sum.data(), row,
                          shown.begin / 2, shown.end / 2, below.side, channels, filter);
    std::fill_n(to + shown.end * channels, (above.side - shown.end) * channels, 0.0F);
}

void BlockStep::finish_rgb_row(std::int64_t row, const float* features,
                               StripBuffers& buffers) const {
    const std::int64_t length = above.side * colors;
    if (last && above.shown[row].size() == 0) {
        std::copy_n(canvas.background_colors.data(), length, canvas.image.data() + row * length);
        return;
    }
    float* to = last ? buffers.rgb_row.data() : above.rgb.data() + row * length;
    upsample_sum(to, below.rgb, row, colors, kernels::smooth_upsample, buffers);
    const PixelRow &pixels = above.occupied[row], &shown = above.shown[row];
    kernels::add_colors(to + pixels.begin * colors, features, block.rgb_weight.data(),
                        above.background.rgb.data(), pixels.size(), block.out());
    if (!last) return;
    float* image = std::copy_n(canvas.background_colors.data(), shown.begin * colors,
                               canvas.image.data() + row * length);
    kernels::color_row(image, to + shown.begin * colors, canvas.background_rgb.data(),
                       shown.size() * colors);
    std::copy_n(canvas.background_colors.data(), (above.side - shown.end) * colors,
                image + shown.size() * colors);
}

void BlockStep::finish_mask_row(std::int64_t row, StripBuffers& buffers) const {
    const auto channels = static_cast<std::int64_t>(canvas.logit_weight.size());
    if (last && above.shown[row].size() == 0) {
        std::fill_n(canvas.mask.data() + row * above.side, above.side, canvas.background_mask);
        return;
    }
    float* to = last ? buffers.mask_row.data() : above.mask.data() + row * above.side * channels;
    upsample_sum(to, below.mask, row, channels, kernels::bilinear_upsample, buffers);
    const PixelRow &pixels = above.occupied[row], &shown = above.shown[row];
    kernels::add_difference(to + pixels.begin * channels, buffers.lateral.data(),
                            above.background.mask.data(), pixels.size(), channels);
    if (!last) return;
    float* mask =
        std::fill_n(canvas.mask.data() + row * above.side, shown.begin, canvas.background_mask);
    kernels::mask_row(mask, to + shown.begin * channels, canvas.logit_weight,
                      canvas.background_logit, shown.size());
    std::fill_n(mask + shown.size(), above.side - shown.end, canvas.background_mask);
}

}  // namespace stymo
