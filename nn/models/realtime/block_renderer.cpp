#include "nn/models/realtime/block_renderer.h"

#include <algorithm>
#include <array>
#include <mutex>
#include <utility>
#include <vector>

#include "core/error.h"
#include "core/kernels/doubling.h"
#include "core/parallel.h"
#include "nn/models/realtime/packed_layer.h"
#include "nn/models/realtime/pixel_rows.h"

namespace stymo {
namespace {

/// What a strip keeps of the detail at once: with all that follows from it, half of the second-level cache.
constexpr std::int64_t detail_bytes = 256 << 10;
/// Rows of a strip, in pixels before doubling. Neighbouring strips both compute the detail of two rows between them.
constexpr std::int64_t strip_rows = 32;
constexpr std::int64_t colors = 3;

/// Channel c of sub-pixel k is the detail's output 4 c + k; the packed layer has it at k * channels + c, so that what is
/// contiguous before the shuffle is contiguous after it.
FoldedLayer ordered_by_subpixel(const FoldedLayer& detail) {
    const std::int64_t channels = detail.weight.shape(1);
    FoldedLayer ordered{Tensor(detail.weight.shape()), Tensor(detail.bias.shape()), detail.activation};
    const std::span<const float> weight = detail.weight.values<float>(), bias = detail.bias.values<float>();
    const std::span<float> to_weight = ordered.weight.mutable_values<float>(), to_bias = ordered.bias.mutable_values<float>();
    for (std::int64_t c = 0; c < channels; ++c) {
        for (std::int64_t k = 0; k < 4; ++k) {
            const std::int64_t from = 4 * c + k, to = k * channels + c;
            std::copy_n(weight.data() + from * channels, channels, to_weight.data() + to * channels);
            to_bias[static_cast<std::size_t>(to)] = bias[static_cast<std::size_t>(from)];
        }
    }
    return ordered;
}

template <class T>
void grow(std::vector<T>& buffer, std::int64_t size) {
    if (static_cast<std::int64_t>(buffer.size()) < size) buffer.resize(static_cast<std::size_t>(size));
}

template <class T>
struct PackedBlock {
    PackedLayer<T> detail;
    PackedLayer<T> modulated0;
    PackedLayer<T> modulated1;
    PackedLayer<T> to_rgb;
    PackedLayer<T> lateral;  ///< empty without a mask

    [[nodiscard]] std::int64_t in() const { return modulated0.inputs(); }
    [[nodiscard]] std::int64_t out() const { return modulated1.outputs(); }
};

/// What all pixels have that only empty rays reach.
template <class T>
struct Background {
    std::vector<T> features;
    std::vector<float> rgb;   ///< of this level's block alone
    std::vector<float> mask;  ///< the same of the lateral
};

/// An image between two blocks, or before the first (without RGB and mask). RGB and mask are sums over the blocks so far, as
/// differences from the background's.
template <class T>
struct Level {
    std::int64_t side = 0;
    PixelRows occupied;       ///< what empty rays alone do not decide
    PixelRows read;           ///< what the next block reads
    std::vector<T> features;  ///< of `read`
    std::vector<float> rgb;   ///< (side, side, 3)
    std::vector<float> mask;  ///< (side, side, mask channels)
    Background<T> background;
};

/// What one thread needs for a strip.
template <class T>
struct StripBuffers {
    std::array<std::vector<T>, 2> detail;
    std::vector<const T*> detail_rows;
    std::vector<T> blurred;
    std::vector<T> hidden;
    std::vector<T> features;
    std::vector<float> rgb;
    std::vector<float> lateral;
    std::vector<float> scratch;
    std::vector<float> rgb_row;
    std::vector<float> mask_row;
};

/// Hands out buffers, the ones used last first.
template <class Buffers>
class BufferPool {
public:
    [[nodiscard]] std::unique_ptr<Buffers> take() {
        const std::scoped_lock lock(mutex_);
        if (free_.empty()) return std::make_unique<Buffers>();
        std::unique_ptr<Buffers> buffers = std::move(free_.back());
        free_.pop_back();
        return buffers;
    }
    void give_back(std::unique_ptr<Buffers> buffers) {
        const std::scoped_lock lock(mutex_);
        free_.push_back(std::move(buffers));
    }
    [[nodiscard]] bool empty() const { return free_.empty(); }

private:
    std::mutex mutex_;
    std::vector<std::unique_ptr<Buffers>> free_;
};

}  // namespace

struct BlockRenderer::State {
    virtual ~State() = default;
    virtual void set_style(std::span<const FoldedRenderBlock> blocks) = 0;
    virtual void set_feature_map(std::span<const float> feature_map, std::span<const std::uint8_t> occupied) = 0;
    virtual void render(std::span<float> picture, std::span<float> mask) = 0;

