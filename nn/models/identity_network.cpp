#include "nn/models/identity_network.h"

#include "core/ops/ops.h"
#include "nn/known_pixels.h"
#include "nn/models/encoder.h"

namespace stymo {

IdentityNetwork::IdentityNetwork(const std::filesystem::path& weights) {
    Rng unused(0);
    backbone_ = make_backbone("mobilefacenet", parameters_, "", unused);
    if (weights != random_backbone)
        backbone_->load_pretrained(read_tensor_file(weights), weights.string());
    parameters_.set_trainable("", false);
}

Variable IdentityNetwork::embeddings(const Variable& images) const {
    return face_embedding(*backbone_, images);
}

Variable IdentityNetwork::distance(const Variable& images,
                                   std::span<const ImageAugmentation> frames, const Tensor& targets,
                                   std::span<const ImageAugmentation> target_frames) const {
    const Variable theirs = embeddings(augmented(Variable(targets), target_frames)).detach();
    const Variable cosines = sum(embeddings(augmented(images, frames)) * theirs);
    return -cosines / static_cast<double>(images.shape(0)) + 1.0;
}

ImageAugmentation ffhq_frame(const Camera& camera, const CameraConfig& model) {
    const Eigen::Vector3d pivot = project(camera, Eigen::Vector3d(0.0, 0.0, model.pivot_depth));
    const double scale = camera.intrinsics.focal / model.intrinsics.focal *
                         (model.distance - model.pivot_depth) / pivot.z();
    ImageAugmentation frame;
    frame.source_from_target = {scale, 0.0,   2.0 * pivot.x() - 1.0,  //
                                0.0,   scale, 2.0 * pivot.y() - 1.0};
    return frame;
}

std::vector<ImageAugmentation> ffhq_frames(std::span<const Camera> cameras,
                                           const CameraConfig& model) {
    std::vector<ImageAugmentation> frames;
    for (const Camera& camera : cameras) frames.push_back(ffhq_frame(camera, model));
    return frames;
}

Variable face_embeddings(const Model& model, const Variable& images,
                         std::span<const Camera> cameras, const Tensor& known) {
    const Tensor here = known_at(known, images.shape(1), images.shape(2));
    return model.encoder().face_embedding(
        augmented(where_known(here, images, -1.0), ffhq_frames(cameras, model.config().camera)));
}

}  // namespace stymo
