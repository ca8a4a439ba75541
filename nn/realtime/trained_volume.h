#pragma once

#include <cstdint>

#include "nn/models/model.h"
#include "render/rays.h"

namespace stymo {

/// The samples [first, end) of a ray.
struct SampleRange {
    std::int32_t first = 0;
    std::int32_t end = 0;
};

/// The samples of a ray that lie in the volume that a training camera would see in the same
/// direction, enlarged sideways by a quarter. That camera stands at `trained.distance` and has the
/// point at `trained.pivot_depth` in the middle of its image. Beyond that volume no photo has
/// taught the field anything, and it repeats the head. For a camera whose optical axis misses the
/// pivot, by up to the pivot's depth, the volume also holds that axis and as much around it.
/// Cameras at up to 1.15 times the trained distance see the whole image inside it; from farther
/// away the image has a margin without density.
[[nodiscard]] SampleRange samples_in_trained_volume(const CameraConfig& trained,
                                                    const Camera& camera, const Ray& ray,
                                                    std::int64_t samples_per_ray);

}  // namespace stymo
