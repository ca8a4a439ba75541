#include <catch2/catch.hpp>
#include <cmath>

#include "core/error.h"
#include "fit/photo/head_mask.h"
#include "render/parsing_classes.h"

namespace head_mask_tests {

using namespace stymo;

namespace {

constexpr std::int64_t side = 512;

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

int index_of(ParsingClass part) {
    return static_cast<int>(part);
}

}  // namespace

TEST_CASE("hair loses seven pixels towards the background and none towards the face") {
    // Hair above skin, both in the same columns; the skin keeps its borders.
    const Tensor classes = filled(side, [](std::int64_t row, std::int64_t column) {
        if (within(row, column, 100, 100, 200, 300)) return index_of(ParsingClass::hair);
        if (within(row, column, 200, 100, 400, 300)) return index_of(ParsingClass::skin);
        return index_of(ParsingClass::background);
    });
    const Tensor expected = filled(side, [](std::int64_t row, std::int64_t column) {
        if (within(row, column, 107, 107, 200, 293)) return 1;
        // A hair pixel in the row above the skin touches one pixel of background and one of face,
        // whose mean is not below its own.
        return within(row, column, 200, 100, 400, 300) ? 1 : 0;
    });
    const Tensor mask = head_mask_from_parsing(classes);
    CHECK(mask.values<float>()[110 * side + 200] == 1.0F);
    CHECK(mask.values<float>()[106 * side + 200] == 0.0F);
    CHECK(mask.values<float>()[150 * side + 106] == 0.0F);
    CHECK(mask.values<float>()[150 * side + 107] == 1.0F);
    CHECK(mask.values<float>()[200 * side + 100] == 1.0F);
    // Only the corners where hair, skin and background meet differ from the two rectangles.
    CHECK(intersection_over_union(mask, expected) > 0.999);
}

TEST_CASE("a head mask has neither neck, clothes nor hat, and only one component") {
    const Tensor classes = filled(side, [](std::int64_t row, std::int64_t column) {
        if (within(row, column, 50, 50, 100, 100)) return index_of(ParsingClass::skin);
        if (within(row, column, 200, 200, 400, 400)) return index_of(ParsingClass::skin);
        if (within(row, column, 400, 200, 450, 400)) return index_of(ParsingClass::neck);
        if (within(row, column, 150, 200, 200, 400)) return index_of(ParsingClass::hat);
        if (within(row, column, 400, 180, 410, 200))
            return index_of(ParsingClass::earring);  // touches by a corner
        return index_of(ParsingClass::cloth);
    });
    const Tensor expected = filled(side, [](std::int64_t row, std::int64_t column) {
        return within(row, column, 200, 200, 400, 400) || within(row, column, 400, 180, 410, 200)
                   ? 1
                   : 0;
    });
    CHECK(intersection_over_union(head_mask_from_parsing(classes), expected) == 1.0);
}

TEST_CASE("cleaning a mask keeps its largest component and fills its holes") {
    const Tensor mask = filled(40, [](std::int64_t row, std::int64_t column) {
        if (within(row, column, 15, 15, 20, 20)) return 0.5;  // a hole: not above one half
        if (within(row, column, 10, 10, 30, 30)) return 0.75;
        return within(row, column, 0, 0, 5, 5) ? 1.0 : 0.0;
    });
    const Tensor expected = filled(40, [](std::int64_t row, std::int64_t column) {
        return within(row, column, 10, 10, 30, 30) ? 1 : 0;
    });
    const Tensor cleaned = clean_head_mask(mask);
    CHECK(intersection_over_union(cleaned, expected) == 1.0);
    CHECK(covered_share(cleaned) == Approx(400.0 / 1600.0));
    CHECK(covered_share(clean_head_mask(Tensor::zeros({8, 8, 1}))) == 0.0);
    CHECK(covered_share(clean_head_mask(Tensor::full({8, 8, 1}, 1.0))) == 1.0);
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

}  // namespace head_mask_tests
