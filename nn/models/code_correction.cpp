#include "nn/models/code_correction.h"

#include <algorithm>
#include <array>

#include "core/autograd/grad.h"
#include "core/ops/ops.h"
#include "nn/image_augmentation.h"
#include "nn/known_pixels.h"
#include "nn/losses.h"
#include "nn/models/camera_problem.h"
#include "nn/models/identity_network.h"
#include "nn/models/reconstruction.h"

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
    return {
        .samples_per_ray = 12, .resolution = side, .gradient_tolerance = 0.001, .keep_field = true};
}

Variable with_known(const FaceBatch& face, const Variable& image) {
    return where_known(known_at(face.known, image.shape(1), image.shape(2)), image, -1.0);
}

Variable image_error(const Decoded& decoded, const FaceBatch& face) {
    Variable error = opacity_error(decoded, face) * opacity_weight;
    for (std::size_t i = 0; i < face.targets.size(); ++i)
        error = error + mean(square(with_known(face, decoded.images[i]) - face.targets[i]));
    return error;
}

Variable feature_error(const Model& model, const Decoded& decoded, const FaceBatch& face) {
    const Encoder& encoder = model.encoder();
    const std::array frame{ffhq_frame(face.cameras.front(), model.config().camera)};
    const auto embedding = [&](const Variable& image) {
        return encoder.face_embedding(augmented(image, frame));
    };
    const Variable rendered = with_known(face, decoded.images.back());
    const Tensor& target = face.targets.back();
    const Variable who = -sum(embedding(rendered) * embedding(target)) * identity_weight;
    if (!encoder.backbone().has_activations()) return who;
    const EncoderDistance distance(encoder);
    return who + sum(distance.distance_to(rendered, distance.features(target))) * perceptual_weight;
}

/// The codes (1, 306) of one face.
Variable corrected_face(const Model& model, const FaceBatch& face, Variable codes) {
    if (camera_problem(model.config().decoder, face.cameras.front())) return codes;
    for (std::int64_t i = 0; i < model.config().encoder.corrections; ++i)
        codes = (*model.corrector())(codes, correction_gradients(model, face, codes.value()));
    return codes;
}

}  // namespace

std::vector<Tensor> correction_gradients(const Model& model, const FaceBatch& face,
                                         const Tensor& codes) {
    const Variable leaf = Variable::leaf(codes);
    const Decoded decoded = model.decoder()(split_codes(leaf), face.cameras,
                                            decode_options(face.targets.back().shape(1)));
    std::vector<Tensor> gradients{grad(image_error(decoded, face), leaf).value()};
    if (model.encoder().knows_faces())
        gradients.push_back(grad(feature_error(model, decoded, face), leaf).value());
    return gradients;
}

Codes corrected(const Model& model, const FaceBatch& batch, const Codes& codes) {
    if (model.corrector() == nullptr) return codes;
    const Variable before = joined(codes);
    std::vector<Variable> rows;
    for (std::int64_t row = 0; row < codes.batch(); ++row)
        rows.push_back(corrected_face(model, face_of(batch, row), slice(before, 0, row, row + 1)));
    return split_codes(concat(rows, 0));
}

LayerMemory correction_memory(const Model& model) {
    if (model.corrector() == nullptr) return {};
    std::int64_t side = model.decoder().ladder().smallest();
    for (const std::int64_t larger : model.decoder().ladder().sides())
        if (larger <= largest_side) side = larger;
    LayerMemory memory = model.decoder().memory(decode_options(side), 1);
    if (model.encoder().knows_faces()) memory.add({0, IdentityNetwork::saved_per_image});
    return {0, memory.saved + memory.transient};
}

}  // namespace stymo
