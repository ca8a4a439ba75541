#include <algorithm>
#include <catch2/catch.hpp>
#include <set>

#include "core/error.h"
#include "train/data/training_images.h"
#include "train/tiny_training.h"

using namespace stymo;
using namespace stymo::test;

TEST_CASE("each pass shows every face once, in the same order from wherever one looks",
          "[dataset]") {
    const Dataset faces = synthetic_dataset();
    const std::int64_t count = faces.size();
    const Rng rng(3);
    const auto id_of = [](const TrainingImages& images, std::int64_t number) {
        return images.batch(number, 1).ids.front();
    };
    // Another one for each look, so that no order is kept.
    std::vector<std::string> ids;
    for (std::int64_t number = 0; number < 3 * count; ++number)
        ids.push_back(id_of(TrainingImages(faces, true, rng, 8), number));
    for (std::int64_t pass = 0; pass < 3; ++pass) {
        const auto begin = ids.begin() + pass * count;
        CHECK(std::set<std::string>(begin, begin + count).size() ==
              static_cast<std::size_t>(count));
    }
    CHECK_FALSE(std::equal(ids.begin(), ids.begin() + count, ids.begin() + count));

    // Two orders are kept; here three are wanted in turn, forwards and backwards.
    const TrainingImages images(faces, true, rng, 8, count + 1);
    CHECK(images.batch(0, 3 * count).ids == ids);
    for (std::int64_t index = 0; index < count; ++index) {
        for (const std::int64_t pass : {2, 0, 1})
            CHECK(id_of(images, pass * count + index) ==
                  ids[static_cast<std::size_t>(pass * count + index)]);
    }
    // All faces are in memory.
    CHECK(images.waiting_seconds() == 0.0);
}

TEST_CASE("a batch has the targets up to the side that is asked for, with the same values",
          "[dataset]") {
    const Dataset faces = synthetic_dataset();
    const TrainingImages images(faces, true, Rng(3), 8);
    const FaceBatch all = images.batch(0, 2), small = images.batch(0, 2, 16);
    REQUIRE(all.targets.size() == 4);
    REQUIRE(small.targets.size() == 2);
    for (std::size_t i = 0; i < small.targets.size(); ++i)
        CHECK(small.targets[i].to_vector() == all.targets[i].to_vector());
    CHECK(small.input.to_vector() == all.input.to_vector());
    CHECK_THROWS_AS(images.batch(0, 2, 24), ValueError);
}
