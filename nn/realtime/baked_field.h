#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "nn/realtime/baked_samples.h"
#include "nn/realtime/field_source.h"

namespace stymo {

/// A field that is sampled once for each face. Every view interpolates the density's logits and the
/// features trilinearly between these samples, at the same positions along the rays as an exact
/// frame. Parts of the head that no view from outside sees have the mean feature; a camera inside
/// the head sees them. The space outside the baked box is empty.
class BakedField final : public FieldSource {
public:
    /// Throws what `bake` throws.
    BakedField(const RaySampling& rays, const ViewRange& views, const BakeOptions& options);

    void set_field(const FoldedField& field) override;
    /// Ignores `stop`, since it takes little time.
    void render(const CameraRays& rays, FeatureMap& map, const std::stop_token& stop) override;

    [[nodiscard]] const BakedSamples& samples() const { return samples_; }

private:
    struct Marched {
        float opacity = 0.0F;
        float depth = 0.0F;  ///< without the contribution of the background
    };
    void mark_empty_blocks();
    [[nodiscard]] Marched march(const Ray& ray, std::int64_t samples_per_ray,
                                std::span<float> coefficients) const;
    void add_features(const std::array<float, 3>& position, float weight,
                      std::span<float> coefficients) const;

    RaySampling sampling_;
    ViewRange views_;
    BakeOptions options_;
    BakedSamples samples_;
    PackedLayer<float> last_layer_;
    std::array<std::int64_t, 3> blocks_{};
    std::vector<std::uint8_t> block_is_empty_;
    std::vector<float> coefficients_;  ///< (rays, dimension + 1)
};

}  // namespace stymo
