#include <algorithm>
#include <catch2/catch.hpp>

#include "core/error.h"
#include "core/io/image.h"
#include "fit/photo/head_mask.h"
#include "nn/pretrained/head_mask_network.h"
#include "render/parsing_classes.h"
#include "shared_data.h"

namespace head_mask_tests {

using namespace stymo;

namespace {

template <class Function>
Tensor filled(std::int64_t size, const Function& value) {
    Tensor result({size, size, 1});
    const auto values = result.mutable_values<float>();
    for (std::int64_t row = 0; row < size; ++row)
        for (std::int64_t column = 0; column < size; ++column)
            values[static_cast<std::size_t>(row * size + column)] =
                static_cast<float>(value(row, column));
    return result;
}

bool within(std::int64_t row, std::int64_t column, std::int64_t top, std::int64_t left,
            std::int64_t bottom, std::int64_t right) {
    return row >= top && row < bottom && column >= left && column < right;
}

/// How many pixels lie between the value and the range.
std::int64_t gap(std::int64_t value, std::int64_t first, std::int64_t end) {
    return std::max({first - value, value - end + 1, std::int64_t{0}});
}

}  // namespace

TEST_CASE("a soft head mask is its largest component, solid inside, with the soft edge") {
    const Tensor probability = filled(128, [](std::int64_t row, std::int64_t column) {
        if (within(row, column, 50, 50, 53, 53)) return 0.25;  // a small hole
        if (within(row, column, 60, 60, 70, 70)) return 0.0;   // a hand
        if (within(row, column, 40, 40, 80, 80)) return 0.75;
        if (within(row, column, 39, 39, 81, 81)) return 0.25;  // its edge
        if (within(row, column, 0, 0, 10, 10)) return 1.0;     // something smaller
        return within(row, column, 100, 100, 120, 120) ? 0.25 : 0.0;
    });
    const Tensor expected = filled(128, [](std::int64_t row, std::int64_t column) {
        if (within(row, column, 50, 50, 53, 53)) return 1.0;
        if (within(row, column, 60, 60, 70, 70)) return 0.0;
        const std::int64_t rows = gap(row, 60, 70), columns = gap(column, 60, 70);
        const bool at_hand = rows * rows + columns * columns <= 4;
        if (within(row, column, 42, 42, 78, 78) && !at_hand) return 1.0;
        if (within(row, column, 40, 40, 80, 80)) return 0.75;
        return within(row, column, 39, 39, 81, 81) ? 0.25 : 0.0;
    });
    CHECK(soft_head_mask(probability).to_vector() == expected.to_vector());
    CHECK(covered_share(soft_head_mask(Tensor::full({8, 8, 1}, 0.4))) == 0.0);
    CHECK(covered_share(soft_head_mask(Tensor::full({8, 8, 1}, 1.0))) == 1.0);
    CHECK_THROWS_AS(soft_head_mask(Tensor::zeros({8, 8, 3})), ShapeError);
}

TEST_CASE("near its top a mask is bounded by what the surroundings show") {
    constexpr std::int64_t side = 16, margin = head_mask_margin(side), wide = side + 2 * margin;
    const Tensor alone = Tensor::full({side, side, 1}, 0.75);
    Tensor surrounded = Tensor::full({wide, wide, 1}, 0.5);
    surrounded.mutable_values<float>()[margin * wide + margin + 3] = 1.0F;
    const Tensor bounded = bounded_at_top(alone, surrounded);
    REQUIRE(bounded.shape() == Shape{margin + side, side, 1});
    const auto at = [&](std::int64_t row, std::int64_t column) {
        return bounded.values<float>()[static_cast<std::size_t>(row * side + column)];
    };
    CHECK(at(0, 0) == 0.5F);
    CHECK(at(margin, 0) == 0.5F);
    CHECK(at(margin, 3) == 0.75F);
    CHECK(at(margin + 1, 0) == 0.75F);  // of at most 0.5 + (1 / 2)^2
    CHECK(at(margin + side - 1, 0) == 0.75F);
    CHECK_THROWS_AS(bounded_at_top(alone, alone), ShapeError);
}

TEST_CASE("a head that does not reach the top is not looked at with its surroundings") {
    const HeadMaskModel model = make_head_mask_model(Rng(1));
    const Tensor crop = Rng(2).uniform({64, 64, 3}, 0.0, 1.0);
    for (const double answer : {-100.0, 100.0}) {
        for (const Parameter& parameter : model.store->all())
            if (parameter.name() == "head_mask.answer.bias")
                parameter.set_value(Tensor::full(parameter.variable().shape(), answer));
        bool asked = false;
        const Tensor mask = head_mask(model, crop, [&] {
            asked = true;
            return Tensor::full({80, 80, 3}, 0.5);
        });
        CHECK(mask.shape() == Shape{64, 64, 1});
        CHECK(asked == (answer > 0.0));
        CHECK(covered_share(mask) == (answer > 0.0 ? 1.0 : 0.0));
    }
}

TEST_CASE("intersection over union counts pixels") {
    const Tensor left =
        filled(10, [](std::int64_t, std::int64_t column) { return column < 6 ? 1 : 0; });
    const Tensor right =
        filled(10, [](std::int64_t, std::int64_t column) { return column >= 4 ? 1 : 0; });
    CHECK(intersection_over_union(left, right) == Approx(0.2));
    CHECK(intersection_over_union(Tensor::zeros({4, 4, 1}), Tensor::zeros({4, 4, 1})) == 1.0);
    CHECK_THROWS_AS(intersection_over_union(left, Tensor::zeros({4, 4, 1})), ShapeError);
}

TEST_CASE("masks of the network that ships agree with hand-made ones", "[slow]") {
    const auto shared = shared_data();
    if (!shared) return;
    const std::filesystem::path photos = *shared / "data/celebamask";
    const HeadMaskModel model =
        read_head_mask_model(STYMO_SOURCE_DIR "/configs/models/head-mask/network.safetensors");
    double sum = 0.0;
    constexpr int first = 200, end = 400;  // no training has seen these photos
    for (int i = first; i < end; ++i) {
        const std::string id = "00" + std::to_string(i);
        Tensor truth = read_class_map(photos / "parsing" / (id + ".png"));
        for (float& value : truth.mutable_values<float>())
            value = is_head_class(static_cast<int>(value)) ? 1.0F : 0.0F;
        const Tensor photo = read_image(photos / "images" / (id + ".jpg"));
        sum += intersection_over_union(head_mask(model, photo), truth);
    }
    CHECK(sum / (end - first) >= 0.9);  // the card of the network: 0.906
}

}  // namespace head_mask_tests
