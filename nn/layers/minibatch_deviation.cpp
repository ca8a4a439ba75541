#include "nn/layers/minibatch_deviation.h"

#include "core/error.h"
#include "core/ops/elementwise.h"
#include "core/ops/reduce.h"
#include "core/ops/shape_ops.h"

namespace stymo {

Variable append_minibatch_deviation(const Variable& x, std::int64_t group_size) {
    if (x.rank() != 4 || group_size < 1 || x.shape(0) % group_size != 0)
        fail<ShapeError>("minibatch standard deviation: ", x.shape(),
                         " is not a number of groups of ", group_size, " images");
    constexpr double epsilon = 1e-8;
    const std::int64_t groups = x.shape(0) / group_size;
    const Variable members = reshape(x, {group_size, groups, -1});
    const Variable variance = mean(square(members - mean(members, {0})), {0});
    const Variable deviation = mean(sqrt(variance + epsilon), {2});
    const Variable channel = broadcast_to(deviation, {group_size, groups, x.shape(1) * x.shape(2)});
    return concat({x, reshape(channel, x.shape().with(3, 1))}, 3);
}

}  // namespace stymo
