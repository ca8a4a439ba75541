#pragma once

#include "core/tensor.h"

namespace stymo {

/// A head mask (height, width, 1) whose edge follows the colours of the photo, `image` (height,
/// width, 3) in [0, 1]. Within a 64th of the longer side from the line where the mask is 0.5, the
/// colour of a pixel is a F + (1 - a) B (Porter and Duff 1984), with F and B the mean colours of
/// the head and of what is around it nearby; a replaces the mask as far as F and B differ, what is
/// around has one colour that is not skin in the shade, and the mixture explains the pixel's.
/// Elsewhere the mask falls from 1 to 0 in a few pixels around 0.5. Below 0.5 it never grows: a
/// neck has the colour of the face. Nor does it grow again behind a gap. This removes the bright
/// rim that a wall behind the head leaves. Throws ShapeError for other shapes.
[[nodiscard]] Tensor edge_by_color(const Tensor& mask, const Tensor& image);

}  // namespace stymo
