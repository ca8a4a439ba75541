#include <catch2/catch.hpp>
#include <cmath>
#include <string>
#include <vector>

#include "core/kernels/conv_algorithms.h"
#include "core/rng.h"
#include "core/tensor.h"
#include "support/thread_count.h"

namespace stymo::test {
namespace {

using kernels::ConvGeometry;

struct Form {
    Shape x, weight;
    int padding;

    [[nodiscard]] Shape y() const {
        return {x[0], x[1] + 2 * padding - 2, x[2] + 2 * padding - 2, weight[0]};
    }
    [[nodiscard]] ConvGeometry geometry() const { return {x, weight, y(), {.padding = padding}}; }
};

/// What the three convolutions give from the same draws.
struct Results {
    Tensor y, dL_dx, dL_dweight;
};

template <class T>
Tensor draw(const Shape& shape, const char* name) {
    return Rng(3).split(name).normal(shape, 0.0, 1.0).to(dtype_of<T>());
}

template <class T>
Results direct(const Form& form) {
    const Tensor x = draw<T>(form.x, "x");
    const Tensor weight = draw<T>(form.weight, "weight");
    const Tensor dL_dy = draw<T>(form.y(), "dL_dy");
    Results r{Tensor(form.y(), dtype_of<T>()), Tensor(form.x, dtype_of<T>()),
              Tensor(form.weight, dtype_of<T>())};
    const auto in = [](const Tensor& t) { return t.values<T>().data(); };
    kernels::direct_conv2d(in(x), in(weight), {}, r.y.mutable_values<T>().data(), form.geometry());
    kernels::direct_conv2d_transpose(in(dL_dy), in(weight), r.dL_dx.mutable_values<T>().data(),
                                     form.geometry());
    kernels::direct_conv2d_weight_grad(in(dL_dy), in(x), r.dL_dweight.mutable_values<T>().data(),
                                       form.geometry());
    return r;
}

Results winograd(const Form& form) {
    const Tensor x = draw<float>(form.x, "x");
    const Tensor weight = draw<float>(form.weight, "weight");
    const Tensor dL_dy = draw<float>(form.y(), "dL_dy");
    Results r{Tensor(form.y()), Tensor(form.x), Tensor(form.weight)};
    const auto in = [](const Tensor& t) { return t.values<float>().data(); };
    kernels::winograd_conv2d(in(x), in(weight), {}, r.y.mutable_values<float>().data(),
                             form.geometry());
    kernels::winograd_conv2d_transpose(in(dL_dy), {}, in(weight),
                                       r.dL_dx.mutable_values<float>().data(), form.geometry());
    kernels::winograd_conv2d_weight_grad(
        in(dL_dy), in(x), r.dL_dweight.mutable_values<float>().data(), form.geometry());
    return r;
}

struct Error {
    double root_mean_square, largest;
};

/// Relative to the root mean square of what is expected.
Error error_of(const Tensor& result, const Tensor& expected) {
    const std::vector<double> values = result.to_vector();
    const std::vector<double> wanted = expected.to_vector();
    double squares = 0.0;
    double norm = 0.0;
    double largest = 0.0;
    for (std::size_t i = 0; i < values.size(); ++i) {
        const double difference = values[i] - wanted[i];
        squares += difference * difference;
        norm += wanted[i] * wanted[i];
        largest = std::max(largest, std::abs(difference));
    }
    return {std::sqrt(squares / norm),
            largest / std::sqrt(norm / static_cast<double>(values.size()))};
}

const std::vector<Form>& forms() {
    static const std::vector<Form> all{
        {{1, 8, 8, 16}, {16, 3, 3, 16}, 1}, {{2, 9, 7, 32}, {16, 3, 3, 32}, 1},
        {{1, 3, 3, 16}, {32, 3, 3, 16}, 0}, {{3, 5, 11, 16}, {48, 3, 3, 16}, 0},
        {{1, 1, 1, 16}, {16, 3, 3, 16}, 1}, {{1, 6, 14, 16}, {16, 3, 3, 16}, 2},
        {{1, 2, 3, 16}, {16, 3, 3, 16}, 3}, {{2, 13, 29, 64}, {64, 3, 3, 64}, 1},
    };
    return all;
}

}  // namespace

TEST_CASE("Winograd's convolutions agree with the direct ones in float64 at every size and padding",
          "[winograd]") {
    for (const Form& form : forms()) {
        INFO("x " << form.x << ", weight " << form.weight << ", padding " << form.padding);
        const Results expected = direct<double>(form);
        const Results result = winograd(form);
        CHECK(error_of(result.y, expected.y).largest < 2e-5);
        CHECK(error_of(result.dL_dx, expected.dL_dx).largest < 2e-5);
        CHECK(error_of(result.dL_dweight, expected.dL_dweight).largest < 2e-5);
    }
}

TEST_CASE("Winograd's convolutions round a few times more than the direct ones", "[winograd]") {
    const Form form{{1, 32, 32, 128}, {128, 3, 3, 128}, 1};
    const Results exact = direct<double>(form);
    const Results plain = direct<float>(form);
    const Results fast = winograd(form);
    const auto report = [](const char* what, const Tensor& exact_value, const Tensor& plain_value,
                           const Tensor& fast_value) {
        const Error direct_error = error_of(plain_value, exact_value);
        const Error winograd_error = error_of(fast_value, exact_value);
        UNSCOPED_INFO(what << ": direct " << direct_error.root_mean_square << " (largest "
                           << direct_error.largest << "), Winograd "
                           << winograd_error.root_mean_square << " (largest "
                           << winograd_error.largest << ")");
        CHECK(winograd_error.root_mean_square < 2e-6);
        CHECK(winograd_error.largest < 2e-5);
    };
    report("output", exact.y, plain.y, fast.y);
    report("input's gradient", exact.dL_dx, plain.dL_dx, fast.dL_dx);
    report("weight's gradient", exact.dL_dweight, plain.dL_dweight, fast.dL_dweight);
}

TEST_CASE("Winograd's and direct convolutions give the same bits on any number of threads",
          "[winograd]") {
    const Form form{{2, 21, 19, 32}, {48, 3, 3, 32}, 1};
    const ThreadCount restored;
    const auto all = [&](int threads) {
        set_thread_count(threads);
        const Results a = winograd(form);
        const Results b = direct<float>(form);
        std::vector<std::vector<double>> values;
        for (const Tensor& t : {a.y, a.dL_dx, a.dL_dweight, b.y, b.dL_dx, b.dL_dweight})
            values.push_back(t.to_vector());
        return values;
    };
    CHECK(all(1) == all(3));
}

}  // namespace stymo::test
