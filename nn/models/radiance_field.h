#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "nn/engine/render_field.h"
#include "nn/layers/modulated_linear.h"
#include "nn/models/field.h"

namespace stymo {

struct RadianceFieldConfig {
    std::int64_t frequencies = 10;
    std::int64_t width = 256;
    std::int64_t layers = 8;
    std::int64_t feature_channels = 256;
    std::int64_t style_size = 179;
    double frequency_falloff = 0.0;  ///< see DecoderConfig
};

struct FieldSamples {
    Variable density;   ///< (B, P, 1), >= 0
    Variable features;  ///< (B, P, width), the input of the last, linear layer; undefined if only
                        ///< the density was asked for
};

/// Composited rays of the field.
struct RenderedRays {
    CompositeWeights weights;  ///< (B, R, N)
    Variable composited;  ///< (B, R, width): weighted sums of the features, for `apply_last_layer`
};

/// The paper's NeRF: modulated sine layers on encoded points. With four or more layers, the
/// encoding is concatenated once more to the input of layer layers / 2 + 1 (counted from 0).
/// Density: a linear layer and softplus(x - 1). Features: one more modulated sine layer, and a
/// linear layer that is applied after compositing.
class RadianceField final : public Field {
public:
    /// Creates `prefix`.layer0 and so on, `prefix`.density, `prefix`.feature0, `prefix`.feature1.
    RadianceField(const RadianceFieldConfig& config, ParameterStore& store,
                  const std::string& prefix, Rng& rng);

    /// Evaluates the field at points (B, P, 3) in world coordinates for style (B, style_size).
    [[nodiscard]] FieldSamples operator()(const Variable& points, const Variable& style,
                                          bool density_only = false) const;

    /// Field and compositing as one op, which stores no features of samples.
    [[nodiscard]] RenderedRays render(const RayPoints& rays, const Variable& style,
                                      SineArguments arguments = SineArguments::recomputed) const;
    /// The same as a composition of ops: the reference implementation.
    [[nodiscard]] RenderedRays render_reference(const RayPoints& rays, const Variable& style) const;

    /// The same at `points` (B, R * N, 3) instead of `rays.points`; gradients flow to `points`.
    /// Samples that are left out cost nothing. The backward pass computes the features of the
    /// others again, a few thousand samples at a time.
    [[nodiscard]] RenderedRays render_tracked(const Variable& points, const RayPoints& rays,
                                              const Variable& style) const;

    /// Applies the last layer W r + b to composited features (B, R, width) = sum_i w_i r_i with
    /// opacity (B, R, 1) = sum_i w_i -> (B, R, feature_channels). The result W sum_i w_i r_i + b
    /// sum_i w_i equals sum_i w_i (W r_i + b), but the layer has one row for each ray instead of
    /// one for each sample.
    [[nodiscard]] Variable apply_last_layer(const Variable& composited,
                                            const Variable& opacity) const;
    /// Folds the style of one face, (1, style_size), into the weights.
    [[nodiscard]] FoldedField folded(const Variable& style) const;

    // The interface of Field: the style is FieldStyle::geometry, and the last layer is included.
    [[nodiscard]] RenderedFeatures render(const RayPoints& rays, const FieldStyle& style,
                                          bool keep) const override;
    [[nodiscard]] RenderedFeatures render_tracked(const Variable& points, const RayPoints& rays,
                                                  const FieldStyle& style) const override;
    [[nodiscard]] Variable density(const Variable& points, const FieldStyle& style) const override;
    [[nodiscard]] bool folds() const override { return true; }
    [[nodiscard]] FoldedField folded(const FieldStyle& style) const override;
    [[nodiscard]] FieldWork work() const override;
    [[nodiscard]] LayerMemory memory(std::int64_t rays, std::int64_t samples_per_ray,
                                     bool keep) const override;

private:
    [[nodiscard]] RenderedFeatures with_last_layer(RenderedRays rays) const;
    [[nodiscard]] SineNetwork network(const Variable& style) const;
    /// Density and features (K, 1 + width) at points (K, 3) of one face.
    [[nodiscard]] Variable tracked_samples(const Variable& points, const Variable& style) const;

    std::int64_t frequencies_;
    std::size_t skip_layer_;
    std::vector<ModulatedLinear> layers_;
    Linear density_;
    ModulatedLinear feature0_;
    Linear feature1_;
};

}  // namespace stymo
