#include <iostream>
#include <vector>

#include "core/autograd/grad.h"
#include "core/ops/ops.h"

int main() {
    const std::vector<double> values = {1.0, -2.0, 3.0};
    const auto x = stymo::Variable::leaf(stymo::Tensor::from({3}, values));
    const auto y = stymo::sum(stymo::square(x));
    const auto dy_dx = stymo::grad(y, x).value().to_vector();
    for (std::size_t i = 0; i < values.size(); ++i) {
        if (dy_dx[i] != 2.0 * values[i]) {
            std::cerr << "the gradient of x^2 at " << values[i] << " came out as " << dy_dx[i] << "\n";
            return 1;
        }
    }
    return 0;
}
