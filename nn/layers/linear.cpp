#include "nn/layers/linear.h"

#include <cmath>

#include "core/error.h"
#include "core/ops/elementwise.h"
#include "core/ops/shape_ops.h"

namespace stymo {

Linear::Linear(ParameterStore& store, const std::string& prefix, std::int64_t in, std::int64_t out,
               const LinearOptions& options, Rng& rng)
    : options_(options) {
    if (in < 1 || out < 1)
        fail<ValueError>("layer ", prefix, " needs at least one input and one output, got ", in,
                         " and ", out);
    Rng draws = rng.split(prefix + ".weight");
    const double deviation = options.initial_weight_scale / options.learning_rate_multiplier;
    weight_ = store.create(prefix + ".weight", draws.normal({out, in}, 0.0, deviation));
    bias_ =
        store.create(prefix + ".bias",
                     Tensor::full({out}, options.initial_bias / options.learning_rate_multiplier));
}

double Linear::weight_scale() const {
    const auto in = static_cast<double>(weight_.variable().shape(1));
    return options_.gain * options_.learning_rate_multiplier / std::sqrt(in);
}

Variable Linear::effective_weight() const {
    return weight_.variable() * weight_scale();
}

Variable Linear::effective_bias() const {
    return bias_.variable() * (options_.gain * options_.learning_rate_multiplier);
}

FoldedLayer Linear::folded() const {
    return {effective_weight().value(), effective_bias().value(), options_.activation};
}

Variable Linear::operator()(const Variable& x) const {
    // Scaling the smaller operand is cheaper.
    if (x.shape().size() < weight_.variable().shape().size())
        return apply(x * weight_scale(), weight_.variable(), effective_bias());
    return apply(x, effective_weight(), effective_bias());
}

Variable Linear::by_group(const Variable& x, std::int64_t group) const {
    const std::int64_t in = inputs(), out = outputs();
    const Variable weight =
        permute(reshape(effective_weight(), {out / group, group, in}), {1, 0, 2});
    return apply(x, reshape(weight, {out, in}),
                 reshape(transpose(reshape(effective_bias(), {out / group, group})), {out}));
}

Variable Linear::apply(const Variable& x, const Variable& weight, const Variable& bias) const {
    const Shape& weight_shape = weight.shape();
    if (x.rank() < 2 || x.shape(-1) != weight_shape[1])
        fail<ShapeError>("layer ", weight_.name(), " ", weight_shape, " does not fit ", x.shape());
    const Variable rows = reshape(x, {x.rank() == 2 ? 1 : x.shape(0), -1, weight_shape[1]});
    return reshape(linear(rows, reshape(weight, {1, weight_shape[0], weight_shape[1]}), bias,
                          options_.activation),
                   x.shape().with(-1, weight_shape[0]));
}

}  // namespace stymo
