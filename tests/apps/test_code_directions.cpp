#include <catch2/catch.hpp>
#include <cmath>

#include "apps/view/code_directions.h"
#include "core/error.h"
#include "support/tiny_model.h"

using namespace stymo;
using namespace stymo::test;

namespace {

double length(const Tensor& values) {
    double sum = 0.0;
    for (const double value : values.to_vector()) sum += value * value;
    return std::sqrt(sum);
}

/// Faces that differ along one known direction of texture and one of light.
Codes faces_along(std::span<const double> amounts) {
    const auto count = std::ssize(amounts);
    Codes codes;
    for (std::size_t group = 0; group < code_names.size(); ++group) {
        Tensor rows = Tensor::zeros({count, code_sizes[group]});
        const std::span<float> values = rows.mutable_values<float>();
        for (std::int64_t face = 0; face < count && group >= 2; ++face) {
            const auto first = static_cast<std::size_t>(face * code_sizes[group]);
            const auto amount = static_cast<float>(amounts[static_cast<std::size_t>(face)]);
            values[first + 3] = group == 2 ? 3.0F * amount : 0.0F;
            values[first + 7] = group == 2 ? -4.0F * amount : amount;
        }
        codes.groups[group] = Variable(rows);
    }
    return codes;
}

}  // namespace

TEST_CASE("the leading direction of a group is the one along which its faces differ") {
    const std::vector<double> amounts{-1.0, 0.0, 1.0};  // variance 1
    const auto directions = leading_directions(CodeStatistics::of(faces_along(amounts)), 5);
    CHECK(directions[0].directions.empty());
    CHECK(directions[1].directions.empty());
    REQUIRE(directions[2].directions.size() == 1);
    REQUIRE(directions[3].directions.size() == 1);
    CHECK(directions[2].shares.front() == Approx(1.0));
    const std::vector<double> texture = directions[2].directions.front().to_vector();
    CHECK(texture[3] == Approx(-3.0));  // the element of largest magnitude is positive
    CHECK(texture[7] == Approx(4.0));
    CHECK(length(directions[3].directions.front()) == Approx(1.0));
}

TEST_CASE("the directions of the shipped model are named by what they change", "[slow]") {
    const Model model = Model::load(STYMO_SOURCE_DIR "/configs/models/faces-256/model.safetensors");
    REQUIRE(model.code_statistics());
    const auto directions = leading_directions(*model.code_statistics(), 5);
    int pictures = 0;
    const auto names =
        direction_names(model, directions,
                        read_landmark_model(STYMO_SOURCE_DIR "/configs/models/landmarks/"
                                                             "landmarks.safetensors"),
                        [&] { ++pictures; });
    CHECK(pictures == 41);  // two for each of 20, and the mean face
    bool opens = false;
    for (std::size_t group = 0; group < names.size(); ++group) {
        REQUIRE(names[group].size() == directions[group].directions.size());
        for (const EndNames& ends : names[group]) {
            CHECK(ends.more.empty() == ends.less.empty());
            opens = opens || ends.more == "mouth open" || ends.less == "mouth open";
        }
    }
    CHECK(opens);
}

TEST_CASE("codes move along the directions by standard deviations") {
    const auto directions =
        leading_directions(CodeStatistics::of(faces_along(std::vector{-1.0, 0.0, 1.0})), 5);
    const Codes face = random_codes(1, 3);
    const Codes moved = moved_along(face, directions, {{{}, {}, {2.0}, {}}});
    const std::vector<double> before = face.texture().value().to_vector(),
                              after = moved.texture().value().to_vector();
    CHECK(after[3] - before[3] == Approx(-6.0).epsilon(1e-5));
    CHECK(after[7] - before[7] == Approx(8.0).epsilon(1e-5));
    CHECK(after[0] == before[0]);
    CHECK(moved.light().value().to_vector() == face.light().value().to_vector());
    CHECK_THROWS_AS(moved_along(face, directions, {{{1.0}, {}, {}, {}}}), ValueError);
}
