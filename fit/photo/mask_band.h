#pragma once

namespace cv {
class Mat;
}

namespace stymo {

/// How far from a mask's edge, in pixels, its values are in doubt: a 64th of the longer side, but
/// at least 1.
[[nodiscard]] double edge_band(int height, int width);

/// 255 where the nearest pixel that is not set is farther away than `distance` pixels, else 0.
/// `set` has one 8-bit channel; outside the image nothing counts.
[[nodiscard]] cv::Mat farther_than(double distance, const cv::Mat& set);

}  // namespace stymo
