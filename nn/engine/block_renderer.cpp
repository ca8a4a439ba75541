#include "nn/engine/block_renderer.h"

#include <algorithm>
#include <array>
#include <functional>
#include <utility>
#include <vector>

#include "core/error.h"
#include "core/parallel.h"
#include "nn/engine/block_step.h"

namespace stymo {
namespace {

/// Average rows of a strip before upsampling. Two neighbouring strips both compute the detail of
/// the two rows at their boundary.
constexpr std::int64_t strip_rows = 32, least_strip_rows = 4;

}  // namespace

struct BlockRenderer::State {
    State(std::span<const FoldedRenderBlock> folded, const std::optional<FoldedMaskBranch>& mask,
          std::int64_t rays_per_side, MatmulPrecision precision);
    void set_style(std::span<const FoldedRenderBlock> folded);
    void set_feature_map(std::span<const float> feature_map,
                         std::span<const std::uint8_t> occupied);
    void render(std::span<float> image, std::span<float> mask, const std::stop_token& stop);

    BlockCounts counts;

private:
    struct Strip {
        std::int64_t begin;  ///< rows before upsampling
        std::int64_t end;
    };
    [[nodiscard]] BlockStep step(std::size_t i);
    void find_pixels();
    void cut_strips();
    void allocate();
    void draw_backgrounds();
    void keep_first_upsample();

