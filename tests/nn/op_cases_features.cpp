#include <cmath>

#include "core/op_cases.h"
#include "core/ops/ops.h"
#include "nn/pretrained/perceptual/feature_distance.h"

namespace stymo::test {
namespace {

Array normalised(const Array& x) {
    return generate(x.extents, [&](const Index& at) {
        double squared = 0.0;
        for (std::int64_t c = 0; c < x.extents[3]; ++c)
            squared += std::pow(x.at({at[0], at[1], at[2], c}), 2.0);
        return x.at(at) / (std::sqrt(squared) + 1e-10);
    });
}

Array distance(const Array& x) {
    const Array direction = normalised(x);
    const auto pixels = static_cast<double>(x.extents[1] * x.extents[2]);
    Array total = generate({x.extents[0]}, [](const Index&) { return 0.0; });
    double i = 0.0;
    for_each_index(x.extents, [&](const Index& at) {
        const double difference = direction.at(at) - wave(i++, -0.5, 0.5);
        total.at({at[0]}) +=
            wave(static_cast<double>(at[3]), 0.1, 1.0) * difference * difference / pixels;
    });
    return total;
}

using Distance = Variable (*)(const Variable&, const Tensor&, const Tensor&);

OpCase distance_case(const char* name, Distance function) {
    return {name,
            "images",
            {{{2, 2, 3, 4}}},
            [function](const auto& x) {
                return function(x[0], constant(x[0].shape(), -0.5, 0.5, x[0].dtype()),
                                constant({x[0].shape(3)}, 0.1, 1.0, x[0].dtype()));
            },
            [](const std::vector<Array>& x) { return distance(x[0]); },
            {{1, 64, 64, 64}}};
}

}  // namespace

std::vector<OpCase> feature_cases() {
    return {distance_case("feature_distance", feature_distance),
            distance_case("feature_distance_reference", feature_distance_reference)};
}

}  // namespace stymo::test
