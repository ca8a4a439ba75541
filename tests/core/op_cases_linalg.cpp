#include <cmath>
#include <numbers>

#include "core/op_cases.h"
#include "core/ops/ops.h"

namespace stymo::test {
namespace {

/// Both operands with a leading axis, which repeats where its extent is 1.
Array batched_product(const Array& a, const Array& b, bool transpose_a, bool transpose_b) {
    const std::int64_t batch = std::max(a.extents[0], b.extents[0]);
    const std::int64_t inner = a.extents[transpose_a ? 1 : 2];
    return generate(
        {batch, a.extents[transpose_a ? 2 : 1], b.extents[transpose_b ? 1 : 2]},
        [&](const Index& i) {
            const std::int64_t batch_a = a.extents[0] == 1 ? 0 : i[0];
            const std::int64_t batch_b = b.extents[0] == 1 ? 0 : i[0];
            double total = 0.0;
            for (std::int64_t k = 0; k < inner; ++k) {
                total += (transpose_a ? a.at({batch_a, k, i[1]}) : a.at({batch_a, i[1], k})) *
                         (transpose_b ? b.at({batch_b, i[2], k}) : b.at({batch_b, k, i[2]}));
            }
            return total;
        });
}

Array product(Array a, Array b, bool transpose_a, bool transpose_b) {
    if (a.extents.size() == 3) return batched_product(a, b, transpose_a, transpose_b);
    a.extents.insert(a.extents.begin(), 1);
    b.extents.insert(b.extents.begin(), 1);
    Array result = batched_product(a, b, transpose_a, transpose_b);
    result.extents.erase(result.extents.begin());
    return result;
}

Shape matrix(std::int64_t batch, std::int64_t rows, std::int64_t columns, bool transposed) {
    if (transposed) std::swap(rows, columns);
    return batch == 0 ? Shape{rows, columns} : Shape{batch, rows, columns};
}

void add_products(std::vector<OpCase>& rows) {
    struct Form {
        const char* name;
        std::int64_t batch_a;
        std::int64_t batch_b;
    };
    for (const Form& form : {Form{"matrices", 0, 0}, Form{"batch", 2, 2}, Form{"one left", 1, 2},
                             Form{"one right", 2, 1}}) {
        for (const bool transpose_a : {false, true}) {
            for (const bool transpose_b : {false, true}) {
                const MatmulOptions options{transpose_a, transpose_b};
                const std::string suffix = std::string(transpose_a ? " transposed a" : "") +
                                           (transpose_b ? " transposed b" : "");
                rows.push_back({"matmul",
                                form.name + suffix,
                                {{matrix(form.batch_a, 2, 3, transpose_a)},
                                 {matrix(form.batch_b, 3, 4, transpose_b)}},
                                [options](const auto& x) { return matmul(x[0], x[1], options); },
                                [=](const std::vector<Array>& x) {
                                    return product(x[0], x[1], transpose_a, transpose_b);
                                },
                                {matrix(form.batch_a, 512, 256, transpose_a),
                                 matrix(form.batch_b, 256, 256, transpose_b)}});
            }
        }
    }
}

double activated(Activation activation, double x) {
    if (activation == Activation::sine) return std::sin(x);
    if (activation == Activation::leaky_relu) return std::numbers::sqrt2 * (x > 0.0 ? x : 0.2 * x);
    return x;
}

const char* name_of(Activation activation) {
    if (activation == Activation::sine) return "sine";
    return activation == Activation::leaky_relu ? "leaky relu" : "plain";
}

Array layer(const std::vector<Array>& x, Activation activation) {
    Array y = product(x[0], x[1], false, true);
    for_each_index(y.extents, [&](const Index& i) {
        y.at(i) = activated(activation, y.at(i) + (x.size() > 2 ? x[2].at({i[2]}) : 0.0));
    });
    return y;
}

using LayerFunction = Variable (*)(const Variable&, const Variable&, const Variable&, Activation);

/// The bias keeps the leaky ReLU's argument away from 0: at least 0.8, against 0.75 at most of the
/// product.
void add_layers(std::vector<OpCase>& rows, const char* name, LayerFunction function) {
    const CaseInput bias{{4}, -1.0, 1.0, 2.0, 1.0};
    for (const Activation activation :
         {Activation::none, Activation::sine, Activation::leaky_relu}) {
        for (const bool shared : {true, false}) {
            const std::int64_t weights = shared ? 1 : 2;
            rows.push_back(
                {name,
                 std::string(name_of(activation)) + (shared ? "" : ", weight of each sample"),
                 {{{2, 3, 3}, -0.5, 0.5}, {{weights, 4, 3}, -0.4, 0.4}, bias},
                 [=](const auto& x) { return function(x[0], x[1], x[2], activation); },
                 [=](const std::vector<Array>& x) { return layer(x, activation); },
                 {{2, 4096, 256}, {weights, 256, 256}, {256}}});
        }
        rows.push_back({name,
                        std::string(name_of(activation)) + ", no bias",
                        {{{2, 3, 3}, 0.2, 1.0}, {{1, 4, 3}, 0.2, 1.0}},
                        [=](const auto& x) { return function(x[0], x[1], Variable(), activation); },
                        [=](const std::vector<Array>& x) { return layer(x, activation); }});
    }
}

}  // namespace

std::vector<OpCase> linalg_cases() {
    std::vector<OpCase> rows;
    add_products(rows);
    add_layers(rows, "linear", linear);
    add_layers(rows, "linear_reference", linear_reference);
    return rows;
}

}  // namespace stymo::test
