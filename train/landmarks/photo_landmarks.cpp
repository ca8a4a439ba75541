#include "train/landmarks/photo_landmarks.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "train/landmarks/photo_variation.h"

namespace stymo {
namespace {

constexpr int squares = 16;
constexpr double most_spread = 0.1;     ///< in units of the distance of the eyes
constexpr double usual_spread = 0.025;  ///< at which a point has half its weight
constexpr double surroundings = 1.7;    ///< of the kept part of the photo, relative to the square
constexpr std::int64_t kept_side = 160;

}  // namespace

std::optional<LandmarkExample> example_of_photo(const LandmarkModel& model, const Tensor& photo,
                                                const FacePoints& found, Rng rng) {
    const FaceSquare square = square_around(found);
    std::vector<FacePoints> answers;
    FacePoints mean;
    mean.fill(Eigen::Vector2d::Zero());
    for (int k = 0; k < squares; ++k) {
        answers.push_back(points_in_squares(model, photo, {jittered(square, {}, rng)}));
        for (std::size_t i = 0; i < mean.size(); ++i) mean[i] += answers.back()[i] / squares;
    }
    const double unit = (mean[45] - mean[36]).norm();
    LandmarkExample example;
    double mean_spread = 0.0;
    for (std::size_t i = 0; i < mean.size(); ++i) {
        double squared = 0.0;
        for (const FacePoints& answer : answers)
            squared += (answer[i] - mean[i]).squaredNorm() / squares;
        const double spread = std::sqrt(squared) / unit;
        mean_spread += spread / static_cast<double>(mean.size());
        example.weights[i] = static_cast<float>(1.0 / (1.0 + std::pow(spread / usual_spread, 2.0)));
    }
    if (!(mean_spread < most_spread)) return std::nullopt;
    FaceSquare kept = square_around(mean);
    kept.axis *= surroundings;
    example.image = image_in_square(photo, kept, kept_side);
    for (std::size_t i = 0; i < mean.size(); ++i)
        example.points[i] = 0.5 * static_cast<double>(kept_side) *
                            (kept.coordinates(mean[i]) + Eigen::Vector2d::Ones());
    return example;
}

}  // namespace stymo