    std::vector<PackedBlock> blocks_;
    std::vector<BlockImage> images_;  ///< before each block, and after the last
    std::vector<std::vector<Strip>> strips_;
    Canvas canvas_;
    float logit_bias_ = 0.0F;
    bool backgrounds_known_ = false;
    bool first_upsample_kept_ = false;
    AlignedVector<float> first_detail_;
    AlignedVector<float> first_blurred_;  ///< of the pixels in images_[1].occupied
    std::vector<float> no_difference_;
    BufferPool<StripBuffers> buffers_;
};

BlockRenderer::State::State(std::span<const FoldedRenderBlock> folded,
                            const std::optional<FoldedMaskBranch>& mask, std::int64_t rays_per_side,
                            MatmulPrecision precision)
    : images_(folded.size() + 1), strips_(folded.size()) {
    for (std::size_t i = 0; i < folded.size(); ++i)
        blocks_.emplace_back(folded[i], mask ? &mask->laterals[i] : nullptr, precision);
    if (mask) {
        const std::span<const float> weight = mask->logit.weight.values<float>();
        canvas_.logit_weight.assign(weight.begin(), weight.end());
        logit_bias_ = mask->logit.bias.values<float>()[0];
    }
    for (std::size_t i = 0; i < images_.size(); ++i) {
        images_[i].side = rays_per_side << i;
        images_[i].occupied.reset(images_[i].side);
        images_[i].shown.reset(images_[i].side);  // the image before the first block has no RGB
        if (i > 0) counts.pixels += images_[i].side * images_[i].side;
    }
}

BlockStep BlockRenderer::State::step(std::size_t i) {
    return {blocks_[i], images_[i], images_[i + 1], canvas_, i == 0, i + 1 == blocks_.size()};
}

void BlockRenderer::State::set_style(std::span<const FoldedRenderBlock> folded) {
    if (folded.size() < blocks_.size())
        fail<ShapeError>("render blocks: style for ", folded.size(), " blocks, expected ",
                         blocks_.size());
    for (std::size_t i = 0; i < blocks_.size(); ++i) blocks_[i].set_style(folded[i]);
    backgrounds_known_ = false;
}

void BlockRenderer::State::set_feature_map(std::span<const float> feature_map,
                                           std::span<const std::uint8_t> occupied) {
    BlockImage& image = images_[0];
    const std::int64_t side = image.side, channels = blocks_[0].in();
    if (std::ssize(feature_map) != side * side * channels || std::ssize(occupied) != side * side)
        fail<ShapeError>("render blocks: expected ", side * side, " rays of ", channels,
                         " features, got ", occupied.size(), " rays and ", feature_map.size(),
                         " features");
    image.occupied.set_nonzero(occupied);
    find_pixels();
    cut_strips();
    grow(image.features, side * side * channels);
    for (std::int64_t y = 0; y < side; ++y) {
        const PixelRow& row = image.read[y];
        std::copy_n(feature_map.data() + (y * side + row.begin) * channels, row.size() * channels,
                    image.features.data() + row.offset * channels);
    }
    // If no ray is empty, the background is shown nowhere and may have any value.
    const auto empty = std::ranges::find(occupied, 0) - occupied.begin();
    const std::int64_t ray = empty < side * side ? empty : 0;
    image.background.features.resize(static_cast<std::size_t>(channels));
    std::copy_n(feature_map.data() + ray * channels, channels, image.background.features.data());
    backgrounds_known_ = false;
    first_upsample_kept_ = false;
}

void BlockRenderer::State::find_pixels() {
    counts.pixels_computed = 0;
    for (std::size_t i = 0; i < blocks_.size(); ++i) {
        images_[i].read.set_read(images_[i].occupied);
        images_[i + 1].occupied.set_reached(images_[i].occupied);
        images_[i + 1].shown.set_upsampled(images_[i].shown, images_[i + 1].occupied);
        counts.pixels_computed += images_[i + 1].occupied.pixels();
    }
}

/// Cuts each block into strips of whole rows with nearly equal work.
void BlockRenderer::State::cut_strips() {
    for (std::size_t i = 0; i < blocks_.size(); ++i) {
        const PixelRows& pixels = images_[i + 1].occupied;
        const std::int64_t side = images_[i].side,
                           wanted = std::max<std::int64_t>(side / strip_rows, thread_count()),
                           most = std::max<std::int64_t>(2, side / least_strip_rows),
                           count = std::clamp<std::int64_t>(wanted, 2, most);
        // Each row has a small fixed cost.
        const auto work = [&](std::int64_t row) {
            return 32 * (pixels[2 * row].size() + pixels[2 * row + 1].size()) + 2 * side;
        };
        const std::int64_t all = 32 * pixels.pixels() + 2 * side * side;
        strips_[i].clear();
        std::int64_t begin = 0, done = 0;
        for (std::int64_t row = 0; row < side; ++row) {
            done += work(row);
            if (row + 1 < side && done * count < (std::ssize(strips_[i]) + 1) * all) continue;
            strips_[i].push_back({begin, row + 1});
            begin = row + 1;
        }
    }
}

/// Allocates for an image without empty rays and for all threads, so that no later frame needs more
/// memory.
void BlockRenderer::State::allocate() {
    for (std::size_t i = 1; i < blocks_.size(); ++i) {
        BlockImage& image = images_[i];
        grow(image.features, image.side * image.side * blocks_[i].in());
        grow(image.rgb, image.side * image.side * colors);
        if (!canvas_.mask.empty())
            grow(image.mask, image.side * image.side * std::ssize(canvas_.logit_weight));
    }
    const PackedBlock& first = blocks_[0];
    grow(first_detail_, images_[0].side * images_[0].side * 4 * first.in());
    grow(first_blurred_, images_[1].side * images_[1].side * first.in());
    buffers_.fill(thread_count(), [this](StripBuffers& buffers) {
        for (std::size_t i = 0; i < blocks_.size(); ++i) step(i).prepare(buffers);
    });
}

void BlockRenderer::State::draw_backgrounds() {
    std::array<float, colors> rgb{};
    canvas_.background_logit = logit_bias_;
    std::unique_ptr<StripBuffers> buffers = buffers_.take();
    for (std::size_t i = 0; i < blocks_.size(); ++i) {
        step(i).run_background(*buffers);
        const Background& background = images_[i + 1].background;
        for (std::size_t c = 0; c < colors; ++c)
            rgb[c] += background.rgb[c] + blocks_[i].rgb_bias[c];
        for (std::size_t c = 0; c < background.mask.size(); ++c)
            canvas_.background_logit += canvas_.logit_weight[c] * background.mask[c];
    }
    buffers_.give_back(std::move(buffers));
    const std::int64_t length = colors * images_.back().side;
    grow(canvas_.background_rgb, length);
    grow(canvas_.background_colors, length);
    grow(no_difference_, std::max(length, std::ssize(canvas_.logit_weight)));
    for (std::size_t i = 0; i < canvas_.background_rgb.size(); ++i)
        canvas_.background_rgb[i] = rgb[i % colors];
    kernels::color_row(canvas_.background_colors.data(), no_difference_.data(),
                       canvas_.background_rgb.data(), length);
    kernels::mask_row(&canvas_.background_mask, no_difference_.data(), canvas_.logit_weight,
                      canvas_.background_logit, 1);
    backgrounds_known_ = true;
}

/// Computes the part of the first block that does not depend on the style, for the whole image.
void BlockRenderer::State::keep_first_upsample() {
    constexpr std::int64_t pixels_at_once = 60, rows_at_once = 2;
    parallel_for(
        images_[0].read.pixels(), pixels_at_once, [this](std::int64_t begin, std::int64_t end) {
            const std::int64_t channels = blocks_[0].in();
            blocks_[0].detail.apply(first_detail_.data() + begin * 4 * channels,
                                    images_[0].features.data() + begin * channels, end - begin);
        });
    parallel_for(images_[0].side, rows_at_once, [this](std::int64_t begin, std::int64_t end) {
        std::unique_ptr<StripBuffers> buffers = buffers_.take();
        const std::int64_t channels = blocks_[0].in();
        for (std::int64_t row = std::max<std::int64_t>(begin - 1, 0);
             row < std::min(end + 1, images_[0].side); ++row)
            buffers->detail_rows[static_cast<std::size_t>(row)] =
                first_detail_.data() + images_[0].read[row].offset * 4 * channels;
        for (std::int64_t row = begin; row < end; ++row)
            step(0).blur_rows(
                row, buffers->detail_rows,
                first_blurred_.data() + images_[1].occupied[2 * row].offset * channels);
        buffers_.give_back(std::move(buffers));
    });
    first_upsample_kept_ = true;
}

void BlockRenderer::State::render(std::span<float> image, std::span<float> mask,
                                  const std::stop_token& stop) {
    if (images_[0].background.features.empty())
        fail<ValueError>("render blocks: no feature map to render");
    if (!mask.empty() && canvas_.logit_weight.empty())
        fail<ValueError>("render blocks: made without the mask branch, cannot give a mask");
    const std::int64_t pixels = images_.back().side * images_.back().side;
    if (std::ssize(image) != colors * pixels || (!mask.empty() && std::ssize(mask) != pixels))
        fail<ShapeError>("render blocks: image of ", pixels, " pixels into ", image.size(),
                         " numbers, mask into ", mask.size());
    canvas_.image = image;
    canvas_.mask = mask;
    allocate();
    if (!backgrounds_known_) draw_backgrounds();
    if (!first_upsample_kept_) keep_first_upsample();
    for (std::size_t i = 0; i < blocks_.size(); ++i) {
        // Passed by reference, since std::function would allocate memory for a closure of this
        // size.
        const auto run_strip = [&](std::int64_t index, std::int64_t) {
            if (stop.stop_requested()) return;
            const Strip& strip = strips_[i][static_cast<std::size_t>(index)];
            std::unique_ptr<StripBuffers> buffers = buffers_.take();
            if (i == 0) {
                step(0).run_blurred(strip.begin, strip.end, first_blurred_, *buffers);
            } else {
                step(i).run(strip.begin, strip.end, *buffers);
            }
            buffers_.give_back(std::move(buffers));
        };
        parallel_for(std::ssize(strips_[i]), 1, std::cref(run_strip));
    }
}

BlockRenderer::BlockRenderer(std::span<const FoldedRenderBlock> blocks,
                             const std::optional<FoldedMaskBranch>& mask,
                             std::int64_t rays_per_side, std::int64_t resolution,
                             MatmulPrecision precision) {
    std::size_t count = 0;
    while (count < blocks.size() && rays_per_side << count < resolution) ++count;
    if (count == 0 || rays_per_side << count != resolution)
        fail<ValueError>("render blocks: ", blocks.size(), " upsampling of ", rays_per_side,
                         " rays do not give ", resolution, " pixels");
    state_ = std::make_unique<State>(blocks.first(count), mask, rays_per_side, precision);
}
BlockRenderer::~BlockRenderer() = default;
BlockRenderer::BlockRenderer(BlockRenderer&&) noexcept = default;

void BlockRenderer::set_style(std::span<const FoldedRenderBlock> blocks) {
    state_->set_style(blocks);
}

void BlockRenderer::set_feature_map(std::span<const float> feature_map,
                                    std::span<const std::uint8_t> occupied) {
    state_->set_feature_map(feature_map, occupied);
}

void BlockRenderer::render(std::span<float> image, std::span<float> mask,
                           const std::stop_token& stop) {
    state_->render(image, mask, stop);
}

const BlockCounts& BlockRenderer::counts() const {
    return state_->counts;
}

}  // namespace stymo
