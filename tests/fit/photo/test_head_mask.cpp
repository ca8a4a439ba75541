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
    CHECK(sum / (end - first) >= 0.89);  // the card of the network: 0.896
}

}  // namespace head_mask_tests
