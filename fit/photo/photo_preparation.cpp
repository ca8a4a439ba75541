#include "fit/photo/photo_preparation.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <mutex>

#include "core/error.h"
#include "core/io/image.h"
#include "core/ops/elementwise.h"
#include "fit/photo/alignment.h"
#include "fit/photo/face_detector.h"
#include "fit/photo/head_mask.h"
#include "fit/photo/photo_warnings.h"
#include "fit/photo/pose_network.h"
#include "nn/known_pixels.h"
#include "nn/pretrained/head_mask_network.h"
#include "render/morphable/head_source.h"

namespace stymo {
namespace {

/// Sides of the images from which masks and the morphable fit are computed.
constexpr std::int64_t usual_mask_side = 512;
constexpr std::int64_t fit_side = 256;

/// A larger landmark error, in units of the image's side, means that the model was fitted to
/// something that is no face.
constexpr double largest_landmark_error = 0.10;

/// Crops with a smaller share of the wanted pixels are refused, because detectors mistake such
/// spots for faces.
constexpr double least_resolution = 0.25;

/// Of a crop with a larger share outside the photo too little is known.
constexpr double largest_unknown_share = 0.7;

/// Crops of which less is known are refused, too.
constexpr double least_known_share = 0.25;

/// Sides of the squares that are tried for a whole head, in units of FFHQ's.
constexpr std::array<double, 3> wider_squares{1.15, 1.3, 1.5};
/// A wider square is of no use if this share of it is new and lies outside the photo.
constexpr double largest_new_share_outside = 0.05;

/// Sides of a crop's image, and of the image from which its mask is made.
struct CropSides {
    std::int64_t image, mask;
    std::int64_t samples_of_a_pixel = 4;  ///< across
    bool has_mask = true;                 ///< if not, the mask is 1 everywhere
};

struct FoundFace {
    Landmarks landmarks;
    std::int64_t faces = 1;
    FaceCovers covers{};
};

/// The faces of a photo that is turned.
struct FoundFaces {
    int quarter_turns = 0;  ///< clockwise
    std::vector<FoundFace> faces;
};

/// The face with this number, counted from the left.
DetectedFace face_with_number(std::vector<DetectedFace> faces, std::int64_t number) {
    if (number > std::ssize(faces))
        fail<ValueError>("has ", faces.size(), faces.size() == 1 ? " face" : " faces", ", no face ",
                         number, " from the left");
    std::ranges::stable_sort(faces, {},
                             [](const DetectedFace& face) { return face.left + 0.5 * face.width; });
    return faces[static_cast<std::size_t>(number - 1)];
}

Tensor resized(const Tensor& image, std::int64_t side) {
    if (image.shape(0) == side && image.shape(1) == side) return image;
    return clamp(resize_image(image, static_cast<int>(side), static_cast<int>(side)), 0.0, 1.0)
        .value();
}

void require_proportions(const Tensor& photo, const Tensor& mask) {
    const double stretch = static_cast<double>(mask.shape(1) * photo.shape(0)) /
                           static_cast<double>(mask.shape(0) * photo.shape(1));
    constexpr double rounding = 0.02;
    if (std::abs(stretch - 1.0) > rounding)
        fail<ValueError>("its mask has ", mask.shape(1), " x ", mask.shape(0),
                         " pixels, which are other proportions than ", photo.shape(1), " x ",
                         photo.shape(0));
}

/// The mask at the photo's own size.
Tensor in_frame_of(const Tensor& photo, const Tensor& mask) {
    const std::int64_t height = photo.shape(0), width = photo.shape(1);
    if (mask.shape(0) == height && mask.shape(1) == width) return mask;
    require_proportions(photo, mask);
    return clamp(resize_image(mask, static_cast<int>(height), static_cast<int>(width)), 0.0, 1.0)
        .value();
}

/// Whether the head leaves the image at the top or the sides. Below it, the neck always does.
bool leaves_frame(const Tensor& mask) {
    constexpr double least_share = 0.02;
    const std::int64_t side = mask.shape(0);
    const std::span<const float> values = mask.values<float>();
    std::array<std::int64_t, 3> heads{};
    for (std::int64_t i = 0; i < side; ++i) {
        const std::array<std::int64_t, 3> pixels{i, i * side, i * side + side - 1};
        for (std::size_t edge = 0; edge < pixels.size(); ++edge)
            if (values[static_cast<std::size_t>(pixels[edge])] > 0.5F) ++heads[edge];
    }
    return static_cast<double>(std::ranges::max(heads)) > least_share * static_cast<double>(side);
}

/// If one face of the batch cannot be fitted, the faces are fitted one by one, so that the others
/// succeed.
std::vector<std::optional<MorphableFit>> fits_of(const MorphableHead& head,
                                                 const std::vector<MorphableFitTarget>& targets,
                                                 const Intrinsics& intrinsics,
                                                 const MorphableFitOptions& options) {
    std::vector<std::optional<MorphableFit>> fits;
    try {
        for (MorphableFit& fit : fit_morphable(head, targets, intrinsics, options))
            fits.emplace_back(std::move(fit));
        return fits;
    } catch (const Error&) {
        if (targets.size() == 1) return {std::nullopt};
    }
    for (const MorphableFitTarget& target : targets)
        fits.push_back(fits_of(head, {target}, intrinsics, options).front());
    return fits;
}

}  // namespace

struct PhotoPreparation::Implementation {
    PhotoPreparationSettings settings;
    MorphableHead head;
    std::optional<HeadMaskModel> masks;
    std::optional<PoseNetwork> network;
    std::mutex network_in_use;
    std::once_flag detector_read;
    std::optional<FaceDetector> detector;

