#include <algorithm>
#include <catch2/catch.hpp>
#include <limits>
#include <thread>

#include "core/error.h"
#include "core/ops/ops.h"
#include "core/tensor.h"

using namespace stymo;
using Catch::Matchers::Contains;

TEST_CASE("A shape knows its extents from both ends", "[tensor]") {
    const Shape shape{2, 3, 4};
    CHECK(shape.rank() == 3);
    CHECK(shape.size() == 24);
    CHECK(shape[0] == 2);
    CHECK(shape[-1] == 4);
    CHECK(shape.index(-3) == 0);
    CHECK(shape.product(1, 3) == 12);
    CHECK(shape.with(-1, 5) == Shape{2, 3, 5});
    CHECK(Shape{}.size() == 1);
    CHECK(Shape{0, 3}.size() == 0);
    CHECK_FALSE(Shape{2, 3} == Shape{2, 3, 1});
    CHECK_THROWS_AS(shape[3], ShapeError);
    CHECK_THROWS_AS(shape[-4], ShapeError);
    CHECK_THROWS_AS((Shape{1, -1}), ShapeError);
    CHECK_THROWS_AS((Shape{1, 1, 1, 1, 1, 1, 1}), ShapeError);
    constexpr std::int64_t large = std::int64_t{1} << 32;
    CHECK_THROWS_AS((Shape{large, large}), ShapeError);
    CHECK_THROWS_AS((Shape{large, 1}).with(1, large), ShapeError);
    CHECK((Shape{0, large, large}).size() == 0);
    CHECK((Shape{large, large, 0}).size() == 0);
    std::ostringstream text;
    text << shape;
    CHECK(text.str() == "(2, 3, 4)");
}

TEST_CASE("An extent is never negative", "[tensor]") {
    CHECK_THROWS_AS(Shape({2, -1}), ShapeError);
    CHECK_THROWS_AS(Shape({2, 3}).with(0, -1), ShapeError);
}

TEST_CASE("Shapes broadcast from the last axis or say which op they do not fit", "[tensor]") {
    CHECK(broadcast_shape({2, 1, 4}, {3, 1}, "add") == Shape{2, 3, 4});
    CHECK(broadcast_shape({}, {3, 1}, "add") == Shape{3, 1});
    CHECK_THROWS_AS(broadcast_shape({2}, {3}, "add"), ShapeError);
    CHECK_THROWS_WITH(broadcast_shape({2}, {3}, "add"),
                      Contains("add") && Contains("(2)") && Contains("(3)"));
}

TEST_CASE("Copies of a tensor share their elements until one is written", "[tensor]") {
    Tensor a = Tensor::full({2, 2}, 1.0);
    const Tensor b = a;
    const Tensor view = a.reshaped({4});
    CHECK(a.values<float>().data() == b.values<float>().data());
    CHECK(a.values<float>().data() == view.values<float>().data());
    a.mutable_values<float>()[0] = 5.0F;
    CHECK(a.values<float>()[0] == 5.0F);
    CHECK(b.values<float>()[0] == 1.0F);
    CHECK(view.values<float>()[0] == 1.0F);
    const float* own = a.values<float>().data();
    a.mutable_values<float>()[1] = 6.0F;
    CHECK(a.values<float>().data() == own);
}

TEST_CASE("A tensor is written in place once a reader in another thread has let it go",
          "[tensor]") {
    constexpr std::int64_t count = 1 << 12;
    Tensor tensor = Tensor::zeros({count});
    for (int round = 1; round <= 200; ++round) {
        double seen = 0.0;
        std::jthread reader([copy = tensor, &seen]() mutable {
            for (const float value : copy.values<float>()) seen += value;
            copy = {};
        });
        // Whether the copy is still there or not, the reader sees the old values.
        std::ranges::fill(tensor.mutable_values<float>(), static_cast<float>(round));
        reader.join();
        CHECK(seen == static_cast<double>(count) * (round - 1));
    }
    const float* own = tensor.values<float>().data();
    CHECK(tensor.mutable_values<float>().data() == own);
}

TEST_CASE("A tensor over the elements of others shares them and lets them go at the end",
          "[tensor]") {
    std::vector<double> elements{1.0, 2.0, 3.0};
    int released = 0;
    {
        const Tensor tensor = Tensor::over(
            {3}, DType::float64,
            {reinterpret_cast<std::byte*>(elements.data()), [&](std::byte*) { ++released; }});
        CHECK(tensor.values<double>().data() == elements.data());
        Tensor changed = tensor;
        changed.mutable_values<double>()[0] = 7.0;
        CHECK(elements[0] == 1.0);
        CHECK(released == 0);
    }
    CHECK(released == 1);
}

TEST_CASE("A value in the graph does not change when the tensor it came from is written",
          "[tensor]") {
    Tensor source = Tensor::scalar(2.0, DType::float64);
    const Variable x = Variable::leaf(source);
    source.mutable_values<double>()[0] = 7.0;
    CHECK(x.value().item() == 2.0);
}

