#include <algorithm>
#include <limits>

#include "core/op_cases.h"
#include "core/ops/ops.h"

namespace stymo::test {
namespace {

/// Keeps the elements further apart than the step of finite differences.
constexpr double wide = 500.0;

Array pooled(const Array& x, const MaxPoolOptions& options, std::int64_t height,
             std::int64_t width) {
    return generate({x.extents[0], height, width, x.extents[3]}, [&](const Index& i) {
        double largest = -std::numeric_limits<double>::infinity();
        for_each_index({options.kernel, options.kernel}, [&](const Index& tap) {
            const std::int64_t row = i[1] * options.stride + tap[0];
            const std::int64_t column = i[2] * options.stride + tap[1];
            if (row < x.extents[1] && column < x.extents[2])
                largest = std::max(largest, x.at({i[0], row, column, i[3]}));
        });
        return largest;
    });
}

/// `height` and `width`: of the result, counted by hand.
OpCase pool_case(const char* form, const Shape& shape, const MaxPoolOptions& options,
                 std::int64_t height, std::int64_t width) {
    return {"max_pool2d",
            form,
            {{.shape = shape, .low = -wide, .high = wide}},
            [=](const auto& x) { return max_pool2d(x[0], options); },
            [=](const std::vector<Array>& x) { return pooled(x[0], options, height, width); }};
}

}  // namespace

std::vector<OpCase> pool_cases() {
    std::vector<OpCase> rows;
    rows.push_back(pool_case("2x2", {2, 4, 6, 2}, {}, 2, 3));
    rows.back().speed_shapes = {{2, 128, 128, 64}};
    rows.push_back(pool_case("3x3, stride 2 with a rest", {1, 6, 7, 2}, {3, 2}, 2, 3));
    rows.push_back(pool_case("3x3, stride 2, ceil", {1, 6, 7, 2}, {3, 2, true}, 3, 3));
    rows.push_back(pool_case("2x2, stride 3, ceil", {1, 4, 6, 1}, {2, 3, true}, 2, 2));
    // Squared, because a second derivative of the maximum alone is 0.
    rows.push_back({"max_pool2d",
                    "3x3, stride 1, squared",
                    {{.shape = {1, 4, 4, 2}, .low = -wide, .high = wide}},
                    [](const auto& x) {
                        return square(max_pool2d(x[0], {3, 1}));
                    },
                    [](const std::vector<Array>& x) {
                        Array y = pooled(x[0], {3, 1}, 2, 2);
                        for (double& value : y.values) value *= value;
                        return y;
                    }});
    return rows;
}

}  // namespace stymo::test
