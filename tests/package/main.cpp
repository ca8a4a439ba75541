#include <iostream>

#include "core/autograd/grad.h"
#include "core/ops/ops.h"
#include "core/tensor_eigen.h"
#include "render/camera_matrices.h"

int main() {
    const Eigen::Matrix2d values{{1.0, -2.0}, {3.0, 4.0}};
    const auto x = stymo::Variable::leaf(stymo::tensor_from(values));
    const stymo::Tensor dy_dx = stymo::grad(stymo::sum(stymo::square(x)), x).value();
    const Eigen::MatrixXd slopes = stymo::matrix_map<double>(dy_dx);
    if (slopes != 2.0 * values) {
        std::cerr << "the gradient of x^2 at\n" << values << "\nis\n" << slopes << "\n";
        return 1;
    }
    // A matrix that the library makes, whatever instructions it was compiled for.
    const Eigen::Matrix4d matrix =
        stymo::world_from_camera_matrix(stymo::camera_from_pose(stymo::Pose{}, {}));
    if (matrix.col(3) != Eigen::Vector4d(0.0, 0.0, 5.3, 1.0)) {
        std::cerr << "the frontal camera is\n" << matrix << "\n";
        return 1;
    }
    return 0;
}
