#pragma once

#include <cstdint>
#include <memory>
#include <stop_token>
#include <vector>

#include "nn/models/radiance_field.h"
#include "nn/models/realtime/face_renderer.h"
#include "render/rays.h"

namespace stymo {

struct CameraRays {
    std::vector<Ray> rays;  ///< row-major over the feature map
    std::int64_t samples_per_ray = 0;
};

/// What a camera sees of the field: the input of the render blocks, and what is known of every ray
/// besides.
struct FeatureMap {
    std::vector<float> features;  ///< (rays, feature_channels), after the field's last layer; zeros
                                  ///< for an empty ray
    std::vector<std::uint8_t> occupied;  ///< (rays): 0 for an empty ray, else 1
    std::vector<float> opacities;        ///< (rays), 0 for an empty ray
    std::vector<float> depths;       ///< (rays): expected Euclidean distance; that of the farthest
                                     ///< sample of all behind the rest
    std::int64_t field_samples = 0;  ///< samples that went through the field
    /// Samples whose compositing weight exceeds `significant_weight`, of those that went through
    /// the field.
    std::int64_t significant_samples = 0;
    std::int64_t tiles = 0;  ///< in so many of which the samples went through the field
};

/// The seam between ways of computing the field. The modes differ in nothing else before the
/// render blocks.
class FieldSource {
public:
    FieldSource() = default;
    virtual ~FieldSource() = default;
    FieldSource(const FieldSource&) = delete;
    FieldSource& operator=(const FieldSource&) = delete;

    /// The field of another identity or expression.
    virtual void set_field(const FoldedField& field) = 0;
    /// Fills `map`, whose vectors keep what they have allocated. Returns early, with a map of no
    /// use, when a stop is requested.
    virtual void render(const CameraRays& rays, FeatureMap& map, const std::stop_token& stop) = 0;
};

/// Distance of the farthest sample of all rays: where the background is.
[[nodiscard]] double farthest_sample(const CameraRays& rays);

}  // namespace stymo
