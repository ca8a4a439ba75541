#pragma once

#include <filesystem>
#include <memory>
#include <span>
#include <vector>

#include "nn/image_augmentation.h"
#include "nn/models/model.h"
#include "nn/pretrained/backbones/backbone.h"

namespace stymo {

/// A face recognition network, which tells who a face is: MobileFaceNet with frozen weights. Its
/// input is the arcface_frame of FFHQ's crop (nn/models/encoder.h).
class IdentityNetwork {
public:
    /// Number of elements that are kept for the backward pass of one image, measured.
    static constexpr std::int64_t saved_per_image = 8'000'000;

    /// `weights` are those that `stymo-weights import` writes, or "random", with which nothing can
    /// be judged. Throws FileError for a file that cannot be used.
    explicit IdentityNetwork(const std::filesystem::path& weights);

    /// The embeddings (B, 128), of unit length, of images (B, S, S, 3) in [-1, 1] in FFHQ's crop.
    [[nodiscard]] Variable embeddings(const Variable& images) const;
    /// The mean of 1 - cosine over the embeddings of images and targets (B, S, S, 3), each first
    /// brought into FFHQ's crop by its frame (ffhq_frame). The targets get no gradient.
    [[nodiscard]] Variable distance(const Variable& images,
                                    std::span<const ImageAugmentation> frames,
                                    const Tensor& targets,
                                    std::span<const ImageAugmentation> target_frames) const;

private:
    ParameterStore parameters_;
    std::unique_ptr<Backbone> backbone_;
};

/// The transformation that brings an image of `camera` into the crop of the model's frontal camera:
/// the model's pivot comes into the middle, at the same size.
[[nodiscard]] ImageAugmentation ffhq_frame(const Camera& camera, const CameraConfig& model);
[[nodiscard]] std::vector<ImageAugmentation> ffhq_frames(std::span<const Camera> cameras,
                                                         const CameraConfig& model);

/// Encoder::face_embedding of images (B, S, S, 3) in [-1, 1] by these cameras, each first brought
/// into FFHQ's crop. Pixels that are not `known` (B, T, T, 1) are black. Needs
/// Encoder::knows_faces.
[[nodiscard]] Variable face_embeddings(const Model& model, const Variable& images,
                                       std::span<const Camera> cameras, const Tensor& known = {});

}  // namespace stymo