TEST_CASE("A tensor converts between its two types and guards them", "[tensor]") {
    const std::vector<double> values{0.5, -1.25, 3.0};
    const Tensor wide = Tensor::from({3}, std::span<const double>(values));
    const Tensor narrow = wide.to(DType::float32);
    CHECK(narrow.dtype() == DType::float32);
    CHECK(narrow.to_vector() == values);
    CHECK_THROWS_AS(wide.values<float>(), TypeError);
    CHECK_THROWS_AS(narrow.values<double>(), TypeError);
    CHECK_THROWS_AS(add(Variable(wide), Variable(narrow)), TypeError);
}

TEST_CASE("What a tensor refuses", "[tensor]") {
    constexpr std::int64_t half = std::int64_t{1} << 32;
    CHECK_THROWS_WITH((Tensor(Shape{half, half})), Contains("too large"));
    CHECK(Tensor(Shape{half, half, 0}).size() == 0);
    const std::vector<float> values{1.0F, 2.0F};
    CHECK_THROWS_AS(Tensor::from({3}, std::span<const float>(values)), ShapeError);
    CHECK_THROWS_AS(Tensor::zeros({2, 3}).reshaped({5}), ShapeError);
    CHECK_THROWS_AS(Tensor::zeros({2}).item(), ShapeError);
    CHECK_THROWS_AS(Tensor().values<float>(), ValueError);
    CHECK_FALSE(Tensor().defined());
    CHECK(Tensor().size() == 0);
}

TEST_CASE("A tensor notices elements that are not finite", "[tensor]") {
    Tensor x = Tensor::zeros({3});
    CHECK(x.all_finite());
    x.mutable_values<float>()[1] = std::numeric_limits<float>::infinity();
    CHECK_FALSE(x.all_finite());
    x.mutable_values<float>()[1] = std::numeric_limits<float>::quiet_NaN();
    CHECK_FALSE(x.all_finite());
}

TEST_CASE("Ops refuse operands that do not fit", "[tensor]") {
    const auto zeros = [](const Shape& shape) { return Variable(Tensor::zeros(shape)); };
    CHECK_THROWS_AS(add(zeros({2}), zeros({3})), ShapeError);
    CHECK_THROWS_AS(matmul(zeros({2, 3}), zeros({2, 3})), ShapeError);
    CHECK_THROWS_AS(matmul(zeros({2, 2, 3}), zeros({3, 3, 2})), ShapeError);
    CHECK_THROWS_AS(linear(zeros({1, 2, 3}), zeros({1, 4, 2}), Variable()), ShapeError);
    CHECK_THROWS_AS(linear(zeros({1, 2, 3}), zeros({1, 4, 3}), zeros({3})), ShapeError);
    CHECK_THROWS_AS(conv2d(zeros({1, 4, 4, 3}), zeros({2, 3, 3, 2})), ShapeError);
    CHECK_THROWS_AS(conv2d(zeros({1, 2, 2, 3}), zeros({2, 3, 3, 3})), ShapeError);
    CHECK_THROWS_AS(reshape(zeros({2, 3}), {4, -1}), ShapeError);
    CHECK_THROWS_AS(reshape(zeros({2, 3}), {-1, -1}), ShapeError);
    CHECK_THROWS_AS(permute(zeros({2, 3}), {0, 0}), ShapeError);
    CHECK_THROWS_AS(permute(zeros({2, 3}), {0}), ShapeError);
    CHECK_THROWS_AS(slice(zeros({2, 3}), 1, 2, 4), ShapeError);
    CHECK_THROWS_AS(slice(zeros({2, 3}), 1, 2, 1), ShapeError);
    CHECK_THROWS_AS(concat({zeros({2, 3}), zeros({2, 4})}, 0), ShapeError);
    CHECK_THROWS_AS(broadcast_to(zeros({2}), {3}), ShapeError);
    CHECK_THROWS_AS(sum_to(zeros({3}), {2}), ShapeError);
    CHECK_THROWS_AS(sum(zeros({2, 3}), {0, 0}), ShapeError);
    CHECK_THROWS_AS(sum(zeros({2, 3}), {2}), ShapeError);
    CHECK_THROWS_AS(gather_rows(zeros({2, 3}), {2}), ValueError);
    CHECK_THROWS_AS(scatter_add_rows(zeros({1, 3}), {-1}, 2), ValueError);
    CHECK_THROWS_AS(pixel_shuffle(zeros({1, 2, 2, 3})), ShapeError);
    CHECK_THROWS_AS(pixel_unshuffle(zeros({1, 3, 2, 3})), ShapeError);
    CHECK_THROWS_AS(resize_box(zeros({1, 4, 4, 1}), 3, 3), ShapeError);
    CHECK_THROWS_AS(blur(zeros({4, 4, 1})), ShapeError);
    CHECK_THROWS_AS(clamp(zeros({1}), 1.0, 0.0), ValueError);
}
