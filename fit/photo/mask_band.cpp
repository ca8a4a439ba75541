#include "fit/photo/mask_band.h"

#include <algorithm>
#include <opencv2/imgproc.hpp>

namespace stymo {

double edge_band(int height, int width) {
    return std::max(1.0, std::max(height, width) / 64.0);
}

cv::Mat farther_than(double distance, const cv::Mat& set) {
    cv::Mat distances;
    cv::distanceTransform(set, distances, cv::DIST_L2, cv::DIST_MASK_PRECISE);
    return distances > distance;
}

}  // namespace stymo
