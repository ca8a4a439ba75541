#include <catch2/catch.hpp>
#include <cmath>
#include <vector>

#include "core/autograd/grad.h"
#include "core/ops/ops.h"
#include "core/rng.h"

using namespace stymo;

namespace {

struct Form {
    Shape x, weight;
    Conv2dOptions options;
};

Variable drawn(const Shape& shape, const char* name, DType dtype) {
    return Variable::leaf(Rng(5).split(name).normal(shape, 0.0, 1.0).to(dtype));
}

double inner_product(const Variable& a, const Variable& b) {
    return sum(a * b).value().item();
}

}  // namespace

// The rows of the table have too few channels for the forms that these sizes take; the forward form
// is the same for all.
TEST_CASE("The adjoints of a convolution with many channels have its inner products", "[conv]") {
    const std::vector<Form> forms{
        {{2, 9, 11, 16}, {24, 3, 3, 16}, {.stride = 2}},
        {{1, 10, 7, 32}, {8, 3, 3, 32}, {.stride = 2, .padding = 1}},
        {{1, 13, 12, 9}, {160, 5, 4, 9}, {.stride = 3, .padding = 2}},
        {{2, 8, 8, 16}, {12, 1, 1, 16}, {.stride = 2}},
        {{1, 6, 9, 24}, {16, 3, 3, 12}, {.stride = 2, .padding = 1, .groups = 2}},
        {{1, 7, 7, 513}, {16, 3, 3, 513}, {.padding = 1}},
        {{2, 24, 40, 3}, {16, 7, 7, 3}, {.stride = 2, .padding = 3}},
        {{1, 70, 600, 3}, {4, 3, 3, 3}, {.padding = 1}},
    };
    for (const Form& form : forms) {
        INFO("x " << form.x << ", weight " << form.weight << ", stride " << form.options.stride);
        const Variable x = drawn(form.x, "x", DType::float64);
        const Variable weight = drawn(form.weight, "weight", DType::float64);
        const Variable y = conv2d(x, weight, form.options);
        const Variable dL_dy = drawn(y.shape(), "dL_dy", DType::float64);
        const double expected = inner_product(y, dL_dy);
        CHECK(inner_product(x, conv2d_transpose(dL_dy, weight, form.x, form.options)) ==
              Approx(expected).epsilon(1e-9));
        CHECK(inner_product(weight, conv2d_weight_grad(dL_dy, x, form.weight, form.options)) ==
              Approx(expected).epsilon(1e-9));
    }
}

TEST_CASE("A convolution with bias and leaky ReLU is its composition, whichever form it takes",
          "[conv][winograd]") {
    const std::vector<Form> forms{
        {{1, 40, 36, 16}, {32, 3, 3, 16}, {.padding = 1}},
        {{1, 9, 9, 16}, {32, 3, 3, 16}, {.stride = 2}},
        {{1, 9, 9, 6}, {6, 3, 3, 1}, {.padding = 1, .groups = 6}},
        {{1, 4, 4, 513}, {16, 3, 3, 513}, {.padding = 1}},
    };
    for (const Form& form : forms) {
        INFO("x " << form.x << ", weight " << form.weight);
        const Variable x = drawn(form.x, "x", DType::float32);
        const Variable weight = drawn(form.weight, "weight", DType::float32);
        const Variable bias = drawn({form.weight[0]}, "bias", DType::float32);
        const std::vector<Variable> leaves{x, weight, bias};
        const Variable fused = conv2d(x, weight, bias, 0.2, form.options);
        const Variable composed = leaky_relu(conv2d(x, weight, form.options) + bias, 0.2);
        CHECK(fused.value().to_vector() == composed.value().to_vector());
        const Variable dL_dy = drawn(fused.shape(), "dL_dy", DType::float32);
        const std::vector<Variable> of_fused =
            grad(fused, leaves, {.create_graph = false, .dL_dy = dL_dy});
        const std::vector<Variable> of_composed =
            grad(composed, leaves, {.create_graph = false, .dL_dy = dL_dy});
        for (std::size_t k = 0; k < leaves.size(); ++k)
            CHECK(of_fused[k].value().to_vector() == of_composed[k].value().to_vector());
        const Variable frozen =
            conv2d(x, Variable(weight.value()), Variable(bias.value()), 0.2, form.options);
        for (const bool create_graph : {false, true}) {
            const Variable of_frozen =
                grad(frozen, x, {.create_graph = create_graph, .dL_dy = dL_dy});
            CHECK(of_frozen.value().to_vector() == of_composed[0].value().to_vector());
        }
    }
}
