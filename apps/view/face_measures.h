#pragma once

#include <string>
#include <vector>

#include "core/tensor.h"
#include "nn/pretrained/face_square.h"

namespace stymo {

/// What the two ends of a slider do to a face, "wide face" and "narrow face"; empty if unknown.
struct EndNames {
    std::string more;
    std::string less;
};

/// Lengths and colours of one face in a frontal picture: its proportions, expression, hair and
/// beard, colours and light. Their order is that of `measure_names`. `image` (S, S, 3) and `mask`
/// (S, S, 1) in [0, 1], points in pixels of the image.
[[nodiscard]] std::vector<double> face_measures(const Tensor& image, const Tensor& mask,
                                                const FacePoints& points);
/// What a face with more, and with less, of each measure is called.
[[nodiscard]] const std::vector<EndNames>& measure_names();

/// Names directions by what they change most. `changes[d][m]`: by how much a step along direction d
/// changes measure m. A change counts in units of the root mean square of that measure's changes
/// over all directions, which is what faces differ by. A measure names directions of the groups
/// that it belongs to, `groups[d]` in the order of `code_names`, and one of each: the largest
/// change has the first choice. A direction that changes nothing by a quarter of that unit has
/// empty names.
[[nodiscard]] std::vector<EndNames> names_of_changes(
    const std::vector<std::vector<double>>& changes, const std::vector<std::size_t>& groups);

}  // namespace stymo
