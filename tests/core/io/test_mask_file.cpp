#include <OpenImageIO/imageio.h>

#include <catch2/catch.hpp>
#include <vector>

#include "core/error.h"
#include "core/io/image.h"
#include "core/io/mask_file.h"
#include "core/io/scratch_folder.h"

namespace mask_file_tests {

using namespace stymo;

namespace {

template <class T>
MaskFile written(const std::vector<T>& values) {
    const ScratchFolder folder;
    const std::string path = (folder / "mask.png").string();
    const auto output = OIIO::ImageOutput::create(path);
    REQUIRE(output);
    REQUIRE(output->open(path, OIIO::ImageSpec(static_cast<int>(values.size()), 1, 1,
                                               OIIO::BaseTypeFromC<T>::value)));
    REQUIRE(output->write_image(OIIO::BaseTypeFromC<T>::value, values.data()));
    REQUIRE(output->close());
    return read_mask_file(path);
}

}  // namespace

TEST_CASE("a mask of 0 and 1 is scaled, others are what they are", "[image]") {
    const auto of_ones = [](const MaskFile& file) {
        return file.was_scaled && file.mask.to_vector() == std::vector<double>{0, 1, 1, 0};
    };
    CHECK(of_ones(written<std::uint8_t>({0, 1, 1, 0})));
    CHECK(of_ones(written<std::uint16_t>({0, 1, 1, 0})));
    for (const std::vector<std::uint8_t>& values :
         std::vector<std::vector<std::uint8_t>>{{0, 255}, {0, 1, 255}, {0, 1, 2}, {0, 0}, {255}}) {
        const MaskFile file = written(values);
        CHECK_FALSE(file.was_scaled);
        for (std::size_t i = 0; i < values.size(); ++i)
            CHECK(file.mask.to_vector()[i] == Approx(values[i] / 255.0));
    }
}

TEST_CASE("a mask that covers nothing is refused", "[image]") {
    require_covering(written<std::uint8_t>({0, 1}).mask);
    CHECK_THROWS_WITH(require_covering(written<std::uint8_t>({0, 0}).mask, "m.png: "),
                      Catch::StartsWith("m.png: covers nothing (every pixel is 0)"));
    // Class indices.
    CHECK_THROWS_WITH(require_covering(written<std::uint8_t>({0, 1, 13, 18}).mask),
                      Catch::Contains("its brightest pixel has 18 of 255"));
    require_covering(written<std::uint8_t>({0, 60}).mask);
}

}  // namespace mask_file_tests