    explicit Implementation(const PhotoPreparationSettings& given)
        : settings(given), head(morphable_head_from(given.morphable)) {
        if (!settings.mask_network.empty()) masks = read_head_mask_model(settings.mask_network);
        if (!settings.pose_network.empty()) network.emplace(settings.pose_network);
    }

    [[nodiscard]] const FaceDetector& read_detector() {
        std::call_once(detector_read, [this] { detector.emplace(settings.landmark_model); });
        return *detector;
    }

    /// The faces of the photo after clockwise quarter turns, which are made if a turned copy shows
    /// a clearer face: the detector sees doubtful faces in those that lie upside down.
    [[nodiscard]] std::pair<int, std::vector<DetectedFace>> detected(const Tensor& photo) {
        constexpr double sure = 1.0, clearer = 0.4;
        const FaceDetector& detector_of_faces = read_detector();
        std::vector<DetectedFace> found = detector_of_faces.find(photo, FaceSearch::clear);
        double confidence = 0.0;
        for (const DetectedFace& face : found) confidence = std::max(confidence, face.confidence);
        if (confidence < sure) {
            const int turns = detector_of_faces.turns_to_face(photo, confidence + clearer);
            if (turns > 0)
                return {turns,
                        detector_of_faces.find(turned_image(photo, turns), FaceSearch::clear)};
        }
        if (found.empty()) found = detector_of_faces.find(photo, FaceSearch::doubtful);
        return {0, std::move(found)};
    }

    [[nodiscard]] FoundFaces faces_in(const Tensor& photo, const KnownOfPhoto& known) {
        if (known.landmarks) return {0, {{*known.landmarks, 1}}};
        auto [quarter_turns, found] = detected(photo);
        FoundFaces result{quarter_turns, {}};
        if (found.empty()) fail<ValueError>("no face was found");
        if (settings.face > 0) {
            const DetectedFace face = face_with_number(std::move(found), settings.face);
            result.faces.push_back({face.landmarks, 1, face.covers});
            return result;
        }
        for (const DetectedFace& face : found)
            result.faces.push_back({face.landmarks, std::ssize(found), face.covers});
        if (!settings.all_faces) result.faces.resize(1);
        return result;
    }

    [[nodiscard]] Tensor made_mask(const Tensor& image, const SurroundedCrop& surrounded) const {
        if (!masks)
            fail<ValueError>(
                "its head mask is not known, and no head-mask network lies beside this "
                "program; name one with --mask-net");
        return head_mask(*masks, image, surrounded);
    }

