#pragma once

#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "fit/head_depth.h"
#include "nn/models/decoder.h"
#include "nn/models/reconstruction.h"

namespace stymo {

/// Weights of the terms that fits and tuning minimise; 0 turns a term off.
struct FitWeights {
    /// Of the sum of squared code offsets; if negative, the model's
    /// ReconstructionConfig::fit_regularizer.
    double regularizer = -1.0;
    /// A factor on ReconstructionConfig::perceptual_weight.
    double perceptual = 1.0;
    /// Of the mean difference between images of the tuned decoder and those that it must keep.
    double locality = 0.0;
    double depth = 0.0;  ///< of the mean difference of depths, per distance of the eyes
    double mask = 0.0;   ///< of the mask branch's cross-entropy
    /// Of 1 - cosine between face and photo in the encoder's identity backbone, if it has one and
    /// identity or texture is fitted. With Adam every second step also compares the face seen from
    /// a side, which counts `side_share` times as much.
    double identity = 0.0;
    static constexpr double side_share = 2.0;
    /// Of the squared change of the expression from row to row, for frames of a film.
    double time = 0.0;
};

/// Rendered images of one or more faces, and everything that a term may compare them with. A member
/// that is null, empty or undefined turns the terms off that need it.
struct FitComparison {
    const Decoded& decoded;
    const ReconstructionLoss* reconstruction = nullptr;
    const ReconstructionLoss::Target* photos = nullptr;  ///< of the same faces
    const Codes* offsets = nullptr;                      ///< of the codes, which are optimised
    Variable expressions{};                              ///< (B, 79), of consecutive frames
    Tensor expression_before{};  ///< (1, 79), of the frame before them; undefined: there is none
    std::span<const Tensor> kept_images{};   ///< what the images must stay, ascending by side
    std::span<const double> kept_weights{};  ///< one for each of `kept_images`
    Tensor mask{};                           ///< (B, S, S, 1), the head in the photos
    Tensor known{};                          ///< of `mask`, see nn/known_pixels.h
    Variable depths{};                       ///< expected_depth(decoded)
    Variable embeddings{};                   ///< Encoder::face_embedding of the images
    Variable side_embeddings{};              ///< and of the faces seen from a side
    Tensor photo_embeddings{};               ///< and of the photos
    /// By face: what its depth is drawn to; those without a value are left out.
    std::span<const std::optional<FaceSurface>> surfaces{};
    const HeadDepth* heads = nullptr;  ///< to which the surfaces belong
    std::int64_t first_row = 0;        ///< row of the first face in `heads`
};

/// Names and values of the terms that were computed, in their order.
using TermValues = std::vector<std::pair<std::string, double>>;

/// A term of the loss of fits and tuning. To add one: write its function in nn/losses.h, add its
/// weight to FitWeights and a row to the list in fit_objective.cpp, set what it compares in
/// FitProblem or Tuning, and declare the option of its weight (apps/common/tool_options.h).
struct FitTerm {
    std::string_view name;  ///< in --explain and report.json
    double (*weight)(const FitWeights& weights, const FitComparison& seen);
    /// The sum over the faces without its weight; undefined if there is nothing to compare.
    Variable (*value)(const FitComparison& seen);
};

/// All terms, in the order in which they are summed.
[[nodiscard]] std::span<const FitTerm> fit_terms();

/// Lets the last of `count` compared images count as much as the decoder's largest image would, of
/// which `weights` (one for each side) has the weight.
void weigh_largest(std::vector<double>& weights, std::size_t count, const Decoder& decoder);

struct FitLoss {
    Variable total;    ///< weighted sum of the terms, summed over the faces; a scalar
    TermValues terms;  ///< without their weights, means over the faces
};
/// The loss of a comparison. A term whose weight is 0 is not computed.
[[nodiscard]] FitLoss fit_loss(const FitComparison& seen, const FitWeights& weights);

}  // namespace stymo
