#include <catch2/catch.hpp>

#include "core/ops/ops.h"
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
    Variable operator()(const Tensor& images, double fade = 1.0) const { return discriminator(Variable(images), fade); }
};

Tensor noise(std::int64_t batch, std::int64_t side) {
    return Rng(5).normal({batch, side, side, 3}, 0.0, 0.5);
}

/// Parameters of StyleGAN2's network at its usual size, whose single fromRGB belongs to `resolution`: counted by layers.
std::int64_t published_count(std::int64_t resolution) {
    const auto channels = [](std::int64_t side) { return side <= 64 ? std::int64_t{512} : 512 * 64 / side; };
    std::int64_t count = 4 * channels(resolution);
    for (std::int64_t side = resolution; side > 4; side /= 2) {
        const std::int64_t in = channels(side), out = channels(side / 2);
        count += 9 * in * in + in + 9 * in * out + out + in * out;
    }
    return count + 9 * 513 * 512 + 512 + 8192 * 512 + 512 + 512 + 1;
}

}  // namespace

TEST_CASE("a discriminator has StyleGAN2's number of parameters, and a fromRGB for each smaller resolution") {
    CHECK(published_count(64) == 26'488'833);
    CHECK(published_count(512) == 28'982'849);
    std::int64_t other_from_rgb = 0;
    for (const std::int64_t resolution : {64, 128, 256, 512}) {
        const Judge judge(resolution, {});
        CHECK(judge.store.element_count() == published_count(resolution) + other_from_rgb);
        other_from_rgb += judge.store.element_count("d.from_rgb" + std::to_string(resolution));
    }
}
