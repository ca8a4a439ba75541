#include <catch2/catch.hpp>
#include <limits>

#include "core/ops/ops.h"
#include "nn/losses.h"
#include "nn/models/discriminator.h"
#include "support/check_close.h"
#include "support/error_message.h"

using namespace stymo;
using namespace stymo::test;

namespace {

struct Judge {
    ParameterStore store;
    Discriminator discriminator;

    explicit Judge(std::int64_t resolution, const DiscriminatorConfig& config = {.max_channels = 4})
        : discriminator([&] {
              Rng rng(1);
              return Discriminator(config, resolution, store, "d", rng);
          }()) {}
    Variable operator()(const Tensor& images, double fade = 1.0) const {
        return discriminator(Variable(images), fade);
    }
};

Tensor noise(std::int64_t batch, std::int64_t side) {
    return Rng(5).normal({batch, side, side, 3}, 0.0, 0.5);
}

/// Parameters of StyleGAN2's network at its usual size, whose single fromRGB belongs to
/// `resolution`: counted by layers.
std::int64_t published_count(std::int64_t resolution) {
    const auto channels = [](std::int64_t side) {
        return side <= 64 ? std::int64_t{512} : 512 * 64 / side;
    };
    std::int64_t count = 4 * channels(resolution);
    for (std::int64_t side = resolution; side > 4; side /= 2) {
        const std::int64_t in = channels(side), out = channels(side / 2);
        count += 9 * in * in + in + 9 * in * out + out + in * out;
    }
    return count + 9 * 513 * 512 + 512 + 8192 * 512 + 512 + 512 + 1;
}

}  // namespace

TEST_CASE(
    "a discriminator has StyleGAN2's number of parameters, and a fromRGB for each smaller "
    "resolution") {
    CHECK(published_count(64) == 26'488'833);
    CHECK(published_count(512) == 28'982'849);
    const Judge judge(512, {});
    std::int64_t shared = 0;
    for (const std::int64_t resolution : {64, 128, 256, 512}) {
        for (const std::string& prefix : Discriminator::prefixes_of("d", resolution))
            shared += judge.store.element_count(prefix);
        const std::int64_t from_rgb =
            judge.store.element_count("d.from_rgb" + std::to_string(resolution));
        CHECK(shared == published_count(resolution));
        shared -= from_rgb;
    }
    CHECK(judge.store.element_count() == published_count(512) + 4 * (512 + 256 + 128));
}

TEST_CASE("the discriminator's channels follow the multiplier, and none exceeds the limit") {
    const auto widths = [](const DiscriminatorConfig& config) {
        const Judge judge(512, config);
        std::vector<std::int64_t> result;
        for (const char* side : {"64", "128", "256", "512"})
            result.push_back(judge.store.element_count(std::string("d.from_rgb") + side + ".bias"));
        return result;
    };
    CHECK(widths({.channel_multiplier = 0.5, .max_channels = 150}) ==
          std::vector<std::int64_t>{128, 64, 32, 16});
    CHECK(widths({.max_channels = 100}) == std::vector<std::int64_t>{100, 100, 100, 64});
}

TEST_CASE("the multiply-adds of a discriminator are those of its weights at each pixel") {
    const Judge judge(128);
    std::int64_t work = 0;
    const auto add = [&](const std::string& layer, std::int64_t pixels) {
        work += pixels * judge.store.element_count("d." + layer + ".weight");
    };
    add("from_rgb128", 128 * 128);
    for (std::int64_t side = 128; side > 4; side /= 2) {
        const std::string block = "block" + std::to_string(side);
        add(block + ".conv0", side * side);
        add(block + ".conv1", side * side / 4);
        add(block + ".skip", side * side / 4);
    }
    add("epilogue.conv", 4 * 4);
    add("epilogue.hidden", 1);
    add("epilogue.logit", 1);
    CHECK(Discriminator::multiply_adds({.max_channels = 4}, 128) == work);
}

TEST_CASE(
    "a block at full strength is the same as no fading, bit for bit, and one at none hides the "
    "image's details") {
    const Judge judge(128);
    const Tensor images = noise(2, 128);
    CHECK(identical(judge(images, 1.0).value(), judge(images).value()));
    const Tensor coarse = faded_image(Variable(images), 0.0).value();
    CHECK(check_close(judge(images, 0.0).value(), judge(coarse, 0.0).value(), 1e-5).passed);
    CHECK_FALSE(check_close(judge(images, 0.5).value(), judge(coarse, 0.5).value(), 1e-3).passed);
}

TEST_CASE("a discriminator of a high resolution judges smaller images as the smaller one does") {
    const Tensor images = noise(2, 64);
    CHECK(identical(Judge(256)(images).value(), Judge(64)(images).value()));
}

TEST_CASE("every parameter of a discriminator comes with exactly one resolution") {
    const Judge judge(256);
    for (const Parameter& parameter : judge.store.all()) {
        int owners = 0;
        for (const std::int64_t side : {64, 128, 256})
            for (const std::string& prefix : Discriminator::prefixes_of("d", side))
                owners += parameter.name().starts_with(prefix) ? 1 : 0;
        INFO(parameter.name());
        CHECK(owners == 1);
    }
    const Judge smaller(128);
    for (const std::string& prefix : Discriminator::prefixes_of("d", 256)) {
        CHECK(judge.store.element_count(prefix) > 0);
        CHECK(smaller.store.element_count(prefix) == 0);
    }
}

TEST_CASE(
    "images i and i + B / G share a minibatch deviation, the others do not know of each other") {
    const Judge judge(64, {.max_channels = 4, .group_size = 2});
    const Tensor images = noise(4, 64);
    const Tensor swapped = concat({slice(images, 0, 0, 3), slice(noise(8, 64), 0, 7, 8)}, 0)
                               .value();  // another image 3
    const std::vector<double> before = judge(images).value().to_vector();
    const std::vector<double> after = judge(swapped).value().to_vector();
    CHECK(before[0] == after[0]);
    CHECK(before[2] == after[2]);
    CHECK(before[1] != after[1]);
    CHECK(before[3] != after[3]);
}

TEST_CASE("a batch smaller than a group is a group, even a batch of one") {
    const Judge judge(64);
    CHECK(judge(noise(1, 64)).shape() == Shape{1, 1});
    CHECK(judge(noise(3, 64)).shape() == Shape{3, 1});
}

TEST_CASE("a discriminator refuses what it cannot judge in one line") {
    const Judge judge(128);
    const auto complaint = [&](const Shape& shape, double fade = 1.0) {
        return error_message([&] { (void)judge(Tensor::zeros(shape), fade); });
    };
    CHECK(complaint({1, 256, 256, 3}) ==
          "the discriminator takes square RGB images with a side of 64, 128, got (1, 256, "
          "256, 3)");
    for (const Shape& shape : {Shape{1, 32, 32, 3}, Shape{1, 96, 96, 3}, Shape{1, 64, 128, 3},
                               Shape{1, 64, 64, 1}, Shape{64, 64}})
        CHECK(is_one_line(complaint(shape)));
    CHECK(is_one_line(complaint({6, 64, 64, 3})));
    CHECK(complaint({1, 64, 64, 3}, 0.5) ==
          "the discriminator has no smaller block to fade from at 64 pixels");
    for (const double fade : {-0.1, 1.1, std::numeric_limits<double>::quiet_NaN()})
        CHECK(is_one_line(complaint({1, 128, 128, 3}, fade)));
    for (const std::int64_t resolution : {0, 32, 96, 2048})
        CHECK(is_one_line(error_message<ConfigError>([&] { (void)Judge(resolution); })));
}
