#pragma once

#include <cstdint>
#include <memory>
#include <stop_token>
#include <vector>

#include "nn/models/radiance_field.h"
#include "nn/realtime/trained_volume.h"
#include "render/rays.h"

namespace stymo {

struct CameraRays {
    std::vector<Ray> rays;           ///< row-major over the square feature map
    std::vector<SampleRange> known;  ///< of each ray; elsewhere there is no density
    std::int64_t samples_per_ray = 0;
};

/// The field as seen by a camera: the input of the render blocks, and further values for each ray.
struct FeatureMap {
    bool depths_alone = false;    ///< set by the caller: `features` are not wanted, and stay
    std::vector<float> features;  ///< (rays, feature_channels), after the field's last layer; zeros
                                  ///< for an empty ray
    std::vector<std::uint8_t> occupied;  ///< (rays): 0 for an empty ray, else 1
    std::vector<float> opacities;        ///< (rays), 0 for an empty ray
    /// (rays): expected Euclidean distance; the remaining transmittance counts with the distance of
    /// the farthest sample of all rays.
    std::vector<float> depths;
    std::int64_t field_samples = 0;  ///< samples at which the field was evaluated
    std::int64_t grid_points = 0;    ///< points at which the density grid was evaluated
    /// The evaluated samples whose compositing weight exceeds `significant_weight`.
    std::int64_t significant_samples = 0;
    std::int64_t tiles = 0;  ///< number of tiles in which the samples were evaluated
};

/// The field of one face, in weights of any type. Before the render blocks, render modes differ
/// only in this.
class FieldSource {
public:
    FieldSource() = default;
    virtual ~FieldSource() = default;
    FieldSource(const FieldSource&) = delete;
    FieldSource& operator=(const FieldSource&) = delete;

    /// Sets the field of another identity or expression.
    virtual void set_field(const FoldedField& field) = 0;
    /// RendererOptions::tolerance of the next frames.
    virtual void set_tolerance(double tolerance) = 0;
    /// Fills `map` and reuses its memory. When a stop is requested, returns early with an
    /// incomplete map.
    virtual void render(const CameraRays& rays, FeatureMap& map, const std::stop_token& stop) = 0;
};

/// Distance of the farthest sample of all rays, which is the depth of the background.
[[nodiscard]] double farthest_sample(const CameraRays& rays);

}  // namespace stymo
