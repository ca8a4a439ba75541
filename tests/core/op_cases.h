#pragma once

#include <functional>
#include <string>
#include <vector>

#include "core/autograd/variable.h"
#include "core/rng.h"
#include "support/array.h"

/// The table of ops: each row serves the tests of value, gradients, threads and PyTorch vectors,
/// and the benchmark.
namespace stymo::test {

/// Extents and distribution of one input: uniform in [low, high], or near the points offset + k
/// spacing (within a tenth of the spacing), which keeps finite differences away from a kink that
/// lies between them.
struct CaseInput {
    Shape shape;
    double low = -1.0;
    double high = 1.0;
    double spacing = 0.0;
    double offset = 0.0;
};

using OpFunction = std::function<Variable(const std::vector<Variable>&)>;
using OpReference = std::function<Array(const std::vector<Array>&)>;

struct OpCase {
    std::string op;    ///< the function's name
    std::string form;  ///< what tells this row from the op's other rows
    std::vector<CaseInput> inputs;
    OpFunction function;
    OpReference reference;  ///< the value from the definition, in plain loops
    std::vector<Shape>
        speed_shapes{};  ///< of the inputs in the benchmark; the first row of every op has them

    [[nodiscard]] std::string name() const { return op + "/" + form; }
};

[[nodiscard]] const std::vector<OpCase>& op_cases();

/// Inputs in the row's own shapes, or in those of the benchmark.
[[nodiscard]] std::vector<Tensor> draw_inputs(const OpCase& row, DType dtype, std::uint64_t seed);
[[nodiscard]] std::vector<Tensor> draw_speed_inputs(const OpCase& row, DType dtype,
                                                    std::uint64_t seed);

/// Element i of a constant of a row, in [low, high]; tests/golden/make_op_vectors.py makes the
/// same.
[[nodiscard]] double wave(double i, double low, double high);
[[nodiscard]] Tensor constant(const Shape& shape, double low, double high, DType dtype);

[[nodiscard]] std::vector<Variable> as_constants(const std::vector<Tensor>& tensors);
[[nodiscard]] std::vector<Variable> as_leaves(const std::vector<Tensor>& tensors);

/// The families that make up the table.
[[nodiscard]] std::vector<OpCase> elementwise_cases();
[[nodiscard]] std::vector<OpCase> activation_cases();
[[nodiscard]] std::vector<OpCase> shape_cases();
[[nodiscard]] std::vector<OpCase> reduce_cases();
[[nodiscard]] std::vector<OpCase> linalg_cases();
[[nodiscard]] std::vector<OpCase> conv_cases();
[[nodiscard]] std::vector<OpCase> channel_cases();
[[nodiscard]] std::vector<OpCase> pool_cases();
[[nodiscard]] std::vector<OpCase> resample_cases();
[[nodiscard]] std::vector<OpCase> index_cases();
[[nodiscard]] std::vector<OpCase> rays_cases();
[[nodiscard]] std::vector<OpCase> feature_cases();

}  // namespace stymo::test
