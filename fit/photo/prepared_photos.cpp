#include "fit/photo/prepared_photos.h"

#include <algorithm>
#include <filesystem>

#include "core/error.h"
#include "core/io/image.h"
#include "core/ops/elementwise.h"
#include "fit/photo/preparation_overlay.h"
#include "nn/known_pixels.h"

namespace stymo {
namespace {

constexpr std::int64_t least_aligned_side = 512;
/// A fit can use a face of so few pixels, in the photo. Preparation for training wants more.
constexpr std::int64_t least_fitted_side = 48;
/// What the overlay shows in place of unknown pixels.
constexpr double unknown_grey = 0.5;

/// The first face of the photo. Errors name the photo.
FaceCrop face_of(const PhotoPreparation& preparation, const Tensor& photo, const std::string& name,
                 const Tensor& known) {
    try {
        return preparation.crops(photo, {.known = known}).front();
    } catch (const ValueError& error) {
        const PhotoPreparationSettings& settings = preparation.settings();
        const std::string reason = error.what();
        const bool advised = reason.starts_with("no face was found") && settings.face == 0;
        fail<FileError>(name, ": ", reason, advised ? settings.no_face_advice : std::string());
    }
}

std::vector<float> code_of(const MorphableFit& fit) {
    std::vector<float> code;
    for (const std::vector<float>* group :
         {&fit.identity, &fit.expression, &fit.texture, &fit.light})
        code.insert(code.end(), group->begin(), group->end());
    return code;
}

PreparedPhoto photo_of(const std::string& image, PreparedFace prepared,
                       const PhotoPreparation& preparation, const ModelConfig& model) {
    if (!prepared.failure.empty()) fail<FileError>(image, ": ", prepared.failure);
    const PhotoPreparationSettings& settings = preparation.settings();
    const FaceCrop& crop = prepared.crop;
    PreparedPhoto photo;
    photo.face = face_of_crop(prepared, settings, model);
    photo.face.id = std::filesystem::path(image).stem().string();
    prepared.fit.pose = photo.face.pose;
    photo.aligned = crop.image;
    const Tensor shown = where_known(crop.known, crop.image, unknown_grey).value();
    photo.overlay = preparation_overlay({shown, crop.mask, crop.landmarks, prepared.fit},
                                        preparation.head(), settings.intrinsics, settings.side);
    photo.warnings = std::move(prepared.warnings);
    photo.faces = crop.faces;
    return photo;
}

}  // namespace

Tensor at_model_side(const Tensor& image, std::int64_t side) {
    const int length = static_cast<int>(side);
    return clamp(resize_image(central_square(image), length, length), 0.0, 1.0).value();
}

Face face_of_crop(const PreparedFace& prepared, const PhotoPreparationSettings& settings,
                  const ModelConfig& model) {
    Pose pose = prepared.fit.pose;
    if (prepared.network_rotation) {
        const Eigen::Vector3d angles = angles_from_rotation(*prepared.network_rotation);
        pose = pivot_pose(angles[0], angles[1], angles[2], settings.pivot.distance,
                          settings.pivot.pivot_depth);
    }
    const std::int64_t side = model.decoder.resolution;
    const FaceCrop& crop = prepared.crop;
    return {.id = {},
            .image = at_model_side(crop.image, side),
            .mask = at_model_side(crop.mask, side),
            .known = known_at(crop.known, side, side),
            .pose = pose,
            .intrinsics = settings.intrinsics,
            .photo_side = std::llround(crop.side_in_photo),
            .code = code_of(prepared.fit),
            .has_mask = true,
            .has_pose = true,
            .has_code = true};
}

std::int64_t compared_side(const DecoderConfig& decoder, std::span<const Face> faces) {
    std::int64_t most = 0;
    for (const Face& face : faces)
        most = std::max(most, face.photo_side > 0 ? face.photo_side : decoder.resolution);
    const ResolutionLadder ladder = resolution_ladder(decoder);
    const auto enough = std::ranges::lower_bound(ladder.sides(), most);
    return enough == ladder.sides().end() ? ladder.largest() : *enough;
}

PhotoPreparationSettings settings_for(const ModelConfig& model, PhotoPreparationSettings settings) {
    settings.side = std::max(model.decoder.resolution, least_aligned_side);
    settings.wanted_side = model.decoder.resolution;
    settings.least_side = std::min(least_fitted_side, model.decoder.resolution / 4);
    settings.intrinsics = model.camera.intrinsics;
    settings.pivot = {model.camera.distance, model.camera.pivot_depth};
    // Photos for training are cut out so, too. Pose networks want FFHQ's square.
    settings.whole_head = settings.pose_network.empty();
    return settings;
}

std::vector<PreparedPhoto> prepare_photos(std::span<const std::string> images,
                                          const ModelConfig& model,
                                          const PhotoPreparation& preparation,
                                          const Tensor& known) {
    std::vector<FaceCrop> crops;
    std::vector<std::string> doubts(images.size());
    for (std::size_t i = 0; i < images.size(); ++i)
        crops.push_back(face_of(
            preparation, read_image(images[i], preparation.settings().most_pixels, &doubts[i]),
            images[i], known));
    std::vector<PreparedFace> faces = preparation.finish(std::move(crops));
    std::vector<PreparedPhoto> photos;
    for (std::size_t i = 0; i < faces.size(); ++i) {
        if (!doubts[i].empty()) faces[i].warnings.push_back(doubts[i]);
        photos.push_back(photo_of(images[i], std::move(faces[i]), preparation, model));
    }
    return photos;
}

PreparedPhoto prepare_photo(const Tensor& photo, const std::string& name, const ModelConfig& model,
                            const PhotoPreparation& preparation) {
    std::vector<FaceCrop> crops;
    crops.push_back(face_of(preparation, photo, name, {}));
    return photo_of(name, std::move(preparation.finish(std::move(crops)).front()), preparation,
                    model);
}

}  // namespace stymo
