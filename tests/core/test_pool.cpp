#include <catch2/catch.hpp>
#include <cmath>

#include "core/autograd/grad.h"
#include "core/error.h"
#include "core/ops/ops.h"

using namespace stymo;

namespace {

Variable row_of(const std::vector<double>& values) {
    return Variable::leaf(
        Tensor::from({1, 1, static_cast<std::int64_t>(values.size()), 1}, values));
}

}  // namespace

TEST_CASE("At a tie the gradient of a maximum goes to the first of its window", "[pool]") {
    const Variable x = Variable::leaf(Tensor::full({1, 4, 4, 1}, 0.5, DType::float64));
    const std::vector<double> dL_dx = grad(sum(max_pool2d(x)), x).value().to_vector();
    CHECK(dL_dx == std::vector<double>{1, 0, 1, 0, 0, 0, 0, 0, 1, 0, 1, 0, 0, 0, 0, 0});
}

TEST_CASE("Where windows overlap an element takes the gradient of each that chose it", "[pool]") {
    const Variable x = row_of({1, 2, 5, 4, 3, 0, 7});
    CHECK_THROWS_AS(max_pool2d(x, {.kernel = 3, .stride = 2}), ShapeError);
    const Variable y = max_pool2d(reshape(concat({x, x - 9.0, x - 9.0}, 1), {1, 3, 7, 1}),
                                  {.kernel = 3, .stride = 2});
    CHECK(y.value().to_vector() == std::vector<double>{5, 5, 7});
    CHECK(grad(sum(y), x).value().to_vector() == std::vector<double>{0, 0, 2, 0, 0, 0, 1});
}

TEST_CASE("A number that is none is not pooled away", "[pool]") {
    const std::vector<double> values{1, std::nan(""), 2, 3, 4, 5, 6, 7};
    const Variable y = max_pool2d(Variable(Tensor::from({1, 2, 4, 1}, values)));
    CHECK(std::isnan(y.value().to_vector()[0]));
    CHECK(y.value().to_vector()[1] == 7.0);
}

TEST_CASE("A pool that does not fit is refused", "[pool]") {
    const Variable x = Tensor::zeros({1, 2, 2, 1});
    CHECK_THROWS_AS(max_pool2d(x, {.kernel = 3, .stride = 2}), ShapeError);
    CHECK(max_pool2d(x, {.kernel = 3, .stride = 2, .ceil_mode = true}).shape() ==
          Shape{1, 1, 1, 1});
    CHECK_THROWS_AS(max_pool2d(x, {.kernel = 17, .stride = 2}), ValueError);
    const Variable large = Tensor::zeros({1, 16, 16, 1});
    CHECK(max_pool2d(large, {.kernel = 16, .stride = 2}).shape() == Shape{1, 1, 1, 1});
    CHECK_THROWS_AS(max_pool2d(x, {.kernel = 2, .stride = 0}), ValueError);
    CHECK_THROWS_AS(max_pool2d(Tensor::zeros({2, 2, 1})), ShapeError);
}
