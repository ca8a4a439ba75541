#include "nn/models/code_correction.h"

#include "core/autograd/grad.h"
#include "core/ops/ops.h"
#include "nn/known_pixels.h"
#include "nn/models/camera_problem.h"
#include "nn/models/identity_network.h"

namespace stymo {
namespace {

constexpr std::int64_t largest_side = 128;
constexpr double opacity_weight = 0.1;
constexpr double identity_weight = 0.1;
constexpr double perceptual_weight = 0.3;

/// What is compared of face `row`.
FaceBatch face_of(const FaceBatch& batch, std::int64_t row) {
    const auto row_of = [row](const Tensor& values) {
        return slice(values, 0, row, row + 1).value();
    };
    FaceBatch face;
    for (const Tensor& images : batch.targets)
        if (face.targets.empty() || images.shape(1) <= largest_side)
            face.targets.push_back(row_of(images));
    face.cameras = {batch.cameras[static_cast<std::size_t>(row)]};
    face.mask = row_of(batch.mask);
    face.ray_mask = row_of(batch.ray_mask);
    face.known = batch.known_of(row);
    return face;
}

DecodeOptions decode_options(std::int64_t side) {
    return {.samples_per_ray = 12, .resolution = side, .gradient_tolerance = 0.001};
}

/// The codes (1, 306) of one face.
Variable corrected_face(const Model& model, const CorrectionTarget& target, Variable codes) {
    if (camera_problem(model.config().decoder, target.camera())) return codes;
    for (std::int64_t i = 0; i < model.config().encoder.corrections; ++i)
        codes = (*model.corrector())(codes, target.gradients(codes.value()));
    return codes;
}

}  // namespace

CorrectionTarget::CorrectionTarget(const Model& model, const FaceBatch& batch, std::int64_t row)
    : model_(model), face_(face_of(batch, row)) {
    const Encoder& encoder = model.encoder();
    if (!encoder.knows_faces()) return;
    const Variable photo(face_.targets.back());
    embedding_ = face_embeddings(model, photo, face_.cameras);
    if (!encoder.backbone().has_activations()) return;
    distance_.emplace(encoder);
    for (const Variable& feature : distance_->features(photo))
        features_.emplace_back(feature.value());
}

std::vector<Tensor> CorrectionTarget::gradients(const Tensor& codes) const {
    const Variable leaf = Variable::leaf(codes);
    const Decoded decoded = model_.decoder()(split_codes(leaf), face_.cameras,
                                             decode_options(face_.targets.back().shape(1)));
    std::vector<Tensor> gradients{grad(image_error(decoded), leaf).value()};
    if (embedding_.defined()) gradients.push_back(grad(feature_error(decoded), leaf).value());
    return gradients;
}

Variable CorrectionTarget::image_error(const Decoded& decoded) const {
    Variable error = opacity_error(decoded, face_) * opacity_weight;
    for (std::size_t i = 0; i < face_.targets.size(); ++i)
        error = error + mean(square(with_known(decoded.images[i]) - face_.targets[i]));
    return error;
}

Variable CorrectionTarget::feature_error(const Decoded& decoded) const {
    const Variable rendered = with_known(decoded.images.back());
    const Variable who =
        -sum(face_embeddings(model_, rendered, face_.cameras) * embedding_) * identity_weight;
    if (!distance_) return who;
    return who + sum(distance_->distance_to(rendered, features_)) * perceptual_weight;
}

Variable CorrectionTarget::with_known(const Variable& image) const {
    return where_known(known_at(face_.known, image.shape(1), image.shape(2)), image, -1.0);
}

Codes corrected(const Model& model, const FaceBatch& batch, const Codes& codes) {
    if (model.corrector() == nullptr) return codes;
    const Variable before = joined(codes);
    std::vector<Variable> rows;
    for (std::int64_t row = 0; row < codes.batch(); ++row)
        rows.push_back(corrected_face(model, CorrectionTarget(model, batch, row),
                                      slice(before, 0, row, row + 1)));
    return split_codes(concat(rows, 0));
}

LayerMemory correction_memory(const Model& model) {
    if (model.corrector() == nullptr) return {};
    const std::int64_t side = model.decoder().ladder().largest_within(largest_side);
    LayerMemory memory = model.decoder().memory(decode_options(side), 1);
    const Encoder& encoder = model.encoder();
    if (encoder.knows_faces()) memory.add({0, encoder.identity_backbone().saved()});
    return {0, memory.saved + memory.transient};
}

}  // namespace stymo
