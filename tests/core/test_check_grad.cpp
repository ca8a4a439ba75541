#include <catch2/catch.hpp>
#include <cmath>

#include "core/autograd/grad.h"
#include "core/autograd/node.h"
#include "core/error.h"
#include "core/ops/ops.h"
#include "core/rng.h"
#include "support/check_grad.h"
#include "support/live_nodes.h"

using namespace stymo;
using namespace stymo::test;
using Catch::Matchers::Contains;

namespace {

Tensor some_input(const Shape& shape) {
    return Rng(3).uniform(shape, 0.5, 1.5, DType::float64);
}

Variable sine_with_rule(const Variable& x, const VjpRule& rule) {
    return record("sine_under_test", sin(x.detach()).value(), {x}, Save::input(0), {rule});
}

}  // namespace

TEST_CASE("The gradient checker accepts right rules at every order", "[check_grad]") {
    const GradFunction function = [](const std::vector<Variable>& x) {
        return sin(x[0] * x[1]) / exp(x[1]);
    };
    for (const int order : {1, 2, 3}) {
        const GradReport report = check_grad(
            "composition", function, {some_input({2, 3}), some_input({3})}, {.order = order});
        INFO(report.message);
        CHECK(report.passed);
        CHECK(report.worst_error < 1e-7);
    }
}

TEST_CASE("The gradient checker refuses a wrong rule and explains itself", "[check_grad]") {
    const GradFunction wrong = [](const std::vector<Variable>& x) {
        return sine_with_rule(x[0], [](const Vjp& v) { return v.grad() * sin(v.input(0)); });
    };
    const GradReport report = check_grad("wrong sine", wrong, {some_input({3})}, {.seed = 11});
    CHECK_FALSE(report.passed);
    CHECK(report.worst_error > 1e-3);
    for (const char* part : {"[wrong sine]", "order 1", "input 0", "(3)", "seed 11", "exact",
                             "numeric", "element 2:"}) {
        CHECK_THAT(report.message, Contains(part));
    }
    const GradReport large = check_grad("wrong sine", wrong, {some_input({100})});
    CHECK_FALSE(large.passed);
    CHECK_THAT(large.message, !Contains("element"));
}

TEST_CASE("The gradient checker refuses a rule that is right only at order 1", "[check_grad]") {
    const GradFunction wrong = [](const std::vector<Variable>& x) {
        return sine_with_rule(x[0],
                              [](const Vjp& v) { return v.grad() * cos(v.input(0)).detach(); });
    };
    CHECK(check_grad("half right", wrong, {some_input({3})}, {.order = 1}).passed);
    const GradReport report = check_grad("half right", wrong, {some_input({3})});
    CHECK_FALSE(report.passed);
    CHECK_THAT(report.message, Contains("order 2, input 0"));
}

TEST_CASE("The gradient checker refuses a rule that drops the cotangent's graph", "[check_grad]") {
    const GradFunction wrong = [](const std::vector<Variable>& x) {
        return sine_with_rule(x[0],
                              [](const Vjp& v) { return v.grad().detach() * cos(v.input(0)); });
    };
    const GradReport report = check_grad("detached", wrong, {some_input({3})});
    CHECK_FALSE(report.passed);
    CHECK_THAT(report.message, Contains("order 2, cotangent 0"));
}

TEST_CASE(
    "The gradient checker finds one wrong element among many and an error of one in ten thousand",
    "[check_grad]") {
    const GradFunction one_element = [](const std::vector<Variable>& x) {
        return sine_with_rule(x[0], [](const Vjp& v) {
            Tensor factor = Tensor::full(v.shape(0), 1.0, DType::float64);
            factor.mutable_values<double>()[512] = 1.01;
            return v.grad() * cos(v.input(0)) * Variable(factor);
        });
    };
    CHECK_FALSE(check_grad("one of 1024", one_element, {some_input({1024})}, {.order = 1}).passed);
    const GradFunction slightly = [](const std::vector<Variable>& x) {
        return sine_with_rule(x[0],
                              [](const Vjp& v) { return v.grad() * cos(v.input(0)) * 1.0001; });
    };
    CHECK_FALSE(check_grad("slightly wrong", slightly, {some_input({4})}, {.order = 1}).passed);
}

TEST_CASE("The gradient checker needs float64 and leaves constants alone", "[check_grad]") {
    const GradFunction product = [](const std::vector<Variable>& x) {
        return x[0] * x[1].detach();
    };
    CHECK_THROWS_AS(
        check_grad("product", product, {some_input({2}).to(DType::float32), some_input({2})}),
        TypeError);
    CHECK_FALSE(check_grad("product", product, {some_input({2}), some_input({2})}).passed);
    CHECK(check_grad("product", product, {some_input({2}), some_input({2})}, {.constants = {1}})
              .passed);
}

TEST_CASE("The count of live nodes notices a rule that holds its own output", "[check_grad]") {
    const LiveNodes live;
    const auto own_output = std::make_shared<Variable>();
    {
        const Variable x = Variable::leaf(some_input({2}));
        *own_output = record("leaky", x.value(), {x}, Save::none(),
                             {[own_output](const Vjp& v) { return v.grad(); }});
    }
    CHECK(live.added() == 2);
    *own_output = Variable();
    CHECK(live.added() == 0);
}
