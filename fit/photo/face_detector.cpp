#include "fit/photo/face_detector.h"

#include "core/error.h"

#ifdef STYMO_WITH_DLIB

// The two headers that read dlib's configuration. Debian's package requires BLAS in every program
// that includes dlib, but does not depend on it. The functions used here multiply no large
// matrices.
#include <dlib/assert.h>
#include <dlib/test_for_odr_violations.h>
#undef DLIB_USE_BLAS
#undef DLIB_USE_LAPACK

#include <dlib/array2d.h>
#include <dlib/image_processing/frontal_face_detector.h>
#include <dlib/image_processing/shape_predictor.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>
#include <utility>

#include "core/io/image.h"

namespace stymo {
namespace {

namespace fs = std::filesystem;

constexpr const char* debian_landmark_model =
    "/usr/share/dlib/shape_predictor_68_face_landmarks.dat";

/// A search: the longer side of the searched copy in pixels, and the smallest confidence of a face.
struct Search {
    double longer_side;
    double confidence;
};

/// The searches run one after the other until one finds a face. The detector's window is 80 pixels
/// wide. The first search misses large profiles and covered eyes; the last one finds them, and is
/// last so that it does not hide small, clearly visible faces.
constexpr std::array<Search, 4> searches = {{{640, 0.0}, {1280, 0.0}, {2560, 0.0}, {320, -0.2}}};
constexpr double largest_enlargement = 4.0;

/// Width of a face, in pixels, in the image in which its landmarks are predicted. The predictor
/// rounds to whole pixels.
constexpr double predicted_face_width = 320.0;

using Image = dlib::array2d<dlib::rgb_pixel>;

Image image_of(const Tensor& image) {
    Image copy(image.shape(0), image.shape(1));
    const std::span<const float> values = image.values<float>();
    std::size_t at = 0;
    const auto byte = [&] {
        return static_cast<unsigned char>(std::clamp(values[at++], 0.0F, 1.0F) * 255.0F + 0.5F);
    };
    for (long row = 0; row < copy.nr(); ++row)
        for (dlib::rgb_pixel& pixel :
             std::span(&copy[row][0], static_cast<std::size_t>(copy.nc()))) {
            pixel.red = byte();
            pixel.green = byte();
            pixel.blue = byte();
        }
    return copy;
}

int scaled_length(std::int64_t length, double scale) {
    return std::max(1, static_cast<int>(std::lround(static_cast<double>(length) * scale)));
}

Tensor scaled_image(const Tensor& image, double scale) {
    return resize_image(image, scaled_length(image.shape(0), scale),
                        scaled_length(image.shape(1), scale));
}

/// The part of a photo around a face, and its position.
struct Surroundings {
    Tensor image;
    double left;
    double top;
    double scale;
};

Surroundings surroundings_of(const Tensor& photo, const DetectedFace& face) {
    // The jaw may reach beyond the detector's box by a third of it.
    const double margin = 0.5 * face.width;
    const auto bound = [](double value, std::int64_t length) {
        return std::clamp<std::int64_t>(std::llround(value), 0, length);
    };
    const std::int64_t height = photo.shape(0);
    const std::int64_t width = photo.shape(1);
    const std::int64_t left = bound(face.left - margin, width - 1);
    const std::int64_t top = bound(face.top - margin, height - 1);
    const std::int64_t right = std::max(bound(face.left + face.width + margin, width), left + 1);
    const std::int64_t bottom = std::max(bound(face.top + face.height + margin, height), top + 1);
    const Tensor part = image_part(photo, top, left, bottom - top, right - left);
    const double scale = predicted_face_width / face.width;
    return {scaled_image(part, scale), static_cast<double>(left), static_cast<double>(top), scale};
}

/// Largest first. A pattern that only resembles a face may be larger than the face.
void sort_faces(std::vector<DetectedFace>& faces) {
    constexpr double doubtful = 0.25;
    double clearest = 0.0;
    for (const DetectedFace& face : faces) clearest = std::max(clearest, face.confidence);
    std::ranges::stable_sort(faces, {}, [&](const DetectedFace& face) {
        return std::pair(face.confidence < doubtful * clearest, -face.width * face.height);
    });
}

}  // namespace

struct FaceDetector::Implementation {
    dlib::frontal_face_detector detector = dlib::get_frontal_face_detector();
    dlib::shape_predictor predictor;
    std::optional<LandmarkModel> network;  ///< used instead of the predictor

    void read_predictor(const fs::path& path) {
        try {
            dlib::deserialize(path.string()) >> predictor;
        } catch (const std::exception&) {
            fail<FileError>(path.string(), ": not a model of dlib's shape_predictor");
        }
        if (predictor.num_parts() != Landmarks().size())
            fail<FileError>(path.string(), ": predicts ", predictor.num_parts(),
                            " landmarks; 68 are needed");
    }

