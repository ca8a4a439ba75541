#include <algorithm>
#include <array>
#include <catch2/catch.hpp>
#include <cmath>
#include <numbers>
#include <numeric>

#include "core/error.h"
#include "core/io/file.h"
#include "core/io/image.h"
#include "core/io/scratch_folder.h"
#include "core/io/tensor_file.h"
#include "train/head_mask_training.h"

using namespace stymo;
using Catch::Matchers::Contains;

namespace head_mask_training_tests {

/// A grey photo whose left half is the head, and red backgrounds.
void write_examples(const std::filesystem::path& folder) {
    Tensor half = Tensor::zeros({32, 32, 1});
    for (std::size_t i = 0; i < 1024; ++i)
        half.mutable_values<float>()[i] = i % 32 < 16 ? 1.0F : 0.0F;
    Tensor red = Tensor::zeros({32, 32, 3});
    for (std::size_t i = 0; i < 1024; ++i) red.mutable_values<float>()[3 * i] = 1.0F;
    for (const char* part : {"images", "masks", "persons", "backgrounds", "unknown"})
        std::filesystem::create_directories(folder / part);
    write_image(folder / "images/a.png", Tensor::full({32, 32, 3}, 0.5));
    write_image(folder / "masks/a.png", half);
    write_image(folder / "persons/a.png", half);
    write_image(folder / "unknown/a.png", Tensor::zeros({32, 32, 1}));
    write_image(folder / "backgrounds/a.png", red);
}

constexpr HeadMaskVariation still{.background_share = 1.0,
                                  .hair_share = 0.0,
                                  .hat_share = 0.0,
                                  .glasses_share = 0.0,
                                  .cover_share = 0.0,
                                  .degrees = 0.0,
                                  .scale = 1.0,
                                  .shift = 0.0,
                                  .color = 0.0,
                                  .blur_share = 0.0};

TEST_CASE("A cut-out person gets another background, and its mask moves with the photo") {
    const ScratchFolder folder;
    write_examples(folder.path());
    const HeadMaskExamples examples(folder.path());
    REQUIRE(examples.size() == 1);
    const HeadMaskExamples::Batch batch = examples.draw(4, still, Rng(1));
    const std::int64_t side = HeadMaskNetwork::usual_side;
    REQUIRE(batch.images.shape() == Shape{4, side, side, 3});
    const auto images = batch.images.values<float>();
    const auto masks = batch.masks.values<float>();
    double red = 0.0;
    for (std::size_t i = 0; i < masks.size(); ++i) {
        if (masks[i] > 0.99F) REQUIRE(images[3 * i + 1] > 0.2F);
        // The colours of a background vary, but on the whole it stays red.
        if (masks[i] < 0.01F) red += static_cast<double>(images[3 * i] - images[3 * i + 1]);
    }
    CHECK(red / static_cast<double>(masks.size()) > 0.05);
    CHECK(examples.draw(4, still, Rng(1)).images.to_vector() == batch.images.to_vector());
    const auto sum = [](const Tensor& mask) {
        double total = 0.0;
        for (const float value : mask.values<float>()) total += static_cast<double>(value);
        return total;
    };
    const double before = sum(examples.draw(8, still, Rng(1)).masks);
    for (const auto share : {&HeadMaskVariation::cover_share, &HeadMaskVariation::hat_share}) {
        HeadMaskVariation covered = still;
        covered.*share = 1.0;
        CHECK(sum(examples.draw(8, covered, Rng(1)).masks) < before);
    }
}

TEST_CASE("Larger hair moves what is beside the face outwards, and nothing of the face") {
    Rng rng(3);
    const LargerHair hair(rng);
    for (const ImagePoint face : {ImagePoint{0.5, 0.3}, ImagePoint{0.4, 0.6}, ImagePoint{0.6, 0.8}})
        CHECK(hair.source(face) == face);
    double outwards = 0.0, last = 0.0;
    for (int i = 0; i < 360; ++i) {
        const double angle = i * std::numbers::pi / 180.0;
        const ImagePoint beside{0.5 + 0.45 * std::cos(angle), 0.53 + 0.45 * std::sin(angle)};
        const ImagePoint source = hair.source(beside);
        const double factor = 0.45 / std::hypot(source[0] - 0.5, source[1] - 0.53);
        if (i > 0) CHECK(std::abs(factor - last) < 0.1);  // the outline has no steps
        outwards += factor / 360.0;
        last = factor;
    }
    CHECK(outwards > 1.05);
}

TEST_CASE("Glasses have a lens before each eye, and are head") {
    for (std::uint64_t seed = 0; seed < 20; ++seed) {
        Rng rng(seed);
        const Glasses glasses(rng);
        for (const ImagePoint eye : {ImagePoint{0.37, 0.48}, ImagePoint{0.63, 0.48}}) {
            const Glasses::Paint lens = glasses.paint(eye);
            CHECK(lens.opacity >= 0.15F);
            CHECK_FALSE(lens.temple);
            for (const float value : lens.color) CHECK((value >= 0.0F && value <= 1.0F));
        }
        for (const ImagePoint skin : {ImagePoint{0.5, 0.3}, ImagePoint{0.5, 0.8}})
            CHECK(glasses.paint(skin).opacity == 0.0F);
    }
    const ScratchFolder folder;
    write_examples(folder.path());
    const HeadMaskExamples examples(folder.path());
    HeadMaskVariation worn = still;
    worn.glasses_share = 1.0;
    // The half that is no head carries a lens too, and that is head.
    const auto without = examples.draw(4, still, Rng(1)).masks.to_vector();
    const auto with = examples.draw(4, worn, Rng(1)).masks.to_vector();
    CHECK(std::accumulate(with.begin(), with.end(), 0.0) >
          std::accumulate(without.begin(), without.end(), 0.0));
}

TEST_CASE("A hat has its shadow below it and nothing of the head above it") {
    for (std::uint64_t seed = 0; seed < 20; ++seed) {
        Rng rng(seed);
        const Hat hat(rng);
        int last = 0;
        for (double y = 0.0; y < 1.0; y += 0.002) {
            const Hat::Part part = hat.part({0.5, y});
            const int rank = part == Hat::Part::outside  ? 0
                             : part == Hat::Part::hat    ? 1
                             : part == Hat::Part::shadow ? 2
                                                         : 3;
            CHECK(rank >= last);
            last = rank;
        }
        CHECK(last == 3);
    }
}

TEST_CASE("A training of head masks that pauses gives the same network") {
    const ScratchFolder folder;
    write_examples(folder.path());
    const HeadMaskExamples examples(folder.path());
    HeadMaskTrainingConfig config;
    config.batch = 1;
    config.steps = 2;
    const auto train = [&](const char* run, std::int64_t steps, bool resume) {
        return train_head_mask(
            make_head_mask_model(Rng(1)), examples, config,
            {.folder = folder / run, .resume = resume, .most_steps = steps, .seed = 7});
    };
    CHECK(train("whole", 0, false).finished);
    CHECK_FALSE(train("parts", 1, false).finished);
    CHECK(train("parts", 1, true).steps == 2);
    for (const char* file : {head_mask_file, head_mask_state_file})
        CHECK(read_file(folder / "whole" / file) == read_file(folder / "parts" / file));
    CHECK_THROWS_WITH(train("whole", 0, false), Contains("holds a training already"));
    CHECK_THROWS_WITH(train("none", 0, true), Contains("no state to resume from"));

    const auto resumed = [&](std::uint64_t seed) {
        static_cast<void>(train_head_mask(
            make_head_mask_model(Rng(1)), examples, config,
            {.folder = folder / "whole", .resume = true, .most_steps = 1, .seed = seed}));
    };
    CHECK_THROWS_WITH(resumed(8), Contains("was trained with --seed 7, not 8"));
    const std::filesystem::path state = folder / "whole" / head_mask_state_file;
    TensorFile damaged = read_tensor_file(state);
    damaged.metadata["step"] = "two";
    write_tensor_file(state, damaged);
    CHECK_THROWS_WITH(resumed(7), Contains("\"step\" is \"two\", not a number"));
    damaged.metadata.erase("step");
    write_tensor_file(state, damaged);
    CHECK_THROWS_WITH(resumed(7), Contains("not a training state (\"step\" is missing)"));
}

TEST_CASE("A folder without masks, and an unknown key, are refused") {
    const ScratchFolder folder;
    write_examples(folder.path());
    std::filesystem::remove_all(folder / "masks");
    CHECK_THROWS_WITH(HeadMaskExamples(folder.path()), Contains("has no mask"));
    CHECK_THROWS_AS(HeadMaskTrainingConfig::load(
                        STYMO_SOURCE_DIR "/configs/models/head-mask/training.json", {"step=1"}),
                    ConfigError);
}

}  // namespace head_mask_training_tests