    BlockCounts counts;
};

template <class T>
struct BlockRenderer::TypedState final : State {
    TypedState(std::span<const FoldedRenderBlock> folded, const std::optional<FoldedMaskBranch>& mask,
               std::int64_t rays_per_side);
    void set_style(std::span<const FoldedRenderBlock> folded) override;
    void set_feature_map(std::span<const float> feature_map, std::span<const std::uint8_t> occupied) override;
    void render(std::span<float> picture, std::span<float> mask) override;

private:
    struct Strip {
        std::size_t block;
        std::int64_t first;  ///< rows before doubling
        std::int64_t end;
    };
    void find_pixels();
    void cut_strips();
    void compute_backgrounds();
    void keep_first_doubling();
    void finish_kept_strip(const Strip& strip, StripBuffers<T>& buffers);
    void compute_strip(const Strip& strip, StripBuffers<T>& buffers);
    void prepare(StripBuffers<T>& buffers) const;
    void finish_rows(std::size_t block, std::int64_t first, std::int64_t end, const T* blurred, StripBuffers<T>& buffers);
    void blur_row(std::size_t block, std::int64_t row, std::span<const T* const> detail_rows, T* out, float* scratch) const;
    void store_features(Level<T>& level, std::int64_t first, std::int64_t end, const T* features) const;
    void finish_rgb_row(std::size_t block, std::int64_t row, const float* rgb, StripBuffers<T>& buffers);
    void finish_mask_row(std::size_t block, std::int64_t row, const float* lateral, StripBuffers<T>& buffers);
    [[nodiscard]] std::int64_t detail_pixels(std::size_t block) const;
    [[nodiscard]] std::int64_t batch_pixels(std::size_t block) const;

