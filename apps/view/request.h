#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "apps/view/frame.h"
#include "core/error.h"
#include "nn/models/codes.h"
#include "render/camera.h"

namespace stymo::view {

/// A request that is invalid or not allowed, with its HTTP status.
class RequestError : public Error {
public:
    RequestError(int status, const std::string& message) : Error(message), status_(status) {}
    [[nodiscard]] int status() const { return status_; }

private:
    int status_;
};

/// A request to the server, independent of the HTTP library.
struct Request {
    std::string path;  ///< "/api/frame"
    std::string session{};
    std::map<std::string, std::string> query{};
    std::string body{};

    /// A value of the query. Throws RequestError if it is missing.
    [[nodiscard]] const std::string& value(const std::string& name) const;
    /// A number of the query; `usual` if it is missing. Throws RequestError for a text that is not
    /// a number from low to high.
    [[nodiscard]] double number(const std::string& name, double usual, double low,
                                double high) const;
};

/// Amounts of the sliders: standard deviations along each group's directions.
using Sliders = std::array<std::vector<double>, code_names.size()>;

/// A frame that the page requests.
struct FrameQuery {
    std::string face;
    Sliders sliders;
    std::vector<double> expression;  ///< what the viewer's own face adds; 79 numbers, or none
    Camera camera;
    Layer layer = Layer::image;
    Quality quality = Quality::moving;
};

/// A request to change the colour of the part of the face at (x, y) of the image, both in [0, 1].
struct ColorQuery {
    std::string face;
    Sliders sliders;
    Camera camera;
    double x = 0.5;
    double y = 0.5;
    Eigen::Vector3d color = Eigen::Vector3d::Zero();
};

// These functions parse the JSON body of a request. They throw RequestError for a body that is
// malformed, too large or has numbers out of range.

[[nodiscard]] FrameQuery frame_query(const std::string& json, const CameraConfig& camera);
[[nodiscard]] ColorQuery color_query(const std::string& json, const CameraConfig& camera);

/// A request for a new face.
struct FaceQuery {
    enum class Source {
        drawn,  ///< {"seed", "truncation"}
        codes,  ///< {"codes": text_of_codes}
        file,   ///< {"file": the contents of a codes.json}
        mixed,  ///< {"face", "source", "groups": ["expr", ...]}
        moved,  ///< {"face", "sliders"}: the sliders become part of the face
    };
    Source source = Source::drawn;
    std::uint64_t seed = 0;
    double truncation = 0.7;
    std::string codes;  ///< for `codes`; for `file` the contents of the file
    std::string name;
    std::string face;
    std::string other;
    std::array<bool, code_names.size()> groups{};
    Sliders sliders;
};
[[nodiscard]] FaceQuery face_query(const std::string& json);

/// A request for a film:
/// {"face", "sliders", "keys": [camera, ...], "seconds", "fps", "format": "gif", "webp" or "mp4"}:
/// cameras along a smooth path through the keys.
struct FilmQuery {
    std::string face;
    Sliders sliders;
    std::vector<Camera> cameras;
    double frames_per_second = 24.0;
    std::string extension;
};
[[nodiscard]] FilmQuery film_query(const std::string& json, const CameraConfig& camera);

}  // namespace stymo::view
