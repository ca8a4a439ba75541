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
    modulation,  ///< identity and expression modulate sine layers; texture and light belong to the
                 ///< render blocks (paper)
    concatenation,  ///< identity and expression join the encoded point, texture and light the
                    ///< features (HeadNeRF)
};

struct FieldConfig {
    Conditioning conditioning = Conditioning::modulation;
    std::int64_t frequencies = 10;
    std::int64_t width = 256;
    std::int64_t layers = 8;
    std::int64_t channels = 256;         ///< of what is composited
    std::int64_t geometry_size = 179;    ///< identity and expression
    std::int64_t appearance_size = 127;  ///< texture and light
    /// The samples have colours between 0 and 1, `channels` of them, instead of features; of a
    /// field with concatenation alone.
    bool colors = false;
    double frequency_falloff = 0.0;  ///< see DecoderConfig; of a modulated field alone
};

/// The codes that a field may read, in W.
struct FieldStyle {
    Variable geometry;    ///< (B, geometry_size)
    Variable appearance;  ///< (B, appearance_size)
};

struct RenderedFeatures {
    CompositeWeights weights;  ///< (B, R, N)
    Variable features;         ///< (B, R, channels)
};

/// The layer of a field whose input is joined by the encoding (and code, where it is concatenated)
/// once more; 0: none, since layer 0 sees it anyway.
[[nodiscard]] constexpr std::int64_t skip_layer_of(std::int64_t layers) {
    return layers >= 4 ? layers / 2 + 1 : 0;
}

/// Multiply-adds of the matrix products.
struct FieldWork {
    std::int64_t sample = 0;  ///< at each sample
    std::int64_t ray = 0;     ///< after compositing
};

/// A radiance field with what is composited from it.
class Field {
public:
    virtual ~Field() = default;

    /// `keep`: what the backward pass needs of the samples may be kept instead of computed once
    /// more.
    [[nodiscard]] virtual RenderedFeatures render(const RayPoints& rays, const FieldStyle& style,
                                                  bool keep) const = 0;
    /// The same with points (B, R * N, 3) that gradients flow to, in place of those of `rays`.
    [[nodiscard]] virtual RenderedFeatures render_tracked(const Variable& points,
                                                          const RayPoints& rays,
                                                          const FieldStyle& style) const = 0;
    /// At points (B, P, 3) in world coordinates: (B, P, 1).
    [[nodiscard]] virtual Variable density(const Variable& points,
                                           const FieldStyle& style) const = 0;
    /// Whether the engine knows these layers.
    [[nodiscard]] virtual bool folds() const { return false; }
    /// For the engine, of one face. Throws ValueError unless the field folds.
    [[nodiscard]] virtual FoldedField folded(const FieldStyle& style) const;
    [[nodiscard]] virtual FieldWork work() const = 0;
    /// Field and compositing of so many rays. `keep` as in `render`.
    [[nodiscard]] virtual LayerMemory memory(std::int64_t rays, std::int64_t samples_per_ray,
                                             bool keep) const = 0;
};

/// Creates the field's parameters under `prefix`.
[[nodiscard]] std::unique_ptr<Field> make_field(const FieldConfig& config, ParameterStore& store,
                                                const std::string& prefix, Rng& rng);

}  // namespace stymo
