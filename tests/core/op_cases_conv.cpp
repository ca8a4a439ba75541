#include "core/op_cases.h"
#include "core/ops/ops.h"

namespace stymo::test {
namespace {

struct ConvForm {
    const char* name;
    Shape x;
    Shape weight;
    Conv2dOptions options;
};

/// Every product that a convolution adds up: an element of the output, of the input and of the
/// weight.
template <class Visit>
void for_each_product(const std::vector<std::int64_t>& x, const std::vector<std::int64_t>& weight,
                      const Conv2dOptions& options, Visit visit) {
    const std::int64_t height = (x[1] + 2 * options.padding - weight[1]) / options.stride + 1;
    const std::int64_t width = (x[2] + 2 * options.padding - weight[2]) / options.stride + 1;
    const std::int64_t outputs_per_group = weight[0] / options.groups;
    for_each_index({x[0], height, width, weight[0]}, [&](const Index& out) {
        for_each_index({weight[1], weight[2], weight[3]}, [&](const Index& tap) {
            const std::int64_t row = out[1] * options.stride + tap[0] - options.padding;
            const std::int64_t column = out[2] * options.stride + tap[1] - options.padding;
            if (row < 0 || row >= x[1] || column < 0 || column >= x[2]) return;
            const std::int64_t channel = out[3] / outputs_per_group * weight[3] + tap[2];
            visit(out, Index{out[0], row, column, channel}, Index{out[3], tap[0], tap[1], tap[2]});
        });
    });
}

Array zeros(const std::vector<std::int64_t>& extents) {
    return generate(extents, [](const Index&) { return 0.0; });
}

std::vector<std::int64_t> extents_of(const Shape& shape) {
    return {shape.extents().begin(), shape.extents().end()};
}

Shape output_shape(const Shape& x, const Shape& weight, const Conv2dOptions& options) {
    return {x[0], (x[1] + 2 * options.padding - weight[1]) / options.stride + 1,
            (x[2] + 2 * options.padding - weight[2]) / options.stride + 1, weight[0]};
}

std::vector<OpCase> cases_of(const ConvForm& form, bool with_speed) {
    const Conv2dOptions options = form.options;
    const Shape y = output_shape(form.x, form.weight, options);
    const std::vector<std::int64_t> x_extents = extents_of(form.x);
    const std::vector<std::int64_t> weight_extents = extents_of(form.weight);
    std::vector<OpCase> rows;
    rows.push_back({"conv2d",
                    form.name,
                    {{form.x}, {form.weight}},
                    [=](const auto& v) { return conv2d(v[0], v[1], options); },
                    [=](const std::vector<Array>& v) {
                        Array out = zeros(extents_of(y));
                        for_each_product(x_extents, weight_extents, options,
                                         [&](const Index& o, const Index& i, const Index& w) {
                                             out.at(o) += v[0].at(i) * v[1].at(w);
                                         });
                        return out;
                    }});
    // The benchmark's convolution keeps height and width, so the shapes that its adjoints need
    // follow from their inputs.
    rows.push_back({"conv2d_transpose",
                    form.name,
                    {{y}, {form.weight}},
                    [=](const auto& v) {
                        const Shape shape =
                            v[0].shape() == y ? form.x : v[0].shape().with(3, v[1].shape(3));
                        return conv2d_transpose(v[0], v[1], shape, options);
                    },
                    [=](const std::vector<Array>& v) {
                        Array out = zeros(x_extents);
                        for_each_product(x_extents, weight_extents, options,
                                         [&](const Index& o, const Index& i, const Index& w) {
                                             out.at(i) += v[0].at(o) * v[1].at(w);
                                         });
                        return out;
                    }});
    rows.push_back({"conv2d_weight_grad",
                    form.name,
                    {{y}, {form.x}},
                    [=](const auto& v) {
                        const Shape shape = v[0].shape() == y
                                                ? form.weight
                                                : Shape{v[0].shape(3), 3, 3, v[1].shape(3)};
                        return conv2d_weight_grad(v[0], v[1], shape, options);
                    },
                    [=](const std::vector<Array>& v) {
                        Array out = zeros(weight_extents);
                        for_each_product(x_extents, weight_extents, options,
                                         [&](const Index& o, const Index& i, const Index& w) {
                                             out.at(w) += v[0].at(o) * v[1].at(i);
                                         });
                        return out;
                    }});
    if (with_speed) {
        const Shape image{2, 64, 64, 32};
        const Shape weight{32, 3, 3, 32};
        rows[0].speed_shapes = {image, weight};
        rows[1].speed_shapes = {image, weight};
        rows[2].speed_shapes = {image, image};
    }
    return rows;
}

/// The bias keeps the leaky ReLU's argument away from 0: at least 0.9, against 0.72 at most of the
/// sum.
OpCase finished_case(const char* form, double slope, const Conv2dOptions& options) {
    const Shape x{2, 4, 3, 2};
    const Shape weight{3, 3, 3, 2};
    const std::vector<std::int64_t> extents = extents_of(output_shape(x, weight, options));
    return {"conv2d",
            form,
            {{x, -0.2, 0.2}, {weight, -0.2, 0.2}, {{3}, -1.0, 1.0, 2.0, 1.0}},
            [=](const auto& v) { return conv2d(v[0], v[1], v[2], slope, options); },
            [=](const std::vector<Array>& v) {
                Array out = zeros(extents);
                for_each_product(extents_of(x), extents_of(weight), options,
                                 [&](const Index& o, const Index& i, const Index& w) {
                                     out.at(o) += v[0].at(i) * v[1].at(w);
                                 });
                for_each_index(extents, [&](const Index& o) {
                    const double sum = out.at(o) + v[2].at({o[3]});
                    out.at(o) = sum > 0.0 ? sum : slope * sum;
                });
                return out;
            }};
}

}  // namespace

std::vector<OpCase> conv_cases() {
    const std::vector<ConvForm> forms{
        {"3x3, padding 1", {2, 4, 3, 2}, {3, 3, 3, 2}, {1, 1, 1}},
        {"3x3, stride 2 with a rest", {1, 6, 5, 2}, {2, 3, 3, 2}, {2, 1, 1}},
        {"2x3, no padding", {1, 4, 4, 2}, {2, 2, 3, 2}, {1, 0, 1}},
        {"1x1", {2, 2, 3, 3}, {4, 1, 1, 3}, {1, 0, 1}},
        {"1x1, stride 2", {1, 4, 3, 2}, {2, 1, 1, 2}, {2, 0, 1}},
        {"3x3, 2 groups", {1, 4, 3, 4}, {4, 3, 3, 2}, {1, 1, 2}},
        {"3x3, depthwise, stride 2", {1, 5, 4, 3}, {3, 3, 3, 1}, {2, 1, 3}},
        {"4x4, padding 2", {1, 3, 3, 2}, {1, 4, 4, 2}, {1, 2, 1}},
    };
    std::vector<OpCase> rows;
    for (const ConvForm& form : forms) {
        const std::vector<OpCase> family = cases_of(form, rows.empty());
        rows.insert(rows.end(), family.begin(), family.end());
    }
    rows.push_back(finished_case("bias", 1.0, {.padding = 1}));
    rows.push_back(finished_case("bias and leaky relu", 0.2, {.padding = 1}));
    rows.push_back(finished_case("bias and relu, stride 2", 0.0, {.stride = 2, .padding = 1}));
    return rows;
}

}  // namespace stymo::test
