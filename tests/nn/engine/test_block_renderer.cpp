#include <catch2/catch.hpp>
#include <cmath>
#include <functional>

#include "core/error.h"
#include "core/ops/ops.h"
#include "nn/engine/block_renderer.h"
#include "nn/models/decoder.h"
#include "nn/models/display_image.h"
#include "support/check_close.h"
#include "support/thread_count.h"
#include "support/tiny_model.h"

using namespace stymo;
using namespace stymo::test;

namespace {

constexpr std::int64_t rays = 32;

/// Few channels, none a multiple of a vector; biases that are not zero.
struct NarrowDecoder {
    ParameterStore store;
    Decoder decoder;
    explicit NarrowDecoder(const DecoderConfig& config = narrow()) : decoder(make(store, config)) {
        Rng rng(4);
        for (const Parameter& parameter : store.all()) {
            const std::string& name = parameter.name();
            const bool block_bias = name.starts_with("decoder.block") && name.ends_with("bias") &&
                                    !name.ends_with("style.bias");
            if (block_bias || (name.starts_with("decoder.mask") && name.ends_with("bias")))
                parameter.set_value(rng.normal(parameter.variable().shape(), 0.0, 0.3));
        }
    }
    static DecoderConfig narrow() {
        DecoderConfig config;
        config.field_width = 4;
        config.field_layers = 2;
        config.feature_channels = 9;
        config.block_channels = {7, 5, 4, 3};
        config.mask_channels = 3;
        return config;
    }
    static Decoder make(ParameterStore& store, const DecoderConfig& config) {
        Rng rng(1);
        return {config, store, "decoder", rng};
    }
};

using Pattern = std::function<bool(std::int64_t row, std::int64_t column)>;

struct Rays {
    Tensor features;
    std::vector<std::uint8_t> occupied;
};

/// Random features where the pattern says so, else those of an empty ray.
Rays make_rays(const Pattern& occupied, std::int64_t channels, std::uint64_t seed = 5) {
    Rng rng(seed);
    const Tensor empty = rng.normal({channels}, 0.0, 1.0);
    Rays result{rng.normal({1, rays, rays, channels}, 0.0, 1.0), {}};
    const std::span<float> values = result.features.mutable_values<float>();
    for (std::int64_t ray = 0; ray < rays * rays; ++ray) {
        result.occupied.push_back(occupied(ray / rays, ray % rays) ? 1 : 0);
        if (result.occupied.back() == 0)
            std::ranges::copy(empty.values<float>(),
                              values.begin() + static_cast<std::ptrdiff_t>(ray * channels));
    }
    return result;
}

struct Images {
    Tensor image;
    Tensor mask;
};

Images expected(const Decoder& decoder, const Rays& map, const Codes& w, std::int64_t resolution) {
    const Decoded decoded =
        decoder.decode_feature_map(map.features, w, {.resolution = resolution, .mask = true});
    return {display_image(decoded.images.back().value(), 0),
            display_mask(sigmoid(decoded.mask_logit).value(), 0)};
}

Images rendered(BlockRenderer& renderer, std::int64_t resolution) {
    Images result{Tensor({resolution, resolution, 3}), Tensor({resolution, resolution, 1})};
    renderer.render(result.image.mutable_values<float>(), result.mask.mutable_values<float>());
    return result;
}

void check_same(const Images& actual, const Images& wanted, double tolerance) {
    const CloseReport image = check_close(actual.image, wanted.image, tolerance);
    INFO(image.message);
    CHECK(image.passed);
    const CloseReport mask = check_close(actual.mask, wanted.mask, tolerance);
    INFO(mask.message);
    CHECK(mask.passed);
}

const std::vector<std::pair<std::string, Pattern>> patterns{
    {"no ray is empty", [](std::int64_t, std::int64_t) { return true; }},
    {"all rays are empty", [](std::int64_t, std::int64_t) { return false; }},
    {"a disc",
     [](std::int64_t row, std::int64_t column) {
         return std::hypot(static_cast<double>(row) - 15.5, static_cast<double>(column) - 13.0) <
                9.0;
     }},
    {"one ray", [](std::int64_t row, std::int64_t column) { return row == 20 && column == 11; }},
    {"two corners",
     [](std::int64_t row, std::int64_t column) {
         return row + column == 0 || row + column == 2 * rays - 2;
     }},
    {"two rows and a hole",
     [](std::int64_t row, std::int64_t column) {
         return (row == 3 || row == 5) && column % 7 != 0;
     }},
    {"scattered",
     [](std::int64_t row, std::int64_t column) { return (row * 37 + column * 101) % 89 == 0; }},
};

}  // namespace

TEST_CASE("render blocks for one face give the images of the decoder, whichever rays are empty") {
    const NarrowDecoder model;
    const Codes w = model.decoder.map(random_codes(1, 2));
    for (const std::int64_t resolution : {64, 128, 256, 512}) {
        BlockRenderer renderer(model.decoder.folded_blocks(w), model.decoder.folded_mask(), rays,
                               resolution);
        for (const auto& [name, pattern] : patterns) {
            if (resolution == 512 && name != "a disc" && name != "no ray is empty") continue;
            INFO(name << " at " << resolution);
            const Rays map = make_rays(pattern, 9);
            renderer.set_feature_map(map.features.values<float>(), map.occupied);
            check_same(rendered(renderer, resolution), expected(model.decoder, map, w, resolution),
                       2e-6);
        }
    }
}

