#include <catch2/catch.hpp>

#include "core/ops/ops.h"
#include "nn/models/identity_network.h"
#include "support/check_close.h"

namespace identity_network_tests {

using namespace stymo;
using namespace stymo::test;

TEST_CASE("the distance of two images is 1 - the cosine of their embeddings", "[identity]") {
    const IdentityNetwork network("random");
    const Variable one(Rng(1).uniform({2, 64, 64, 3}, -1.0, 1.0));
    const Tensor other = Rng(2).uniform({2, 64, 64, 3}, -1.0, 1.0);
    const std::vector<ImageAugmentation> whole(2);
    const Variable a = network.embeddings(one), b = network.embeddings(Variable(other));
    CHECK(a.shape() == Shape{2, 128});
    CHECK(sum(square(a)).value().item() == Approx(2.0));
    CHECK(network.distance(one, whole, other, whole).value().item() ==
          Approx(1.0 - 0.5 * sum(a * b).value().item()).margin(1e-6));
    CHECK(network.distance(one, whole, one.value(), whole).value().item() ==
          Approx(0.0).margin(1e-6));
}

TEST_CASE("a camera farther away and aside sees in its frame what the model's camera sees",
          "[identity]") {
    const CameraConfig model;
    const auto camera_at = [&](double distance, double right, double up) {
        Pose pose = pivot_pose(0.0, 0.0, 0.0, distance, model.pivot_depth);
        pose.translation += Eigen::Vector3d(right, up, 0.0);
        return camera_from_pose(pose, model.intrinsics);
    };
    const Camera usual = camera_at(model.distance, 0.0, 0.0);
    const Camera moved = camera_at(1.3 * model.distance, 0.4, -0.2);
    const ImageAugmentation frame = ffhq_frame(moved, model);
    for (const double x : {-0.5, 0.0, 0.7}) {
        const Eigen::Vector3d point(x, 0.3 * x + 0.1, model.pivot_depth);
        const Eigen::Vector3d target = 2.0 * project(usual, point);
        const Eigen::Vector3d source = 2.0 * project(moved, point);
        const auto& m = frame.source_from_target;
        CHECK(m[0] * (target.x() - 1.0) + m[2] == Approx(source.x() - 1.0).margin(1e-12));
        CHECK(m[4] * (target.y() - 1.0) + m[5] == Approx(source.y() - 1.0).margin(1e-12));
    }
    const ImageAugmentation same = ffhq_frame(usual, model);
    for (std::size_t i = 0; i < 6; ++i)
        CHECK(same.source_from_target[i] ==
              Approx(ImageAugmentation().source_from_target[i]).margin(1e-12));
}

}  // namespace identity_network_tests
