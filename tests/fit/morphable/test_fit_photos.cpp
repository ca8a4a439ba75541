#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <iostream>

#include "core/angle.h"
#include "core/io/image.h"
#include "core/median.h"
#include "fit/morphable/morphable_fit.h"
#include "fit/photo/face_detector.h"
#include "fit/photo/pose_network.h"
#include "render/morphable/head_source.h"
#include "shared_data.h"
#include "support/fitted_landmarks.h"

namespace {

/// Median distance of the values from their median.
[[nodiscard]] double spread(std::vector<double> values) {
    const double middle = stymo::median(values);
    for (double& value : values) value = std::abs(value - middle);
    return stymo::median(std::move(values));
}

}  // namespace

TEST_CASE("On photos the fitted head meets dlib's landmarks and agrees with a pose network",
          "[slow]") {
    const auto folder = stymo::shared_data();
    if (!folder || !stymo::FaceDetector::available()) return;
    const std::filesystem::path& shared = *folder;
    std::vector<std::filesystem::path> photos;
    for (const auto& entry : std::filesystem::directory_iterator(shared / "data/celebamask/images"))
        photos.push_back(entry.path());
    std::ranges::sort(photos);
    const stymo::FaceDetector detector;
    stymo::PoseNetwork network(shared / "weights/pose_3ddfa_mb05.onnx");
    std::vector<stymo::MorphableFitTarget> targets;
    std::vector<Eigen::Vector3d> angles;
    for (std::size_t i = 0; i < photos.size(); i += 17) {
        const stymo::Tensor photo = stymo::read_image(photos[i]);
        const std::vector<stymo::DetectedFace> faces = detector.find(photo);
        if (faces.empty()) continue;
        targets.push_back({faces[0].landmarks, photo, {}});
        angles.push_back(stymo::angles_from_rotation(network.rotation(network.face_box(photo))));
    }
    for (const char* name : {"", "data/ict_face.safetensors"}) {
        const stymo::MorphableHead head =
            stymo::morphable_head_from(*name == '\0' ? std::filesystem::path() : shared / name);
        const auto fits = stymo::fit_morphable(head, targets, {});
        std::vector<double> misses, yaws, pitches;
        for (std::size_t i = 0; i < fits.size(); ++i) {
            const stymo::Landmarks found =
                stymo::test::fitted_landmarks(head, fits[i], {}, targets[i].image.shape(0));
            double sum = 0.0;
            for (std::size_t k = 0; k < found.size(); ++k)
                sum += (found[k] - targets[i].landmarks[k]).norm() / 68.0;
            misses.push_back(100.0 * sum / stymo::inter_ocular_distance(targets[i].landmarks));
            yaws.push_back(std::abs(stymo::degrees_from_radians(fits[i].pose.yaw - angles[i][0])));
            pitches.push_back(stymo::degrees_from_radians(fits[i].pose.pitch - angles[i][1]));
        }
        std::cout << (*name == '\0' ? "built-in head" : name) << ", " << fits.size()
                  << " photos: landmarks missed by " << stymo::median(misses)
                  << " % of the inter-ocular distance, yaw differs by " << stymo::median(yaws)
                  << ", pitch by " << stymo::median(pitches) << " +- " << spread(pitches)
                  << " degrees\n";
        CHECK(stymo::median(misses) < 5.0);
        CHECK(stymo::median(yaws) < 6.0);
        CHECK(spread(pitches) < 6.0);
    }
}
