#include <cmath>

#include "core/op_cases.h"
#include "core/ops/ops.h"
#include "nn/ops/blur_upsampled.h"
#include "nn/ops/feature_distance.h"

namespace stymo::test {
namespace {

/// Element i of a constant, as tests/golden/make_op_vectors.py makes it.
double wave(double i, double low, double high) {
    return low + (high - low) * (0.5 + 0.5 * std::sin(1.7 * i + 0.3));
}

Tensor constant(const Shape& shape, double low, double high, DType dtype) {
    Tensor values(shape, DType::float64);
    double i = 0.0;
    for (double& value : values.mutable_values<double>()) value = wave(i++, low, high);
    return values.to(dtype);
}

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

/// [1, 2, 1] / 4 along both axes, with mirrored border.
Array blurred(const Array& x) {
    const auto mirrored = [](std::int64_t i, std::int64_t length) {
        return i < 0 ? -i : (i >= length ? 2 * length - 2 - i : i);
    };
    return generate(x.extents, [&](const Index& at) {
        double sum = 0.0;
        for (std::int64_t i = -1; i <= 1; ++i) {
            for (std::int64_t j = -1; j <= 1; ++j)
                sum += (i == 0 ? 0.5 : 0.25) * (j == 0 ? 0.5 : 0.25) *
                       x.at({at[0], mirrored(at[1] + i, x.extents[1]),
                             mirrored(at[2] + j, x.extents[2]), at[3]});
        }
        return sum;
    });
}

OpCase upsampling_case(const char* name, Variable (*function)(const Variable&, const Variable&),
                       const char* form, const Shape& image) {
    return {name,
            form,
            {{image}, {image.with(3, 4 * image[3])}},
            [function](const auto& x) { return function(x[0], x[1]); },
            [](const std::vector<Array>& x) {
                const auto& e = x[0].extents;
                return blurred(generate({e[0], 2 * e[1], 2 * e[2], e[3]}, [&](const Index& i) {
                    const std::int64_t subpixel = 2 * (i[1] % 2) + i[2] % 2;
                    return x[0].at({i[0], i[1] / 2, i[2] / 2, i[3]}) +
                           x[1].at({i[0], i[1] / 2, i[2] / 2, subpixel * e[3] + i[3]});
                }));
            },
            {{1, 64, 64, 64}, {1, 64, 64, 256}}};
}

}  // namespace

std::vector<OpCase> feature_cases() {
    return {distance_case("feature_distance", feature_distance),
            distance_case("feature_distance_reference", feature_distance_reference),
            upsampling_case("blur_upsampled", blur_upsampled, "images", {2, 2, 3, 2}),
            upsampling_case("blur_upsampled", blur_upsampled, "vectors and a rest", {1, 3, 1, 19}),
            upsampling_case("blur_upsampled_reference", blur_upsampled_reference, "images",
                            {2, 2, 3, 2})};
}

}  // namespace stymo::test
