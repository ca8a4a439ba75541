#include "nn/optim/muon.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

#include "core/error.h"
#include "core/ops/elementwise.h"
#include "core/ops/linalg.h"
#include "core/ops/reduce.h"
#include "core/ops/shape_ops.h"

namespace stymo {

namespace {

constexpr int iterations = 5;
/// x -> a x + b x^3 + c x^5 on the singular values.
constexpr std::array quintic{3.4445, -4.7750, 2.0315};
constexpr std::string_view suffix = ".momentum";

double norm_of(const Variable& x) {
    return std::sqrt(sum(square(x)).value().item());
}

double largest_magnitude(const Tensor& x) {
    return dispatch(x.dtype(), [&]<class T>(T) {
        T largest = T(0);
        for (const T value : x.values<T>()) largest = std::max(largest, std::abs(value));
        return static_cast<double>(largest);
    });
}

/// The matrix, multiplied by a power of two that makes its largest element about 1 if squares of
/// its elements may leave float32's range.
Variable in_range_of_squares(const Tensor& matrix) {
    const Variable x(matrix);
    constexpr double least = 1e-12, most = 1e18;
    if (const double norm = norm_of(x); norm >= least && norm <= most) return x;
    const double largest = largest_magnitude(matrix);
    if (largest == 0.0) return x;
    // In two factors, because the power itself can be beyond float32's range.
    const int exponent = -std::ilogb(largest);
    return x * std::ldexp(1.0, exponent / 2) * std::ldexp(1.0, exponent - exponent / 2);
}

}  // namespace

Tensor orthogonalised(const Tensor& matrix) {
    if (matrix.rank() != 2)
        fail<ShapeError>("only a matrix is orthogonalised, not ", matrix.shape());
    Variable x = in_range_of_squares(matrix);
    const double norm = norm_of(x);
    if (norm == 0.0) return matrix;
    const bool tall = matrix.shape(0) > matrix.shape(1);
    x = x * (1.0 / norm);
    if (tall) x = transpose(x);
    for (int i = 0; i < iterations; ++i) {
        const Variable gram = matmul(x, x, {.transpose_b = true});
        const Variable factor = gram * quintic[1] + matmul(gram, gram) * quintic[2];
        x = x * quintic[0] + matmul(factor, x);
    }
    return tall ? transpose(x).value() : x.value();
}

void Muon::step(std::span<const Parameter> parameters, std::span<const Variable> gradients,
                double learning_rate) {
    if (const std::optional<std::string> name = first_non_finite(parameters, gradients))
        fail<NumericError>("the gradient of ", *name, " is not finite");
    const double momentum = options_.momentum;
    for (std::size_t i = 0; i < parameters.size(); ++i) {
        const Parameter& parameter = parameters[i];
        const Tensor& value = parameter.variable().value();
        const Variable gradient = Variable(gradients[i].value());
        if (value.rank() < 2 || !(gradient.shape() == value.shape()))
            fail<ShapeError>("Muon moves matrices; the gradient of ", parameter.name(),
                             " has shape ", gradient.shape(), ", the parameter ", value.shape());
        Tensor& memory = momenta_[parameter.name()];
        if (!memory.defined()) memory = Tensor::zeros(value.shape(), value.dtype());
        if (!(memory.shape() == value.shape()))
            fail<ShapeError>("what the optimizer remembers of ", parameter.name(),
                             " has another shape than ", value.shape());
        memory = (Variable(memory) * momentum + gradient * (1.0 - momentum)).value();
        const Variable direction = Variable(memory) * momentum + gradient * (1.0 - momentum);
        const Variable matrix = reshape(direction, {value.shape(0), -1});
        const double length =
            std::sqrt(static_cast<double>(std::max(matrix.shape(0), matrix.shape(1))));
        const Variable step = reshape(Variable(orthogonalised(matrix.value())), value.shape());
        parameter.set_value((Variable(value) - step * (learning_rate * length)).value());
    }
}

void Muon::save(TensorFile& file, const std::string& prefix) const {
    for (const auto& [name, memory] : momenta_)
        file.tensors.insert_or_assign(prefix + name + std::string(suffix), memory);
}

void Muon::load(const TensorFile& file, const std::string& prefix) {
    momenta_.clear();
    for (const auto& [name, tensor] : file.tensors) {
        if (!name.starts_with(prefix) || !name.ends_with(suffix)) continue;
        momenta_.emplace(name.substr(prefix.size(), name.size() - prefix.size() - suffix.size()),
                         tensor);
    }
}

namespace {

constexpr const char* adam_name = "adam.";
constexpr const char* muon_name = "muon.";

/// Whether Muon suits this parameter: a matrix of a hidden layer, not one to or from few channels.
bool is_hidden_matrix(const Parameter& parameter, MuonScope scope) {
    constexpr std::int64_t few = 16;
    const Shape& shape = parameter.variable().shape();
    const bool decoder = parameter.name().starts_with("decoder.");
    // Tables of learnt offsets, one row for each photo, are no layers.
    if (!decoder && !parameter.name().starts_with("encoder.")) return false;
    if (scope == MuonScope::none || (scope == MuonScope::decoder && !decoder)) return false;
    if (shape.rank() != 2 && (decoder || shape.rank() != 4)) return false;
    return std::min(shape[0], shape[shape.rank() - 1]) >= few;
}

struct Group {
    std::vector<Parameter> parameters;
    std::vector<Variable> gradients;
};

/// Parameters without the prefix, and those with it.
using Groups = std::array<Group, 2>;

}  // namespace

void HybridOptimizer::step(std::span<const Parameter> parameters,
                           std::span<const Variable> gradients, const OptimizerRates& rates) {
    // Before any of the groups has moved.
    if (const std::optional<std::string> name = first_non_finite(parameters, gradients))
        fail<NumericError>("the gradient of ", *name, " is not finite");
    Groups matrices, others;
    for (std::size_t i = 0; i < parameters.size(); ++i) {
        Groups& groups = is_hidden_matrix(parameters[i], scope_) ? matrices : others;
        Group& group = groups[parameters[i].name().starts_with(rates.prefix) ? 1 : 0];
        group.parameters.push_back(parameters[i]);
        group.gradients.push_back(gradients[i]);
    }
    for (std::size_t i = 0; i < 2; ++i) {
        const double rate = rates.learning_rate * (i == 1 ? rates.prefix_factor : 1.0);
        adam_.step(others[i].parameters, others[i].gradients, rate * rates.adam_factor);
        muon_.step(matrices[i].parameters, matrices[i].gradients, rate);
    }
}

void HybridOptimizer::save(TensorFile& file, const std::string& prefix) const {
    adam_.save(file, prefix + adam_name);
    muon_.save(file, prefix + muon_name);
}

void HybridOptimizer::load(const TensorFile& file, const std::string& source,
                           const std::string& prefix) {
    adam_.load(file, source, prefix + adam_name);
    muon_.load(file, prefix + muon_name);
}

}  // namespace stymo