    [[nodiscard]] FaceCrop crop(const Tensor& photo, const KnownOfPhoto& known,
                                const FoundFace& face) const;
    /// `is_aligned`: the photo is that square already.
    [[nodiscard]] FaceCrop crop_at(const Alignment& alignment, bool is_aligned, const Tensor& photo,
                                   const KnownOfPhoto& known, const FoundFace& face,
                                   CropSides sides) const;
    [[nodiscard]] PreparedFace joined(FaceCrop crop, std::optional<MorphableFit> fit);
    /// Why the face cannot be used; empty if it can.
    [[nodiscard]] std::string failure_of(const FaceCrop& crop,
                                         const std::optional<MorphableFit>& fit) const;
    [[nodiscard]] std::int64_t wanted_side() const {
        return settings.wanted_side > 0 ? settings.wanted_side : settings.side;
    }
};

FaceCrop PhotoPreparation::Implementation::crop(const Tensor& photo, const KnownOfPhoto& known,
                                                const FoundFace& face) const {
    const Alignment narrow = ffhq_alignment(face.landmarks);
    const CropSides sides{settings.side, usual_mask_side};
    FaceCrop crop = crop_at(narrow, is_aligned(narrow, photo.shape(1), photo.shape(0)), photo,
                            known, face, sides);
    if (!settings.whole_head || crop.was_aligned) return crop;
    for (const double scale : wider_squares) {
        if (!leaves_frame(crop.mask)) break;
        const Alignment wide{narrow.center, scale * narrow.axis};
        if (share_outside(wide, photo.shape(1), photo.shape(0)) - crop.share_outside >
            largest_new_share_outside)
            break;
        crop = crop_at(wide, false, photo, known, face, sides);
    }
    return crop;
}

FaceCrop PhotoPreparation::Implementation::crop_at(const Alignment& alignment, bool is_aligned,
                                                   const Tensor& photo,
                                                   const KnownOfPhoto& of_photo,
                                                   const FoundFace& face, CropSides sides) const {
    const std::int64_t height = photo.shape(0), width = photo.shape(1);
    FaceCrop crop;
    crop.was_aligned = is_aligned;
    crop.faces = face.faces;
    crop.side_in_photo = crop.was_aligned ? static_cast<double>(width) : alignment.side();
    crop.share_outside = crop.was_aligned ? 0.0 : share_outside(alignment, width, height);
    // A crop far away, which is refused in the end, could need more memory than there is.
    constexpr double hardly_inside = 0.98;
    const bool is_far = crop.share_outside > hardly_inside;
    const auto cut = [&](const Tensor& from, std::int64_t side) {
        if (is_far) return Tensor::zeros({side, side, from.shape(2)});
        return crop.was_aligned ? resized(from, side)
                                : aligned_crop(from, alignment, side, sides.samples_of_a_pixel);
    };
    const auto landmarks_at = [&](std::int64_t side) {
        return crop.was_aligned ? scaled_landmarks(face.landmarks, static_cast<double>(side) /
                                                                       static_cast<double>(width))
                                : aligned_landmarks(face.landmarks, alignment, side);
    };
    const auto known_pixels = [&](std::int64_t side) {
        if (is_far) return Tensor::zeros({side, side, 1});
        return crop.was_aligned ? known_at(of_photo.known, side, side)
                                : known_crop(alignment, side, height, width, of_photo.known);
    };
    const std::int64_t side = sides.image, mask_side = sides.mask;
    const Tensor large = cut(photo, std::max(side, mask_side));
    crop.image = resized(large, side);
    crop.landmarks = landmarks_at(side);
    const Tensor image = resized(large, mask_side);
    SurroundedCrop surrounded;
    if (!is_far && !crop.was_aligned)
        surrounded = [&] {
            const std::int64_t wide = mask_side + 2 * head_mask_margin(mask_side);
            const double scale = static_cast<double>(wide) / static_cast<double>(mask_side);
            constexpr std::int64_t samples_of_a_pixel = 2;  // enough to find a mask
            return aligned_crop(photo, {alignment.center, scale * alignment.axis}, wide,
                                samples_of_a_pixel);
        };
    const Tensor known = of_photo.mask.defined() ? cut(of_photo.mask, mask_side) : Tensor();
    crop.made_mask = sides.has_mask && (settings.new_masks || !known.defined());
    const Tensor mask = crop.made_mask   ? made_mask(image, surrounded)
                        : sides.has_mask ? known
                                         : Tensor::full({mask_side, mask_side, 1}, 1.0);
    crop.mask = resized(mask, side);
    crop.known = known_pixels(side);
    if (crop.made_mask && known.defined())
        crop.mask_agreement = intersection_over_union(mask, known);
    const Tensor fit_known = known_pixels(fit_side);
    crop.fit_target = {landmarks_at(fit_side), resized(image, fit_side),
                       where_known(fit_known, resized(mask, fit_side), 0.0).value(), fit_known};
    const MorphableFitTarget& small = crop.fit_target;
    crop.look = look_of(small.image, small.mask, small.landmarks, small.known, face.covers);
    if (network) crop.face_box = network->face_box(image);
    return crop;
}

std::string PhotoPreparation::Implementation::failure_of(
    const FaceCrop& crop, const std::optional<MorphableFit>& fit) const {
    const double least_side = settings.least_side > 0
                                  ? static_cast<double>(settings.least_side)
                                  : least_resolution * static_cast<double>(wanted_side());
    if (crop.side_in_photo < least_side)
        return "its face is too small (a crop of " +
               std::to_string(std::llround(crop.side_in_photo)) + " pixels a side, at least " +
               std::to_string(std::llround(least_side)) + " are needed); use a larger photo";
    if (!(crop.share_outside <= largest_unknown_share))
        return "its face is cut off (" + std::to_string(std::lround(100.0 * crop.share_outside)) +
               " percent of the crop lie outside the photo)";
    // What lies outside is unknown, and more may be, which is drawn or covered.
    if (!(known_share(crop.known) >= least_known_share)) return "too little of its face is known";
    if (!fit || !(fit->landmark_error <= largest_landmark_error))
        return "the head model does not fit what was found";
    return {};
}

PreparedFace PhotoPreparation::Implementation::joined(FaceCrop crop,
                                                      std::optional<MorphableFit> fit) {
    PreparedFace face;
    face.failure = failure_of(crop, fit);
    face.fit = std::move(fit).value_or(MorphableFit{});
    double yaw = face.fit.pose.yaw;
    if (network && face.failure.empty()) {
        const std::lock_guard lock(network_in_use);
        try {
            face.network_rotation = network->rotation(crop.face_box);
            yaw = angles_from_rotation(*face.network_rotation)[0];
        } catch (const NumericError& error) {
            face.failure = std::string("the pose network gives ") + error.what();
        }
    }
    face.warnings = photo_warnings({.faces = settings.all_faces ? 1 : crop.faces,
                                    .quarter_turns = crop.quarter_turns,
                                    .crop_side = crop.side_in_photo,
                                    .wanted_side = wanted_side(),
                                    .share_outside = crop.share_outside,
                                    .covered_share = covered_share(crop.mask),
                                    .yaw = yaw,
                                    .landmark_error = face.fit.landmark_error,
                                    .made_mask = crop.made_mask,
                                    .look = crop.look});
    crop.face_box = {};
    face.crop = std::move(crop);
    return face;
}

PhotoPreparation::PhotoPreparation(const PhotoPreparationSettings& settings)
    : implementation_(std::make_unique<Implementation>(settings)) {}
PhotoPreparation::~PhotoPreparation() = default;
PhotoPreparation::PhotoPreparation(PhotoPreparation&&) noexcept = default;
PhotoPreparation& PhotoPreparation::operator=(PhotoPreparation&&) noexcept = default;

const PhotoPreparationSettings& PhotoPreparation::settings() const {
    return implementation_->settings;
}

const MorphableHead& PhotoPreparation::head() const {
    return implementation_->head;
}

const FaceDetector& PhotoPreparation::detector() const {
    return implementation_->read_detector();
}

FaceCrop PhotoPreparation::frame_crop(const Tensor& frame, const Landmarks& landmarks,
                                      bool has_mask) const {
    const std::int64_t side = implementation_->wanted_side();
    return implementation_->crop_at(ffhq_alignment(landmarks), false, frame, {}, {landmarks},
                                    {side, side, 2, has_mask});
}

std::vector<FaceCrop> PhotoPreparation::crops(const Tensor& photo,
                                              const KnownOfPhoto& known) const {
    const auto [quarter_turns, faces] = implementation_->faces_in(photo, known);
    const Tensor upright = turned_image(photo, quarter_turns);
    KnownOfPhoto in_frame = known;
    if (known.mask.defined())
        in_frame.mask = in_frame_of(upright, turned_image(known.mask, quarter_turns));
    if (known.known.defined()) {
        const Tensor pixels = turned_image(known.known, quarter_turns);
        require_proportions(upright, pixels);
        in_frame.known = known_at(pixels, upright.shape(0), upright.shape(1));
    }
    std::vector<FaceCrop> crops;
    for (const FoundFace& face : faces) {
        crops.push_back(implementation_->crop(upright, in_frame, face));
        crops.back().quarter_turns = quarter_turns;
    }
    return crops;
}

std::vector<PreparedFace> PhotoPreparation::finish(std::vector<FaceCrop> crops,
                                                   const MorphableFitOptions& options) const {
    if (crops.empty()) return {};
    Implementation& tools = *implementation_;
    std::vector<MorphableFitTarget> targets;
    for (FaceCrop& crop : crops) targets.push_back(std::move(crop.fit_target));
    std::vector<std::optional<MorphableFit>> fits =
        fits_of(tools.head, targets, tools.settings.intrinsics, options);
    std::vector<PreparedFace> faces;
    for (std::size_t i = 0; i < crops.size(); ++i)
        faces.push_back(tools.joined(std::move(crops[i]), std::move(fits[i])));
    return faces;
}

}  // namespace stymo
