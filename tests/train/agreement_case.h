#pragma once

#include <string>
#include <vector>

#include "nn/models/face_batch.h"
#include "support/golden.h"
#include "train/step_gradients.h"
#include "train/train_config.h"

/// What the comparisons of whole networks and training steps with PyTorch share. Sizes, weights of
/// the losses and names of the inputs are those of tests/golden/make_agreement_vectors.py.
namespace stymo::test {

struct AgreementCase {
    std::string name;
    GoldenVectors vectors;
    Rng seed;
    DecoderConfig decoder;
    std::int64_t batch = 2;
    std::int64_t samples = 5;
    std::int64_t head_width = 8;
    std::string perceptual{};  ///< network of LPIPS, or none
    bool report = false;       ///< whether to print the errors
    /// Of the gradient of a whole step in float32; wider where it comes through a deep network of
    /// plain ReLUs.
    double gradient_bound = 1e-4;

    void check(const std::string& group, const Tensors& actual, double bound = 1e-4) const {
        vectors.check(name + "/" + group, actual, report, 1e-6, bound);
    }

    [[nodiscard]] TrainConfig config() const;
    [[nodiscard]] Model model(DType dtype) const;
    [[nodiscard]] ReconstructionLoss reconstruction(DType dtype) const;
    [[nodiscard]] FaceBatch training_batch(DType dtype) const;
    [[nodiscard]] std::vector<Camera> cameras() const;
    [[nodiscard]] std::array<Tensor, 4> codes(const std::string& prefix, DType dtype) const;
    [[nodiscard]] Rng jitter() const { return seed.split("jitter"); }

private:
    /// (B, side, side, channels) in [-1, 1]
    [[nodiscard]] Tensor image(const std::string& image_name, std::int64_t side,
                               std::int64_t channels, DType dtype) const;
    [[nodiscard]] Tensor mask(std::int64_t side, DType dtype) const;
};

struct DecoderSize {
    std::int64_t resolution, field_width, field_layers, feature_channels, frequencies;
    std::vector<std::int64_t> block_channels;
    std::int64_t mask_channels, mapping_layers, rays_per_side;
};
[[nodiscard]] DecoderConfig decoder_config(const DecoderSize& size);

/// A tiny one, whose folded vectors are in the tree.
[[nodiscard]] AgreementCase small_agreement(const std::string& name, std::uint64_t seed,
                                            const DecoderSize& size,
                                            const std::string& perceptual = "");
/// A tiny decoder of tests/golden/make_baseline_vectors.py, `render` as in DecoderConfig.
[[nodiscard]] AgreementCase baseline_agreement(const std::string& name, const std::string& render);
/// The paper's decoder cut at 64 pixels, whose vectors for runs in `dtype` are in `folder`.
[[nodiscard]] AgreementCase full_agreement(const std::string& name,
                                           const std::filesystem::path& folder, DType dtype);

/// Checks the outputs of the case's decoder, and the gradients of the sum of their mean squares.
void decoder_agrees(const AgreementCase& agreement, DType dtype);

/// As named tensors.
[[nodiscard]] Tensors values_of(const std::vector<Parameter>& parameters);
[[nodiscard]] Tensors gradients_of(const std::vector<Parameter>& parameters,
                                   const std::vector<Variable>& gradients);
/// The terms that every stage has, and their weighted sum.
[[nodiscard]] Tensors common_terms(const LossValues& losses, DType dtype);

}  // namespace stymo::test
