#pragma once

#include <memory>
#include <string>
#include <vector>

#include "core/autograd/variable.h"
#include "core/io/tensor_file.h"
#include "core/rng.h"
#include "nn/parameter_store.h"

namespace stymo {

/// A network from an image to an embedding.
class Backbone {
public:
    virtual ~Backbone() = default;
    /// image (B, S, S, 3) in [-1, 1], any S; resized to the network's own input. Returns (B,
    /// embedding_size()).
    [[nodiscard]] virtual Variable operator()(const Variable& image) const = 0;
    /// Whether `activations` is implemented.
    [[nodiscard]] virtual bool has_activations() const { return false; }
    /// Activations of several layers from fine to coarse, (B, h, w, C) each, for comparing images.
    /// Residual blocks are left out, because fits compute them of large images at each step. The
    /// image must have a side of at least 32 pixels and is not resized. Throws ValueError unless
    /// `has_activations()`.
    [[nodiscard]] virtual std::vector<Variable> activations(const Variable& image) const;
    [[nodiscard]] virtual std::int64_t embedding_size() const = 0;
    [[nodiscard]] virtual std::int64_t input_side() const = 0;
    /// Number of elements that are kept for the backward pass of one image, measured.
    [[nodiscard]] virtual std::int64_t saved() const = 0;
    /// Sets the weights from a published file, which has the names and the layout of its publisher.
    /// Throws FileError, which names `source` and the first tensor that is missing or has another
    /// shape; ConfigError for a backbone that has no published weights.
    virtual void load_pretrained(const TensorFile& file, const std::string& source) = 0;
};

[[nodiscard]] std::vector<std::string> backbone_names();
/// How to get the backbone's published weights; empty if it has none. Throws ConfigError for
/// an unknown name.
[[nodiscard]] const char* published_weights(const std::string& backbone);
/// Creates the backbone's parameters under `prefix`, which ends with a dot. Throws ConfigError for
/// an unknown name.
[[nodiscard]] std::unique_ptr<Backbone> make_backbone(const std::string& name,
                                                      ParameterStore& store,
                                                      const std::string& prefix, Rng& rng);

}  // namespace stymo
