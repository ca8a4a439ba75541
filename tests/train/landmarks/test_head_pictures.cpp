#include <algorithm>
#include <catch2/catch.hpp>

#include "core/parallel.h"
#include "render/morphable/builtin_head.h"
#include "support/thread_count.h"
#include "train/landmarks/head_pictures.h"
#include "train/landmarks/landmark_training.h"
#include "train/landmarks/photo_landmarks.h"
#include "train/landmarks/photo_variation.h"

using namespace stymo;

namespace {

const HeadPictures& pictures() {
    static const MorphableHead head = builtin_head();
    static const HeadPictures made(head);
    return made;
}

/// A white photo with one black dot of 3 x 3 pixels at each point.
LandmarkExample dots() {
    LandmarkExample example{Tensor::full({200, 200, 3}, 1.0), {}, {}};
    example.weights.fill(1.0F);
    const auto values = example.image.mutable_values<float>();
    for (std::size_t k = 0; k < 68; ++k) {
        const std::size_t column = 40 + 12 * (k % 10), row = 50 + 14 * (k / 10);
        example.points[k] = {static_cast<double>(column) + 0.5, static_cast<double>(row) + 0.5};
        for (std::size_t y = row - 1; y <= row + 1; ++y)
            std::fill_n(values.begin() + static_cast<std::ptrdiff_t>(3 * (200 * y + column - 1)), 9,
                        0.0F);
    }
    // The line of the eyes must not be turned.
    for (std::size_t k = 36; k < 48; ++k) example.points[k] = {k < 42 ? 70.5 : 130.5, 92.5};
    return example;
}

}  // namespace

TEST_CASE("A picture of a head depends on its generator alone, and shows its points") {
    const LandmarkExample a = pictures().draw(Rng(5)), b = pictures().draw(Rng(5));
    const LandmarkExample other = pictures().draw(Rng(6));
    CHECK(std::ranges::equal(a.image.values<float>(), b.image.values<float>()));
    CHECK_FALSE(std::ranges::equal(a.image.values<float>(), other.image.values<float>()));
    REQUIRE(a.image.shape() == Shape{HeadPictures::side, HeadPictures::side, 4});
    for (const std::size_t k : {8U, 30U, 33U, 36U, 45U, 51U, 57U}) {
        const auto row = static_cast<std::int64_t>(a.points[k].y());
        const auto column = static_cast<std::int64_t>(a.points[k].x());
        REQUIRE((row >= 0 && row < HeadPictures::side));
        const auto pixel = static_cast<std::size_t>(row * HeadPictures::side + column);
        CHECK(a.image.values<float>()[4 * pixel + 3] > 0.0F);
    }
    CHECK(a.points[45].x() > a.points[36].x());
    CHECK(a.points[8].y() > a.points[30].y());
}

TEST_CASE("A variation moves the image and its points together") {
    const LandmarkExample example = dots();
    int dark = 0, checked = 0;
    for (std::uint64_t seed = 0; seed < 20; ++seed) {
        const LandmarkTarget target = varied(example, {}, 200, Rng(seed));
        const auto values = target.image.values<float>();
        double mean = 0.0;
        for (const float value : values) mean += static_cast<double>(value);
        mean /= static_cast<double>(values.size());
        for (std::size_t k = 0; k < 36; ++k) {
            const auto column = static_cast<std::int64_t>(100.0 * (target.points[k].x() + 1.0));
            const auto row = static_cast<std::int64_t>(100.0 * (target.points[k].y() + 1.0));
            if (row < 0 || column < 0 || row >= 200 || column >= 200) continue;
            ++checked;
            dark += static_cast<double>(
                        values[static_cast<std::size_t>(3 * (200 * row + column) + 1)]) < mean
                        ? 1
                        : 0;
        }
    }
    REQUIRE(checked > 400);
    CHECK(dark > 0.85 * checked);  // boxes and noise cover some
}

TEST_CASE("Training gives the same weights on any number of threads") {
    const LandmarkTrainingSettings settings{.steps = 3, .batch = 2, .heads = 2, .new_heads = 1};
    const std::vector<LandmarkExample> photos{dots()};
    const auto train = [&](int threads) {
        const test::ThreadCount before;
        set_thread_count(threads);
        LandmarkModel model = make_landmark_model(Rng(1));
        train_landmarks(model, pictures(), {}, photos, settings, Rng(2));
        TensorFile file;
        model.store->save(file);
        return file;
    };
    const TensorFile one = train(1), two = train(2);
    for (const auto& [name, tensor] : one.tensors)
        CHECK(std::ranges::equal(tensor.values<float>(), two.tensors.at(name).values<float>()));
}

TEST_CASE("Training lowers the error", "[slow]") {
    const LandmarkTrainingSettings settings{
        .steps = 60, .batch = 4, .learning_rate = 2e-3, .heads = 4, .new_heads = 0};
    LandmarkModel model = make_landmark_model(Rng(1));
    double first = 0.0, last = 0.0;
    train_landmarks(model, pictures(), {}, {}, settings, Rng(2),
                    [&](std::int64_t step, double loss) {
                        if (step <= 10) first += loss;
                        if (step > 50) last += loss;
                    });
    CHECK(last < 0.7 * first);
}

TEST_CASE("A photo's own landmarks are the means of answers, and weigh less where these differ") {
    LandmarkModel model = make_landmark_model(Rng(1));
    const LandmarkExample example = dots();
    // Without weights the network answers with the same point always: the middle of the square.
    for (const Parameter& parameter : model.store->all())
        parameter.set_value(Tensor::zeros(parameter.variable().shape()));
    const std::optional<LandmarkExample> none =
        example_of_photo(model, example.image, example.points, Rng(1));
    CHECK_FALSE(none);  // a face without extent
}
