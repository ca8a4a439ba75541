#pragma once

#include <cstdint>
#include <memory>
#include <stop_token>
#include <vector>

#include "nn/models/model.h"
#include "nn/models/radiance_field.h"
#include "render/rays.h"

namespace stymo {

struct RendererOptions;

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

struct CameraRays {
    std::vector<Ray> rays;           ///< row-major over the square feature map
    std::vector<SampleRange> known;  ///< of each ray; elsewhere there is no density
    std::int64_t samples_per_ray = 0;
};

/// The field as seen by a camera: the input of the render blocks, and further values for each ray.
struct FeatureMap {
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

/// Removes floaters, pieces that are separate from the head in a view. A field that was trained
/// only on frontal faces may place a part of an ear anywhere along the ray that showed it. Seen
/// from the side, such a part floats in the air.
class FloaterRemoval {
public:
    /// `map` has side x side rays. Neighbouring rays, also diagonal ones, with an opacity of at
    /// least 0.1 form a piece. Connected fainter rays belong to the nearest piece. All pieces
    /// except the one with the largest sum of opacities become empty, with the depth `background`.
    void apply(FeatureMap& map, std::int64_t side, double background);

private:
    void label_pieces(const FeatureMap& map, std::int64_t side);
    void spread(const FeatureMap& map, std::int64_t side, float least_opacity);

    std::vector<std::int32_t> pieces_;  ///< for each ray, -1: no piece
    std::vector<std::int32_t> queue_;   ///< rays whose neighbours are still to be visited
    std::vector<double> opacities_;     ///< sum for each piece
};

/// A source that evaluates the field for every view: at all samples in mode `exact`, and in mode
/// `skip` at those that a density grid of the head finds significant. The estimated optical depth
/// of samples that are left out is added to the next sample behind them.
[[nodiscard]] std::unique_ptr<FieldSource> make_sampled_field(const ModelConfig& model,
                                                              const RendererOptions& options);

}  // namespace stymo
