#include <catch2/catch.hpp>

#include "core/error.h"
#include "nn/models/decoder_config.h"

using namespace stymo;

TEST_CASE("the decoder's configuration is read, bounded and documented with the paper's values") {
    DecoderConfig config;
    ConfigSchema schema;
    describe(schema, config);
    schema.set("decoder.resolution=128");
    schema.set("decoder.block_channels=[64, 32]");
    schema.set("decoder.depth_planes=optical_axis");
    schema.set("decoder.near_z=2.0");
    schema.set("decoder.pixel_centers=false");
    CHECK(config.resolution == 128);
    CHECK(config.block_channels == std::vector<std::int64_t>{64, 32});
    CHECK(config.depth_planes == "optical_axis");
    CHECK(config.rays.near_z == 2.0);
    CHECK_FALSE(config.rays.pixel_centers);
    CHECK_FALSE(config.mask_detach);
    schema.set("decoder.mask_detach=true");
    CHECK(config.mask_detach);
    CHECK_THROWS_AS(schema.set("decoder.field_layers=0"), ConfigError);
    CHECK_THROWS_AS(schema.set("decoder.depth_planes=spherical"), ConfigError);
    CHECK_THAT(schema.to_markdown(),
               Catch::Contains("decoder.feature_channels") && Catch::Contains("paper: 256"));
}

TEST_CASE("the largest side within a limit is one of the ladder, and never below its smallest") {
    const stymo::ResolutionLadder ladder(64, 256);
    CHECK(ladder.largest_within(32) == 64);
    CHECK(ladder.largest_within(64) == 64);
    CHECK(ladder.largest_within(200) == 128);
    CHECK(ladder.largest_within(1024) == 256);
}

TEST_CASE("a far plane in front of the near one is refused") {
    DecoderConfig config;
    std::swap(config.rays.near_z, config.rays.far_z);
    CHECK_THROWS_WITH(ray_sampling(config), Catch::Contains("must be above decoder.far_z"));
}
