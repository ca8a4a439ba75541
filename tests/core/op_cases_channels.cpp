#include <cmath>

#include "core/op_cases.h"
#include "core/ops/ops.h"

namespace stymo::test {
namespace {

Array directions(const Array& x, double epsilon) {
    Array squared_norms =
        generate({x.extents[0], x.extents[1], x.extents[2]}, [](const Index&) { return 0.0; });
    for_each_index(x.extents, [&](const Index& i) {
        squared_norms.at({i[0], i[1], i[2]}) += x.at(i) * x.at(i);
    });
    return generate(x.extents, [&](const Index& i) {
        return x.at(i) / (std::sqrt(squared_norms.at({i[0], i[1], i[2]})) + epsilon);
    });
}

using ChannelFunction = Variable (*)(const Variable&, double);

OpCase direction_case(const char* name, ChannelFunction function) {
    constexpr double epsilon = 0.01;
    return {name,
            "image",
            {{{2, 3, 2, 5}}},
            [=](const auto& x) { return function(x[0], epsilon); },
            [=](const std::vector<Array>& x) { return directions(x[0], epsilon); },
            {{1, 256, 256, 64}}};
}

}  // namespace

std::vector<OpCase> channel_cases() {
    const Shape image{2, 3, 2, 5};
    const Shape large{1, 256, 256, 64};
    return {direction_case("unit_channels", unit_channels),
            direction_case("unit_channels_reference", unit_channels_reference),
            OpCase{"mean_squared_difference",
                   "image",
                   {{image}, {image}},
                   [](const auto& x) { return mean_squared_difference(x[0], x[1]); },
                   [](const std::vector<Array>& x) {
                       Array mean = generate({x[0].extents[0], 1, 1, x[0].extents[3]},
                                             [](const Index&) { return 0.0; });
                       const auto pixels = static_cast<double>(x[0].extents[1] * x[0].extents[2]);
                       for_each_index(x[0].extents, [&](const Index& i) {
                           const double difference = x[0].at(i) - x[1].at(i);
                           mean.at({i[0], 0, 0, i[3]}) += difference * difference / pixels;
                       });
                       return mean;
                   },
                   {large, large}}};
}

}  // namespace stymo::test
