#include <algorithm>
#include <catch2/catch.hpp>
#include <set>

#include "support/check_close.h"
#include "train/data/training_images.h"
#include "train/tiny_training.h"

using namespace stymo;
using namespace stymo::test;

TEST_CASE("the encoder sees a mirrored face as it is, if both are to have one code", "[dataset]") {
    const Dataset faces = synthetic_dataset();
    const Rng rng(3);
    const TrainingImages own(faces, {.mirror = true}, rng);
    const TrainingImages shared(faces, {.mirror = true, .mirror_keeps_code = true}, rng);
    int mirrored_faces = 0;
    for (std::int64_t number = 0; number < 3 * faces.size(); ++number) {
        const FaceBatch first = own.batch(number, 1), second = shared.batch(number, 1);
        CHECK(first.ids == second.ids);
        CHECK(first.mirrored == second.mirrored);
        CHECK(identical(first.targets.back(), second.targets.back()));
        CHECK(first.cameras[0].center == second.cameras[0].center);
        CHECK(identical(first.input, second.input) == !first.mirrored[0]);
        for (std::int64_t i = 0; i < faces.size(); ++i)
            if (faces.load(i).id == second.ids[0])
                CHECK(identical(second.input, encoder_input(std::vector{faces.load(i)})));
        mirrored_faces += first.mirrored[0] ? 1 : 0;
    }
    CHECK(mirrored_faces > 0);
    CHECK(mirrored_faces < 3 * faces.size());
}

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
        ids.push_back(id_of(TrainingImages(faces, {.mirror = true}, rng, 8), number));
    for (std::int64_t pass = 0; pass < 3; ++pass) {
        const auto begin = ids.begin() + pass * count;
        CHECK(std::set<std::string>(begin, begin + count).size() ==
              static_cast<std::size_t>(count));
    }
    CHECK_FALSE(std::equal(ids.begin(), ids.begin() + count, ids.begin() + count));

    // Two orders are kept; here three are wanted in turn, forwards and backwards.
    const TrainingImages images(faces, {.mirror = true}, rng, 8, count + 1);
    CHECK(images.batch(0, 3 * count).ids == ids);
    for (std::int64_t place = 0; place < count; ++place) {
        for (const std::int64_t pass : {2, 0, 1})
            CHECK(id_of(images, pass * count + place) ==
                  ids[static_cast<std::size_t>(pass * count + place)]);
    }
    // All faces are in memory.
    CHECK(images.waiting_seconds() == 0.0);
}
