#include <catch2/catch.hpp>

#include "core/io/image.h"
#include "core/io/scratch_folder.h"
#include "train/data/dataset.h"

namespace face_image_tests {

using namespace stymo;

TEST_CASE("masks of 0 and 1 are scaled and said, one that covers nothing is refused", "[dataset]") {
    const ScratchFolder folder;
    for (const char* kind : {"images", "masks"}) std::filesystem::create_directory(folder / kind);
    for (const char* id : {"1", "2", "3"})
        write_image(folder / "images" / (std::string(id) + ".png"), Tensor::full({32, 32, 3}, 0.6));
    Tensor ones = Tensor::full({32, 32, 1}, 1.0 / 255.0);
    ones.mutable_values<float>()[0] = 0.0F;
    write_image(folder / "masks/1.png", ones);
    write_image(folder / "masks/2.png", Tensor::zeros({32, 32, 1}));
    write_image(folder / "masks/3.png", Tensor::full({32, 32, 1}, 1.0));
    for (const std::int64_t megabytes : {0, 100}) {
        DataConfig config;
        config.test = config.validation = 0;
        config.cache_megabytes = megabytes;
        const Dataset faces(folder.path(), 32, config, Split::all);
        const Face face = faces.load(0);
        CHECK(face.mask.values<float>()[40] == 1.0F);
        static_cast<void>(faces.load(1));
        const DatasetSummary summary = faces.summary();
        CHECK(summary.scaled_masks == 1);
        CHECK_THAT(summary.text(),
                   Catch::Contains("1 with a mask of values of 0 and 1, which are taken for") &&
                       Catch::Contains("2.png: covers nothing (every pixel is 0)"));
    }
}

}  // namespace face_image_tests
