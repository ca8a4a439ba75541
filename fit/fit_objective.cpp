#include "fit/fit_objective.h"

#include "core/error.h"
#include "core/ops/ops.h"
#include "core/work_counts.h"
#include "nn/losses.h"

namespace stymo {

namespace {

double face_count(const FitComparison& seen) {
    return static_cast<double>(seen.decoded.images.back().shape(0));
}

/// The mean over the batch times its size, so that a face's gradient does not depend on the size of
/// the batch.
template <auto part>
Variable reconstruction_term(const FitComparison& seen) {
    return (seen.reconstruction->*part)(seen.decoded.images, *seen.photos) * face_count(seen);
}

double photometric_weight(const FitWeights&, const FitComparison& seen) {
    return seen.photos == nullptr ? 0.0 : seen.reconstruction->photometric_weight();
}

double perceptual_weight(const FitWeights& weights, const FitComparison& seen) {
    if (seen.photos == nullptr) return 0.0;
    return weights.perceptual * seen.reconstruction->perceptual_weight();
}

Variable regularizer_term(const FitComparison& seen) {
    return seen.offsets == nullptr ? Variable() : squared_length(*seen.offsets);
}

Variable locality_term(const FitComparison& seen) {
    if (seen.kept_images.empty()) return {};
    return photometric_loss(seen.decoded.images, seen.kept_images, seen.kept_weights) *
           face_count(seen);
}

Variable depth_term(const FitComparison& seen) {
    Variable total;
    for (std::size_t i = 0; i < seen.surfaces.size(); ++i) {
        if (!seen.surfaces[i]) continue;
        const auto row = static_cast<std::int64_t>(i);
        const Variable loss = seen.heads->loss(slice(seen.depths, 0, row, row + 1),
                                               *seen.surfaces[i], seen.first_row + row);
        total = total.defined() ? total + loss : loss;
    }
    return total;
}

Variable mask_term(const FitComparison& seen) {
    if (!seen.mask.defined()) return {};
    return mask_loss(seen.decoded.mask_logit, seen.mask, seen.known) * face_count(seen);
}

template <Variable FitComparison::*embeddings>
Variable identity_term(const FitComparison& seen) {
    if (!(seen.*embeddings).defined()) return {};
    return -sum(seen.*embeddings * seen.photo_embeddings) + face_count(seen);
}

Variable time_term(const FitComparison& seen) {
    Variable all = seen.expressions;
    if (!all.defined()) return {};
    if (seen.expression_before.defined()) all = concat({Variable(seen.expression_before), all}, 0);
    const std::int64_t rows = all.shape(0);
    return sum(square(slice(all, 0, 1, rows) - slice(all, 0, 0, rows - 1)));
}

template <double FitWeights::*member>
double weight_of(const FitWeights& weights, const FitComparison&) {
    return weights.*member;
}

/// Adds the weighted term and its values, if it is computed.
void add_term(const FitTerm& term, const FitComparison& seen, const FitWeights& weights,
              FitLoss& loss) {
    const double weight = term.weight(weights, seen);
    if (weight == 0.0) return;
    const Variable value = term.value(seen);
    if (!value.defined()) return;
    loss.terms.emplace_back(term.name, value.value().item() / face_count(seen));
    work::count_named("loss_terms", term.name, 1);
    const Variable weighted = weight == 1.0 ? value : value * weight;
    loss.total = loss.total.defined() ? loss.total + weighted : weighted;
}

}  // namespace

std::span<const FitTerm> fit_terms() {
    static const std::vector<FitTerm> terms{
        {.name = "photometric",
         .weight = photometric_weight,
         .value = reconstruction_term<&ReconstructionLoss::photometric>},
        {.name = "perceptual",
         .weight = perceptual_weight,
         .value = reconstruction_term<&ReconstructionLoss::perceptual>},
        {.name = "regularizer",
         .weight = weight_of<&FitWeights::regularizer>,
         .value = regularizer_term},
        {.name = "locality", .weight = weight_of<&FitWeights::locality>, .value = locality_term},
        {.name = "depth", .weight = weight_of<&FitWeights::depth>, .value = depth_term},
        {.name = "mask", .weight = weight_of<&FitWeights::mask>, .value = mask_term},
        {.name = "identity",
         .weight = weight_of<&FitWeights::identity>,
         .value = identity_term<&FitComparison::embeddings>},
        {.name = "side_identity",
         .weight = [](const FitWeights& weights,
                      const FitComparison&) { return FitWeights::side_share * weights.identity; },
         .value = identity_term<&FitComparison::side_embeddings>},
        {.name = "time", .weight = weight_of<&FitWeights::time>, .value = time_term},
    };
    return terms;
}

void weigh_largest(std::vector<double>& weights, std::size_t count, const Decoder& decoder) {
    const std::size_t sides = decoder.ladder().count();
    if (weights.size() >= sides) weights[count - 1] = weights[sides - 1];
}

FitLoss fit_loss(const FitComparison& seen, const FitWeights& weights) {
    FitLoss loss;
    for (const FitTerm& term : fit_terms()) add_term(term, seen, weights, loss);
    if (!loss.total.defined()) fail<ValueError>("a fit needs something to compare");
    return loss;
}

}  // namespace stymo