    [[nodiscard]] std::vector<DetectedFace> boxes(const Tensor& photo, double scale,
                                                  double confidence) const {
        // A detector keeps the image that it searches, so each call searches with a copy of the
        // detector, which is small.
        dlib::frontal_face_detector searching = detector;
        std::vector<std::pair<double, dlib::rectangle>> found;
        searching(image_of(scaled_image(photo, scale)), found, confidence);
        std::vector<DetectedFace> faces;
        for (const auto& [confidence_of_box, box] : found)
            faces.push_back({static_cast<double>(box.left()) / scale,
                             static_cast<double>(box.top()) / scale,
                             static_cast<double>(box.width()) / scale,
                             static_cast<double>(box.height()) / scale,
                             confidence_of_box,
                             {},
                             {}});
        return faces;
    }

    void find_landmarks(const Tensor& photo, DetectedFace& face) const {
        face.landmarks =
            network ? find_points(*network, photo,
                                  square_of_box(face.left, face.top, face.width, face.height),
                                  &face.covers)
                    : predicted(photo, face);
    }

    [[nodiscard]] Landmarks predicted(const Tensor& photo, const DetectedFace& face) const {
        const auto [image, left, top, scale] = surroundings_of(photo, face);
        const auto pixel = [by = scale](double length) { return std::lround(length * by); };
        const dlib::rectangle box(pixel(face.left - left), pixel(face.top - top),
                                  pixel(face.left + face.width - left) - 1,
                                  pixel(face.top + face.height - top) - 1);
        const dlib::full_object_detection shape = predictor(image_of(image), box);
        Landmarks result;
        for (std::size_t i = 0; i < result.size(); ++i) {
            const dlib::point& point = shape.part(i);
            result[i] = {left + (static_cast<double>(point.x()) + 0.5) / scale,
                         top + (static_cast<double>(point.y()) + 0.5) / scale};
        }
        return result;
    }
};

bool FaceDetector::available() {
    return true;
}

FaceDetector::FaceDetector(const fs::path& landmark_model) {
    auto implementation = std::make_unique<Implementation>();
    const fs::path path = landmark_model.empty() ? fs::path(debian_landmark_model) : landmark_model;
    if (!fs::is_regular_file(path))
        fail<FileError>(
            path.string(),
            ": no such file; install the package libdlib-data or give a model of 68 landmarks");
    if (path.extension() == ".safetensors")
        implementation->network = read_landmark_model(path);
    else
        implementation->read_predictor(path);
    implementation_ = std::move(implementation);
}

std::vector<DetectedFace> FaceDetector::find(const Tensor& photo, FaceSearch search) const {
    if (photo.rank() != 3 || photo.size() == 0 || photo.shape(2) != 3)
        fail<ShapeError>("[face detector] a photo is (height, width, 3); got ", photo.shape());
    const auto longer_side = static_cast<double>(std::max(photo.shape(0), photo.shape(1)));
    std::vector<DetectedFace> faces;
    double former_scale = 0.0;
    const std::array<Search, 2> quick_searches{{{longer_side, 0.0}, {2.0 * longer_side, 0.0}}};
    const std::span<const Search> all(searches);
    const std::span<const Search> chosen = search == FaceSearch::quick
                                               ? std::span<const Search>(quick_searches)
                                           : search == FaceSearch::clear ? all.first(all.size() - 1)
                                           : search == FaceSearch::doubtful ? all.last(1)
                                                                            : all;
    for (const auto& [side, confidence] : chosen) {
        // The first search never enlarges the photo, because most small photos are filled by a
        // face.
        const bool is_first = former_scale == 0.0 && search != FaceSearch::doubtful;
        const double limit = is_first ? 1.0 : largest_enlargement;
        const double scale = std::min(limit, side / longer_side);
        if (scale == former_scale) continue;
        former_scale = scale;
        faces = implementation_->boxes(photo, scale, confidence);
        if (!faces.empty()) break;
    }
    for (DetectedFace& face : faces) implementation_->find_landmarks(photo, face);
    sort_faces(faces);
    return faces;
}

int FaceDetector::turns_to_face(const Tensor& photo, double confidence) const {
    constexpr double side = 640.0;
    const auto longer_side = static_cast<double>(std::max(photo.shape(0), photo.shape(1)));
    const Tensor small = scaled_image(photo, std::min(1.0, side / longer_side));
    int best_turns = 0;
    for (int turns = 1; turns < 4; ++turns) {
        for (const DetectedFace& face :
             implementation_->boxes(turned_image(small, turns), 1.0, confidence)) {
            if (face.confidence <= confidence) continue;
            confidence = face.confidence;
            best_turns = turns;
        }
    }
    return best_turns;
}

}  // namespace stymo

#else

namespace stymo {

struct FaceDetector::Implementation {};

bool FaceDetector::available() {
    return false;
}

FaceDetector::FaceDetector(const std::filesystem::path&) {
    fail(
        "faces cannot be found: this build is without dlib; install libdlib-dev and libdlib-data "
        "and build again");
}

std::vector<DetectedFace> FaceDetector::find(const Tensor&, FaceSearch) const {
    return {};
}

int FaceDetector::turns_to_face(const Tensor&, double) const {
    return 0;
}

}  // namespace stymo

#endif

namespace stymo {

FaceDetector::~FaceDetector() = default;
FaceDetector::FaceDetector(FaceDetector&&) noexcept = default;
FaceDetector& FaceDetector::operator=(FaceDetector&&) noexcept = default;

}  // namespace stymo
