#pragma once

#include <cstdint>
#include <memory>
#include <string>

#include "core/rng.h"
#include "core/tensor.h"
#include "nn/engine/sine_network.h"
#include "nn/layer_memory.h"
#include "nn/parameter_store.h"
#include "render/composite.h"

namespace stymo {

/// How codes enter the field.
enum class Conditioning {
    modulation,  ///< identity and expression modulate sine layers; texture and light modulate the
                 ///< render blocks (paper)
    concatenation,  ///< identity and expression are concatenated to the encoded point, texture and
                    ///< light to the features (HeadNeRF)
};

struct FieldConfig {
    Conditioning conditioning = Conditioning::modulation;
    std::int64_t frequencies = 10;
    std::int64_t width = 256;
    std::int64_t layers = 8;
    std::int64_t channels = 256;         ///< channels of the composited features or colours
    std::int64_t geometry_size = 179;    ///< identity and expression
    std::int64_t appearance_size = 127;  ///< texture and light
    /// Samples have `channels` colours in [0, 1] instead of features. Read only by a concatenated
    /// field.
    bool colors = false;
    double frequency_falloff = 0.0;  ///< see DecoderConfig; read only by a modulated field
};

/// The codes of a field, in W.
struct FieldStyle {
    Variable geometry;    ///< (B, geometry_size)
    Variable appearance;  ///< (B, appearance_size)
};

struct RenderedFeatures {
    CompositeWeights weights;  ///< (B, R, N)
    Variable features;         ///< (B, R, channels)
};

/// The layer whose input is concatenated once more with the field's input: the encoding, and the
/// code in a concatenated field. 0 means no layer.
[[nodiscard]] constexpr std::int64_t skip_layer_of(std::int64_t layers) {
    return layers >= 4 ? layers / 2 + 1 : 0;
}

/// Multiply-adds of the matrix products of a field.
struct FieldWork {
    std::int64_t sample = 0;  ///< at each sample
    std::int64_t ray = 0;     ///< after compositing
};

/// A radiance field and its volume rendering.
class Field {
public:
    virtual ~Field() = default;

    /// Evaluates the field at the samples and composites each ray. `keep` allows it to keep the
    /// activations of the samples for the backward pass instead of computing them again.
    [[nodiscard]] virtual RenderedFeatures render(const RayPoints& rays, const FieldStyle& style,
                                                  bool keep) const = 0;
    /// The same at `points` (B, R * N, 3) instead of `rays.points`; gradients flow to `points`.
    [[nodiscard]] virtual RenderedFeatures render_tracked(const Variable& points,
                                                          const RayPoints& rays,
                                                          const FieldStyle& style) const = 0;
    /// Density (B, P, 1) at points (B, P, 3) in world coordinates.
    [[nodiscard]] virtual Variable density(const Variable& points,
                                           const FieldStyle& style) const = 0;
    /// Whether the layers can be folded for nn/engine.
    [[nodiscard]] virtual bool folds() const { return false; }
    /// The layers with the style of one face folded in, for nn/engine. Throws ValueError unless
    /// `folds()`.
    [[nodiscard]] virtual FoldedField folded(const FieldStyle& style) const;
    [[nodiscard]] virtual FieldWork work() const = 0;
    /// Memory for the field and the compositing of this number of rays. `keep` as in `render`.
    [[nodiscard]] virtual LayerMemory memory(std::int64_t rays, std::int64_t samples_per_ray,
                                             bool keep) const = 0;
};

/// Creates the field's parameters under `prefix`.
[[nodiscard]] std::unique_ptr<Field> make_field(const FieldConfig& config, ParameterStore& store,
                                                const std::string& prefix, Rng& rng);

}  // namespace stymo