    std::vector<PackedBlock<T>> blocks_;
    std::vector<float> logit_weight_;  ///< empty without a mask branch
    float logit_bias_ = 0.0F;
    std::vector<Level<T>> levels_;  ///< before each block, and after the last
    std::vector<std::vector<Strip>> strips_;
    bool backgrounds_known_ = false;
    bool first_doubling_kept_ = false;
    std::vector<T> first_detail_;
    std::vector<T> first_blurred_;       ///< of the pixels that levels_[1] has occupied
    std::vector<float> background_rgb_;  ///< a row of the picture
    float background_logit_ = 0.0F;
    std::span<float> picture_;
    std::span<float> mask_;
    BufferPool<StripBuffers<T>> buffers_;
};

template <class T>
BlockRenderer::TypedState<T>::TypedState(std::span<const FoldedRenderBlock> folded, const std::optional<FoldedMaskBranch>& mask,
                                         std::int64_t rays_per_side)
    : blocks_(folded.size()), levels_(folded.size() + 1), strips_(folded.size()) {
    for (std::size_t i = 0; i < folded.size(); ++i) {
        blocks_[i].detail = PackedLayer<T>(ordered_by_subpixel(folded[i].detail));
        blocks_[i].to_rgb = PackedLayer<T>(folded[i].to_rgb);
        if (mask) blocks_[i].lateral = PackedLayer<T>(mask->laterals[i]);
    }
    if (mask) {
        logit_weight_.assign(mask->logit.weight.values<float>().begin(), mask->logit.weight.values<float>().end());
        logit_bias_ = mask->logit.bias.values<float>()[0];
    }
    for (std::size_t i = 0; i < levels_.size(); ++i) {
        levels_[i].side = rays_per_side << i;
        levels_[i].occupied.reset(levels_[i].side);
        if (i > 0) counts.pixels += levels_[i].side * levels_[i].side;
    }
    set_style(folded);
}

template <class T>
void BlockRenderer::TypedState<T>::set_style(std::span<const FoldedRenderBlock> folded) {
    if (folded.size() < blocks_.size())
        fail<ShapeError>("render blocks: style for ", folded.size(), " blocks, expected ", blocks_.size());
    for (std::size_t i = 0; i < blocks_.size(); ++i) {
        blocks_[i].modulated0 = PackedLayer<T>(folded[i].modulated0);
        blocks_[i].modulated1 = PackedLayer<T>(folded[i].modulated1);
    }
    backgrounds_known_ = false;
}

template <class T>
void BlockRenderer::TypedState<T>::set_feature_map(std::span<const float> feature_map, std::span<const std::uint8_t> occupied) {
    const std::int64_t side = levels_[0].side, channels = blocks_[0].in();
    if (std::ssize(feature_map) != side * side * channels || std::ssize(occupied) != side * side) {
        fail<ShapeError>("render blocks: expected ", side * side, " rays of ", channels, " features, got ", occupied.size(),
                         " rays and ", feature_map.size(), " features");
    }
    levels_[0].occupied.set_nonzero(occupied);
    find_pixels();
    cut_strips();

    Level<T>& level = levels_[0];
    grow(level.features, level.read.pixels() * channels);
    for (std::int64_t y = 0; y < side; ++y) {
        const PixelRow& row = level.read[y];
        kernels::narrow(level.features.data() + row.offset * channels, feature_map.data() + (y * side + row.begin) * channels,
                        row.size() * channels);
    }
    // Where no ray is empty, nothing shows the background, and any will do.
    const auto empty = std::ranges::find(occupied, 0) - occupied.begin();
    const std::int64_t ray = empty < side * side ? empty : 0;
    level.background.features.resize(static_cast<std::size_t>(channels));
    kernels::narrow(level.background.features.data(), feature_map.data() + ray * channels, channels);
    backgrounds_known_ = false;
    first_doubling_kept_ = false;
}

template <class T>
void BlockRenderer::TypedState<T>::find_pixels() {
    counts.pixels_computed = 0;
    for (std::size_t i = 0; i < blocks_.size(); ++i) {
        levels_[i].read.set_read(levels_[i].occupied);
        levels_[i + 1].occupied.set_reached(levels_[i].occupied);
        counts.pixels_computed += levels_[i + 1].occupied.pixels();
    }
}

/// Strips of a block do the same work each, as far as whole rows allow.
template <class T>
void BlockRenderer::TypedState<T>::cut_strips() {
    for (std::size_t i = 0; i < blocks_.size(); ++i) {
        const PixelRows& pixels = levels_[i + 1].occupied;
        const std::int64_t side = levels_[i].side, count = std::max<std::int64_t>(2, side / strip_rows);
        // Pixels of the background are added up and doubled as well, for about a sixteenth of the work.
        const auto work = [&](std::int64_t row) { return 16 * (pixels[2 * row].size() + pixels[2 * row + 1].size()) + 4 * side; };
        const std::int64_t all = 16 * pixels.pixels() + 4 * side * side;
        strips_[i].clear();
        std::int64_t first = 0, done = 0;
        for (std::int64_t row = 0; row < side; ++row) {
            done += work(row);
            const auto cut = static_cast<std::int64_t>(strips_[i].size()) + 1;
            if (row + 1 < side && done * count < cut * all) continue;
            strips_[i].push_back({i, first, row + 1});
            first = row + 1;
        }
    }
}

/// A background is a picture of one pixel.
template <class T>
void BlockRenderer::TypedState<T>::compute_backgrounds() {
    std::array<float, colors> rgb_sum{};
    background_logit_ = logit_bias_;
    std::unique_ptr<StripBuffers<T>> buffers = buffers_.take();
    for (std::size_t i = 0; i < blocks_.size(); ++i) {
        const PackedBlock<T>& block = blocks_[i];
        const std::vector<T>& below = levels_[i].background.features;
        Background<T>& background = levels_[i + 1].background;
        prepare(*buffers);
        block.detail.apply(buffers->detail[0].data(), below.data(), 1);
        const kernels::DetailedRow<T> pixel{0, below.data(), buffers->detail[0].data()};
        kernels::blur_doubled_row(buffers->blurred.data(), buffers->scratch.data(), pixel, pixel, 0, 0, 1, 1, block.in());
        block.modulated0.apply(buffers->hidden.data(), buffers->blurred.data(), 1);
        background.features.resize(static_cast<std::size_t>(block.out()));
        block.modulated1.apply(background.features.data(), buffers->hidden.data(), 1);
        background.rgb.resize(colors);
        block.to_rgb.apply(background.rgb.data(), background.features.data(), 1);
        for (std::size_t c = 0; c < colors; ++c) rgb_sum[c] += background.rgb[c];
        if (logit_weight_.empty()) continue;
        background.mask.resize(logit_weight_.size());
        block.lateral.apply(background.mask.data(), background.features.data(), 1);
        for (std::size_t c = 0; c < logit_weight_.size(); ++c) background_logit_ += logit_weight_[c] * background.mask[c];
    }
    buffers_.give_back(std::move(buffers));
    background_rgb_.resize(static_cast<std::size_t>(colors * levels_.back().side));
    for (std::size_t i = 0; i < background_rgb_.size(); ++i) background_rgb_[i] = rgb_sum[i % colors];
    backgrounds_known_ = true;
}

template <class T>
std::int64_t BlockRenderer::TypedState<T>::detail_pixels(std::size_t block) const {
    const std::int64_t pixel_bytes = 4 * blocks_[block].in() * static_cast<std::int64_t>(sizeof(T));
    return std::max(levels_[block].side, detail_bytes / pixel_bytes);
}

template <class T>
std::int64_t BlockRenderer::TypedState<T>::batch_pixels(std::size_t block) const {
    return 4 * detail_pixels(block);
}

template <class T>
void BlockRenderer::TypedState<T>::prepare(StripBuffers<T>& buffers) const {
    const auto mask_channels = static_cast<std::int64_t>(logit_weight_.size());
    for (std::size_t i = 0; i < blocks_.size(); ++i) {
        const PackedBlock<T>& block = blocks_[i];
        const std::int64_t side = levels_[i].side, pixels = batch_pixels(i);
        for (std::vector<T>& detail : buffers.detail) grow(detail, detail_pixels(i) * 4 * block.in());
        grow(buffers.detail_rows, side);
        grow(buffers.blurred, pixels * block.in());
        grow(buffers.hidden, pixels * block.out());
        grow(buffers.features, pixels * block.out());
        grow(buffers.rgb, pixels * colors);
        grow(buffers.lateral, pixels * mask_channels);
        grow(buffers.scratch, std::max((2 * side + 2) * block.in(), (3 * side + 2) * std::max(colors, mask_channels)));
        grow(buffers.rgb_row, 2 * side * colors);
        grow(buffers.mask_row, 2 * side * mask_channels);
    }
}

template <class T>
void BlockRenderer::TypedState<T>::blur_row(std::size_t block, std::int64_t row, std::span<const T* const> detail_rows, T* out,
                                            float* scratch) const {
    const Level<T>& below = levels_[block];
    const std::int64_t channels = blocks_[block].in();
    const PixelRow& pixels = levels_[block + 1].occupied[row];
    const auto detailed = [&](std::int64_t y) {
        return kernels::DetailedRow<T>{below.read[y].begin, below.features.data() + below.read[y].offset * channels,
                                       detail_rows[static_cast<std::size_t>(y)]};
    };
    const std::int64_t middle = row / 2;
    const std::int64_t near = std::clamp<std::int64_t>(row % 2 == 0 ? middle - 1 : middle + 1, 0, below.side - 1);
    kernels::blur_doubled_row(out, scratch, detailed(middle), detailed(near), row, pixels.begin, pixels.end, below.side,
                              channels);
}

/// The part of the first block that knows no style, for the whole image.
template <class T>
void BlockRenderer::TypedState<T>::keep_first_doubling() {
    constexpr std::int64_t pixels_at_once = 60, rows_at_once = 4;
    const PackedBlock<T>& block = blocks_[0];
    grow(first_detail_, levels_[0].read.pixels() * 4 * block.in());
    grow(first_blurred_, levels_[1].occupied.pixels() * block.in());
    parallel_for(levels_[0].read.pixels(), pixels_at_once, [this](std::int64_t begin, std::int64_t end) {
        const std::int64_t channels = blocks_[0].in();
        blocks_[0].detail.apply(first_detail_.data() + begin * 4 * channels, levels_[0].features.data() + begin * channels,
                                end - begin);
    });
    parallel_for(levels_[1].side, rows_at_once, [this](std::int64_t begin, std::int64_t end) {
        std::unique_ptr<StripBuffers<T>> buffers = buffers_.take();
        prepare(*buffers);
        const std::int64_t channels = blocks_[0].in();
        for (std::int64_t row = 0; row < levels_[0].side; ++row) {
            buffers->detail_rows[static_cast<std::size_t>(row)] =
                first_detail_.data() + levels_[0].read[row].offset * 4 * channels;
        }
        for (std::int64_t row = begin; row < end; ++row) {
            T* out = first_blurred_.data() + levels_[1].occupied[row].offset * channels;
            blur_row(0, row, buffers->detail_rows, out, buffers->scratch.data());
        }
        buffers_.give_back(std::move(buffers));
    });
    first_doubling_kept_ = true;
}

template <class T>
void BlockRenderer::TypedState<T>::compute_strip(const Strip& strip, StripBuffers<T>& buffers) {
    const std::size_t index = strip.block;
    const PackedBlock<T>& block = blocks_[index];
    const Level<T>& below = levels_[index];
    const PixelRows& pixels = levels_[index + 1].occupied;
    const std::int64_t last_read = std::min(strip.end + 1, below.side);
    std::int64_t read = std::max<std::int64_t>(strip.first - 1, 0), done = 2 * strip.first;
    for (std::size_t turn = 0; done < 2 * strip.end; turn ^= 1) {
        // The rows of the last turn stay: the first row of this one lies beside the last of them.
        std::int64_t count = 0;
        const std::int64_t first = read;
        for (; read < last_read && (read == first || count + below.read[read].size() <= detail_pixels(index)); ++read) {
            buffers.detail_rows[static_cast<std::size_t>(read)] = buffers.detail[turn].data() + count * 4 * block.in();
            count += below.read[read].size();
        }
        block.detail.apply(buffers.detail[turn].data(), below.features.data() + below.read[first].offset * block.in(), count);

        const std::int64_t ready = read == last_read ? 2 * strip.end : 2 * read - 1;
        while (done < ready) {
            const std::int64_t batch_first = done;
            std::int64_t batch = 0;
            for (; done < ready && batch + pixels[done].size() <= batch_pixels(index); ++done) {
                blur_row(index, done, buffers.detail_rows, buffers.blurred.data() + batch * block.in(), buffers.scratch.data());
                batch += pixels[done].size();
            }
            finish_rows(index, batch_first, done, buffers.blurred.data(), buffers);
        }
    }
}

template <class T>
void BlockRenderer::TypedState<T>::finish_kept_strip(const Strip& strip, StripBuffers<T>& buffers) {
    const PixelRows& pixels = levels_[1].occupied;
    for (std::int64_t row = 2 * strip.first; row < 2 * strip.end;) {
        const std::int64_t first = row;
        std::int64_t batch = 0;
        for (; row < 2 * strip.end && batch + pixels[row].size() <= batch_pixels(0); ++row) batch += pixels[row].size();
        finish_rows(0, first, row, first_blurred_.data() + pixels[first].offset * blocks_[0].in(), buffers);
    }
}

/// Everything after the blur, for whole rows of the doubled image.
template <class T>
void BlockRenderer::TypedState<T>::finish_rows(std::size_t index, std::int64_t first, std::int64_t end, const T* blurred,
                                               StripBuffers<T>& buffers) {
    const PackedBlock<T>& block = blocks_[index];
    Level<T>& level = levels_[index + 1];
    const std::int64_t offset = level.occupied[first].offset;
    const std::int64_t count = level.occupied[end - 1].offset + level.occupied[end - 1].size() - offset;
    block.modulated0.apply(buffers.hidden.data(), blurred, count);
    block.modulated1.apply(buffers.features.data(), buffers.hidden.data(), count);
    block.to_rgb.apply(buffers.rgb.data(), buffers.features.data(), count);
    if (!mask_.empty()) block.lateral.apply(buffers.lateral.data(), buffers.features.data(), count);
    if (index + 1 < blocks_.size()) store_features(level, first, end, buffers.features.data());
    for (std::int64_t row = first; row < end; ++row) {
        const std::int64_t at = level.occupied[row].offset - offset;
        finish_rgb_row(index, row, buffers.rgb.data() + at * colors, buffers);
        if (!mask_.empty())
            finish_mask_row(index, row, buffers.lateral.data() + at * static_cast<std::int64_t>(logit_weight_.size()), buffers);
    }
}

/// Features of the occupied pixels into those that the next block reads; the rest of these are background.
template <class T>
void BlockRenderer::TypedState<T>::store_features(Level<T>& level, std::int64_t first, std::int64_t end,
                                                  const T* features) const {
    const std::vector<T>& background = level.background.features;
    const auto channels = static_cast<std::int64_t>(background.size());
    for (std::int64_t y = first; y < end; ++y) {
        const PixelRow& from = level.occupied[y];
        const PixelRow& to = level.read[y];
        T* row = level.features.data() + to.offset * channels;
        const auto fill = [&](std::int64_t count) {
            for (; count > 0; --count) row = std::copy_n(background.data(), channels, row);
        };
        fill(from.size() > 0 ? from.begin - to.begin : to.size());
        if (from.size() == 0) continue;
        row = std::copy_n(features, from.size() * channels, row);
        features += from.size() * channels;
        fill(to.end - from.end);
    }
}

/// Doubles the sum so far and adds this block's part, which is that of the background wherever no pixel was computed.
template <class T>
void BlockRenderer::TypedState<T>::finish_rgb_row(std::size_t index, std::int64_t row, const float* rgb,
                                                  StripBuffers<T>& buffers) {
    Level<T>& level = levels_[index + 1];
    const bool last = index + 1 == blocks_.size();
    const std::int64_t length = level.side * colors;
    float* to = last ? buffers.rgb_row.data() : level.rgb.data() + row * length;
    if (index == 0) {
        std::fill_n(to, length, 0.0F);
    } else {
        kernels::double_row(to, buffers.scratch.data(), levels_[index].rgb.data(), row, levels_[index].side, colors,
                            kernels::smooth_doubling);
    }
    const PixelRow& pixels = level.occupied[row];
    kernels::add_difference(to + pixels.begin * colors, rgb, level.background.rgb.data(), pixels.size(), colors);
    if (last) kernels::color_row(picture_.data() + row * length, to, background_rgb_.data(), length);
}

template <class T>
void BlockRenderer::TypedState<T>::finish_mask_row(std::size_t index, std::int64_t row, const float* lateral,
                                                   StripBuffers<T>& buffers) {
    Level<T>& level = levels_[index + 1];
    const bool last = index + 1 == blocks_.size();
    const auto channels = static_cast<std::int64_t>(logit_weight_.size());
    const std::int64_t length = level.side * channels;
    float* to = last ? buffers.mask_row.data() : level.mask.data() + row * length;
    if (index == 0) {
        std::fill_n(to, length, 0.0F);
    } else {
        kernels::double_row(to, buffers.scratch.data(), levels_[index].mask.data(), row, levels_[index].side, channels,
                            kernels::bilinear_doubling);
    }
    const PixelRow& pixels = level.occupied[row];
    kernels::add_difference(to + pixels.begin * channels, lateral, level.background.mask.data(), pixels.size(), channels);
    if (last) kernels::mask_row(mask_.data() + row * level.side, to, logit_weight_, background_logit_, level.side);
}

template <class T>
void BlockRenderer::TypedState<T>::render(std::span<float> picture, std::span<float> mask) {
    if (levels_[0].background.features.empty()) fail<ValueError>("render blocks: no feature map to render");
    if (!mask.empty() && logit_weight_.empty())
        fail<ValueError>("render blocks: made without the mask branch, cannot give a mask");
    const std::int64_t pixels = levels_.back().side * levels_.back().side;
    if (std::ssize(picture) != colors * pixels || (!mask.empty() && std::ssize(mask) != pixels))
        fail<ShapeError>("render blocks: picture of ", pixels, " pixels into ", picture.size(), " numbers, mask into ",
                         mask.size());
    picture_ = picture;
    mask_ = mask;
    if (!backgrounds_known_) compute_backgrounds();
    if (!first_doubling_kept_) keep_first_doubling();
    for (std::size_t i = 0; i < blocks_.size(); ++i) {
        if (i + 1 < blocks_.size()) {
            Level<T>& level = levels_[i + 1];
            grow(level.features, level.side * level.side * blocks_[i].out());
            grow(level.rgb, level.side * level.side * colors);
            if (!mask.empty()) grow(level.mask, level.side * level.side * static_cast<std::int64_t>(logit_weight_.size()));
        }
        parallel_for(static_cast<std::int64_t>(strips_[i].size()), 1, [this, i](std::int64_t begin, std::int64_t) {
            const Strip& strip = strips_[i][static_cast<std::size_t>(begin)];
            std::unique_ptr<StripBuffers<T>> buffers = buffers_.take();
            prepare(*buffers);
            if (i == 0) {
                finish_kept_strip(strip, *buffers);
            } else {
                compute_strip(strip, *buffers);
            }
            buffers_.give_back(std::move(buffers));
        });
    }
}

BlockRenderer::BlockRenderer(std::span<const FoldedRenderBlock> blocks, const std::optional<FoldedMaskBranch>& mask,
                             std::int64_t rays_per_side, std::int64_t resolution, Precision precision) {
    std::size_t count = 0;
    while (count < blocks.size() && rays_per_side << count < resolution) ++count;
    if (count == 0 || rays_per_side << count != resolution) {
        fail<ValueError>("render blocks: ", blocks.size(), " doublings of ", rays_per_side, " rays do not give ", resolution,
                         " pixels");
    }
    blocks = blocks.first(count);
    if (precision == Precision::float32) {
        state_ = std::make_unique<TypedState<float>>(blocks, mask, rays_per_side);
    } else {
        state_ = std::make_unique<TypedState<kernels::BFloat16>>(blocks, mask, rays_per_side);
    }
}
BlockRenderer::~BlockRenderer() = default;
BlockRenderer::BlockRenderer(BlockRenderer&&) noexcept = default;

void BlockRenderer::set_style(std::span<const FoldedRenderBlock> blocks) {
    state_->set_style(blocks);
}

void BlockRenderer::set_feature_map(std::span<const float> feature_map, std::span<const std::uint8_t> occupied) {
    state_->set_feature_map(feature_map, occupied);
}

void BlockRenderer::render(std::span<float> picture, std::span<float> mask) {
    state_->render(picture, mask);
}

const BlockCounts& BlockRenderer::counts() const {
    return state_->counts;
}

}  // namespace stymo
