#include <algorithm>
#include <cmath>

#include "core/op_cases.h"
#include "core/ops/ops.h"

namespace stymo::test {
namespace {

using BinaryFunction = Variable (*)(const Variable&, const Variable&);
using UnaryFunction = std::function<Variable(const Variable&)>;

std::vector<std::int64_t> broadcast_extents(const Array& a, const Array& b) {
    std::vector<std::int64_t> extents(std::max(a.extents.size(), b.extents.size()), 1);
    for (const Array* operand : {&a, &b}) {
        const std::size_t skipped = extents.size() - operand->extents.size();
        for (std::size_t i = 0; i < operand->extents.size(); ++i) {
            extents[skipped + i] = std::max(extents[skipped + i], operand->extents[i]);
        }
    }
    return extents;
}

OpReference pairwise(double (*value)(double, double)) {
    return [value](const std::vector<Array>& x) {
        return generate(broadcast_extents(x[0], x[1]), [&](const Index& i) {
            return value(x[0].broadcast_at(i), x[1].broadcast_at(i));
        });
    };
}

OpReference pointwise(double (*value)(double)) {
    return [value](const std::vector<Array>& x) {
        return generate(x[0].extents, [&](const Index& i) { return value(x[0].at(i)); });
    };
}

void add_binary(std::vector<OpCase>& rows, const char* name, BinaryFunction function,
                double (*value)(double, double), CaseInput a, CaseInput b) {
    struct Form {
        const char* name;
        Shape a;
        Shape b;
    };
    const std::vector<Form> forms{{"same shape", {2, 3}, {2, 3}},
                                  {"row and column", {3, 1}, {1, 4}},
                                  {"channels of an image", {1, 2, 2, 3}, {3}},
                                  {"scalar left", {}, {2, 2}}};
    for (const Form& form : forms) {
        a.shape = form.a;
        b.shape = form.b;
        OpCase row{name,
                   form.name,
                   {a, b},
                   [function](const auto& x) { return function(x[0], x[1]); },
                   pairwise(value)};
        if (rows.empty() || rows.back().op != name) row.speed_shapes = {{4096, 256}, {4096, 256}};
        rows.push_back(row);
    }
}

OpCase unary(const char* name, CaseInput input, const UnaryFunction& function,
             double (*value)(double)) {
    input.shape = {3, 4};
    return {name,
            "elements",
            {input},
            [function](const auto& x) { return function(x[0]); },
            pointwise(value),
            {{4096, 256}}};
}

/// Not 0 in two of three elements.
Tensor mask_for(const Shape& shape, DType dtype) {
    Tensor mask = Tensor::zeros(shape, dtype);
    dispatch(dtype, [&]<class T>(T) {
        const auto values = mask.mutable_values<T>();
        for (std::size_t i = 0; i < values.size(); ++i) values[i] = static_cast<T>(i % 3);
    });
    return mask;
}

Variable masked_choice(const std::vector<Variable>& x) {
    return where(mask_for(broadcast_shape(x[0].shape(), x[1].shape(), "where"), x[0].dtype()), x[0],
                 x[1]);
}

Array masked_choice_reference(const std::vector<Array>& x) {
    std::int64_t index = 0;
    return generate(broadcast_extents(x[0], x[1]), [&](const Index& i) {
        return index++ % 3 != 0 ? x[0].broadcast_at(i) : x[1].broadcast_at(i);
    });
}

}  // namespace

std::vector<OpCase> elementwise_cases() {
    const CaseInput any;
    const CaseInput positive{{}, 0.5, 2.0};
    const CaseInput around_zero{{}, -2.0, 2.0, 0.4, 0.2};
    const CaseInput tick{{}, -1.0, 1.0, 0.2, 0.0};
    const CaseInput tock{{}, -1.0, 1.0, 0.2, 0.1};
    std::vector<OpCase> rows;
    add_binary(
        rows, "add", add, [](double a, double b) { return a + b; }, any, any);
    add_binary(
        rows, "subtract", subtract, [](double a, double b) { return a - b; }, any, any);
    add_binary(
        rows, "multiply", multiply, [](double a, double b) { return a * b; }, any, any);
    add_binary(
        rows, "divide", divide, [](double a, double b) { return a / b; }, any, positive);
    add_binary(
        rows, "maximum", maximum, [](double a, double b) { return a > b ? a : b; }, tick, tock);
    add_binary(
        rows, "minimum", minimum, [](double a, double b) { return a < b ? a : b; }, tick, tock);
    rows.push_back({"where",
                    "same shape",
                    {{{3, 4}}, {{3, 4}}},
                    masked_choice,
                    masked_choice_reference,
                    {{4096, 256}, {4096, 256}}});
    rows.push_back(
        {"where", "row and column", {{{3, 1}}, {{1, 4}}}, masked_choice, masked_choice_reference});
    rows.push_back(unary("negate", any, negate, [](double x) { return -x; }));
    rows.push_back(unary(
        "affine", any, [](const Variable& x) { return affine(x, -1.5, 0.25); },
        [](double x) { return -1.5 * x + 0.25; }));
    rows.push_back(unary("exp", any, exp, [](double x) { return std::exp(x); }));
    rows.push_back(unary("log", positive, log, [](double x) { return std::log(x); }));
    rows.push_back(unary("sin", {{}, -6.0, 6.0}, sin, [](double x) { return std::sin(x); }));
    rows.push_back(unary("cos", {{}, -6.0, 6.0}, cos, [](double x) { return std::cos(x); }));
    rows.push_back(unary("sqrt", positive, sqrt, [](double x) { return std::sqrt(x); }));
    rows.push_back(unary("square", any, square, [](double x) { return x * x; }));
    rows.push_back(unary("abs", around_zero, abs, [](double x) { return std::abs(x); }));
    rows.push_back(unary(
        "clamp", tick, [](const Variable& x) { return clamp(x, -0.5, 0.7); },
        [](double x) { return std::min(std::max(x, -0.5), 0.7); }));
    return rows;
}

std::vector<OpCase> activation_cases() {
    const CaseInput wide{{}, -4.0, 4.0};
    const CaseInput around_zero{{}, -2.0, 2.0, 0.4, 0.2};
    std::vector<OpCase> rows;
    rows.push_back(
        unary("sigmoid", wide, sigmoid, [](double x) { return 1.0 / (1.0 + std::exp(-x)); }));
    rows.push_back(unary("tanh", wide, tanh, [](double x) { return std::tanh(x); }));
    rows.push_back(
        unary("softplus", wide, softplus, [](double x) { return std::log(1.0 + std::exp(x)); }));
    rows.push_back(unary(
        "leaky_relu", around_zero, [](const Variable& x) { return leaky_relu(x, 0.2); },
        [](double x) { return x > 0.0 ? x : 0.2 * x; }));
    rows.push_back(unary("relu", around_zero, relu, [](double x) { return x > 0.0 ? x : 0.0; }));

    rows.push_back({"leaky_gate",
                    "elements",
                    {{{3, 4}}, {{3, 4}, -1.0, 1.0, 0.5, 0.25}},
                    [](const auto& x) { return leaky_gate(x[0], x[1].value(), 0.2); },
                    pairwise([](double x, double sign) { return sign > 0.0 ? x : 0.2 * x; }),
                    {{4096, 256}, {4096, 256}}});

    const auto prelu_reference =
        pairwise([](double x, double slope) { return x > 0.0 ? x : slope * x; });
    const OpFunction prelu_function = [](const auto& x) { return prelu(x[0], x[1]); };
    CaseInput rows_of_channels = around_zero;
    rows_of_channels.shape = {3, 4};
    CaseInput image = around_zero;
    image.shape = {2, 2, 2, 3};
    rows.push_back({"prelu",
                    "rows",
                    {rows_of_channels, {{4}}},
                    prelu_function,
                    prelu_reference,
                    {{4096, 256}, {256}}});
    rows.push_back({"prelu", "image", {image, {{3}}}, prelu_function, prelu_reference});

    rows.push_back({"binary_cross_entropy_with_logits",
                    "elements",
                    {{{3, 4}, -4.0, 4.0}, {{3, 4}, 0.0, 1.0}},
                    [](const auto& x) { return binary_cross_entropy_with_logits(x[0], x[1]); },
                    pairwise([](double x, double target) {
                        const double p = 1.0 / (1.0 + std::exp(-x));
                        return -target * std::log(p) - (1.0 - target) * std::log(1.0 - p);
                    }),
                    {{4096, 256}, {4096, 256}}});
    return rows;
}

}  // namespace stymo::test
