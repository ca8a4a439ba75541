#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "nn/models/realtime/baked_samples.h"
#include "nn/models/realtime/field_source.h"

namespace stymo {

/// A field that is sampled once for its face, and of which every view reads the samples: the
/// density before its softplus and the features by trilinear interpolation, at the exact frame's
/// own places along the rays. A camera within the head sees the mean feature where no view from
/// outside reaches. Outside of the baked box there is nothing.
class BakedField final : public FieldSource {
public:
    /// Throws as `bake`.
    BakedField(const RaySampling& rays, const ViewRange& views, const BakeOptions& options);

    void set_field(const FoldedField& field) override;
    /// Too quick to be stopped.
    void render(const CameraRays& rays, FeatureMap& map, const std::stop_token& stop) override;

    [[nodiscard]] const BakedSamples& samples() const { return samples_; }

private:
    struct Marched {
        float opacity = 0.0F;
        float depth = 0.0F;  ///< without the background's part
    };
    void mark_empty_blocks();
    [[nodiscard]] Marched march(const Ray& ray, std::int64_t samples_per_ray,
                                std::span<float> coefficients) const;
    void add_features(const std::array<float, 3>& place, float weight,
                      std::span<float> coefficients) const;

    RaySampling sampling_;
    ViewRange views_;
    BakeOptions options_;
    BakedSamples samples_;
    PackedLayer<float> finish_;
    std::array<std::int64_t, 3> blocks_{};
    std::vector<std::uint8_t> block_is_empty_;
    std::vector<float> coefficients_;  ///< (rays, dimension + 1)
};

}  // namespace stymo