TEST_CASE(
    "render blocks give the decoder's images with channels that fill vectors, in part or whole") {
    DecoderConfig config = NarrowDecoder::narrow();
    config.feature_channels = 40;
    config.block_channels = {32, 19, 16, 3};
    config.mask_channels = 16;
    const NarrowDecoder model(config);
    const Codes w = model.decoder.map(random_codes(1, 2));
    BlockRenderer renderer(model.decoder.folded_blocks(w), model.decoder.folded_mask(), rays, 256);
    for (const auto& [name, pattern] : patterns) {
        INFO(name);
        const Rays map = make_rays(pattern, 40);
        renderer.set_feature_map(map.features.values<float>(), map.occupied);
        check_same(rendered(renderer, 256), expected(model.decoder, map, w, 256), 5e-6);
    }
}

TEST_CASE("render blocks leave out the pixels that only empty rays reach") {
    const NarrowDecoder model;
    const Codes w = model.decoder.map(random_codes(1, 2));
    BlockRenderer renderer(model.decoder.folded_blocks(w), {}, rays, 128);
    CHECK(renderer.counts().pixels == 64 * 64 + 128 * 128);
    const auto computed = [&](const Pattern& pattern) {
        const Rays map = make_rays(pattern, 9);
        renderer.set_feature_map(map.features.values<float>(), map.occupied);
        return renderer.counts().pixels_computed;
    };
    CHECK(computed(patterns[0].second) == renderer.counts().pixels);
    CHECK(computed(patterns[1].second) == 0);
    // 2 x 2 pixels and one around them; twice as many and one around them.
    CHECK(computed(patterns[3].second) == 4 * 4 + 10 * 10);
}

TEST_CASE("another style on the same feature map gives what a new renderer gives") {
    const NarrowDecoder model;
    const Codes first = model.decoder.map(random_codes(1, 2)),
                second = model.decoder.map(random_codes(1, 3));
    const Rays map = make_rays(patterns[2].second, 9),
               other_map = make_rays(patterns[4].second, 9, 6);
    BlockRenderer renderer(model.decoder.folded_blocks(first), model.decoder.folded_mask(), rays,
                           128);
    renderer.set_feature_map(map.features.values<float>(), map.occupied);
    (void)rendered(renderer, 128);
    renderer.set_style(model.decoder.folded_blocks(second));
    check_same(rendered(renderer, 128), expected(model.decoder, map, second, 128), 2e-6);
    renderer.set_feature_map(other_map.features.values<float>(), other_map.occupied);
    check_same(rendered(renderer, 128), expected(model.decoder, other_map, second, 128), 2e-6);
}

TEST_CASE("render blocks give the same bits on any number of threads, with or without a mask") {
    const NarrowDecoder model;
    const ThreadCount restore;
    const Codes w = model.decoder.map(random_codes(1, 2));
    const Rays map = make_rays(patterns[2].second, 9);
    Images one;
    for (const int threads : {1, 2, 3}) {
        set_thread_count(threads);
        BlockRenderer renderer(model.decoder.folded_blocks(w), model.decoder.folded_mask(), rays,
                               256);
        renderer.set_feature_map(map.features.values<float>(), map.occupied);
        const Images images = rendered(renderer, 256);
        if (threads == 1) one = images;
        CHECK(identical(images.image, one.image));
        CHECK(identical(images.mask, one.mask));
        Tensor alone({256, 256, 3});
        renderer.render(alone.mutable_values<float>());
        CHECK(identical(alone, one.image));
    }
}

TEST_CASE("render blocks say what does not fit") {
    const NarrowDecoder model;
    const Codes w = model.decoder.map(random_codes(1, 2));
    const std::vector<FoldedRenderBlock> blocks = model.decoder.folded_blocks(w);
    CHECK_THROWS_WITH(BlockRenderer(blocks, {}, rays, 96),
                      Catch::Contains("4 upsampling of 32 rays"));
    CHECK_THROWS_AS(BlockRenderer(blocks, {}, rays, 1024), ValueError);
    CHECK_THROWS_AS(BlockRenderer(blocks, {}, rays, 32), ValueError);
    BlockRenderer renderer(blocks, {}, rays, 64);
    std::vector<float> image(64 * 64 * 3), mask(64 * 64);
    CHECK_THROWS_WITH(renderer.render(image), Catch::Contains("no feature map"));
    Rays map = make_rays(patterns[0].second, 9);
    renderer.set_feature_map(map.features.values<float>(), map.occupied);
    CHECK_THROWS_WITH(renderer.render(image, mask), Catch::Contains("without the mask branch"));
    image.pop_back();
    CHECK_THROWS_AS(renderer.render(image), ShapeError);
    map.occupied.pop_back();
    CHECK_THROWS_AS(renderer.set_feature_map(map.features.values<float>(), map.occupied),
                    ShapeError);
}
