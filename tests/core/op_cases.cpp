#include "core/op_cases.h"

#include <cmath>

namespace stymo::test {
namespace {

Tensor draw(const CaseInput& input, const Shape& shape, DType dtype, Rng& rng) {
    Tensor drawn = rng.uniform(shape, input.low, input.high, DType::float64);
    if (input.spacing > 0.0) {
        for (double& value : drawn.mutable_values<double>()) {
            const double nearest =
                std::round((value - input.offset) / input.spacing) * input.spacing + input.offset;
            value = nearest + 0.1 * input.spacing * (2.0 * rng.uniform() - 1.0);
        }
    }
    return drawn.to(dtype);
}

}  // namespace

double wave(double i, double low, double high) {
    return low + (high - low) * (0.5 + 0.5 * std::sin(1.7 * i + 0.3));
}

Tensor constant(const Shape& shape, double low, double high, DType dtype) {
    Tensor values(shape, DType::float64);
    double i = 0.0;
    for (double& value : values.mutable_values<double>()) value = wave(i++, low, high);
    return values.to(dtype);
}

const std::vector<OpCase>& op_cases() {
    static const std::vector<OpCase> table = [] {
        std::vector<OpCase> all;
        for (const auto& family :
             {elementwise_cases(), activation_cases(), shape_cases(), reduce_cases(),
              linalg_cases(), conv_cases(), channel_cases(), pool_cases(), resample_cases(),
              index_cases(), rays_cases(), feature_cases()}) {
            all.insert(all.end(), family.begin(), family.end());
        }
        return all;
    }();
    return table;
}

std::vector<Tensor> draw_inputs(const OpCase& row, DType dtype, std::uint64_t seed) {
    Rng rng = Rng(seed).split(row.name());
    std::vector<Tensor> tensors;
    for (const CaseInput& input : row.inputs)
        tensors.push_back(draw(input, input.shape, dtype, rng));
    return tensors;
}

std::vector<Tensor> draw_speed_inputs(const OpCase& row, DType dtype, std::uint64_t seed) {
    Rng rng = Rng(seed).split(row.name());
    std::vector<Tensor> tensors;
    for (std::size_t i = 0; i < row.speed_shapes.size(); ++i) {
        tensors.push_back(draw(row.inputs.at(i), row.speed_shapes[i], dtype, rng));
    }
    return tensors;
}

std::vector<Variable> as_constants(const std::vector<Tensor>& tensors) {
    return {tensors.begin(), tensors.end()};
}

std::vector<Variable> as_leaves(const std::vector<Tensor>& tensors) {
    std::vector<Variable> leaves;
    for (const Tensor& tensor : tensors) leaves.push_back(Variable::leaf(tensor));
    return leaves;
}

}  // namespace stymo::test
