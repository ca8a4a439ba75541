#include "nn/pretrained/perceptual/feature_distance.h"

#include "core/autograd/grad.h"
#include "core/autograd/node.h"
#include "core/error.h"
#include "core/ops/elementwise.h"
#include "core/ops/reduce.h"
#include "core/ops/shape_ops.h"
#include "nn/pretrained/perceptual/feature_distance_kernel.h"

namespace stymo {

namespace {

void check(const Variable& x, const Tensor& target, const Tensor& weight) {
    if (x.rank() != 4 || x.shape() != target.shape() || weight.shape() != Shape{x.shape(3)}) {
        fail<ShapeError>("[feature_distance] x ", x.shape(), ", target ", target.shape(),
                         " and weight ", weight.shape(), " are not (B, h, w, C) twice and (C)");
    }
}

}  // namespace

Variable feature_distance_reference(const Variable& x, const Tensor& target, const Tensor& weight) {
    check(x, target, weight);
    return reshape(
        sum(mean_squared_difference(unit_channels(x, feature_epsilon), target) * Variable(weight),
            {3}),
        {-1});
}

Variable feature_distance(const Variable& x, const Tensor& target, const Tensor& weight) {
    check(x, target, weight);
    return record("feature_distance",
                  kernels::feature_distance(x.value(), target, weight, feature_epsilon), {x},
                  Save::input(0), {[target, weight](const Vjp& v) {
                      const Variable x_in = v.input(0);
                      if (!v.create_graph())
                          return Variable(kernels::feature_distance_gradient(
                              x_in.value(), target, weight, feature_epsilon, v.grad().value()));
                      return grad(feature_distance_reference(x_in, target, weight), x_in,
                                  {.create_graph = true, .partial = true, .dL_dy = v.grad()});
                  }});
}

}  // namespace stymo
