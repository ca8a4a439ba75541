#include "apps/view/request.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <nlohmann/json.hpp>

#include "apps/view/off_axis_camera.h"
#include "core/angle.h"
#include "core/io/json_check.h"
#include "nn/realtime/view.h"

namespace stymo::view {

namespace {

using Json = nlohmann::json;

constexpr double most_deviations = 6.0;  ///< of a slider
constexpr std::size_t most_keys = 64, most_frames = 900;
constexpr std::size_t most_json_bytes = std::size_t{1} << 20U;

template <class... Parts>
[[noreturn]] void refuse(const Parts&... parts) {
    std::ostringstream text;
    (text << ... << parts);
    throw RequestError(400, text.str());
}

/// Finds the key of a number that float64 cannot hold, for which the parser fails without a name.
struct OverflowFinder : nlohmann::json_sax<Json> {
    std::string last_key;
    bool overflows = false;

    bool key(string_t& name) override {
        last_key = name;
        return true;
    }
    bool parse_error(std::size_t /*place*/, const std::string& /*token*/,
                     const nlohmann::detail::exception& error) override {
        constexpr int out_of_range = 406;
        overflows = error.id == out_of_range;
        return false;
    }
    bool null() override { return true; }
    bool boolean(bool /*value*/) override { return true; }
    bool number_integer(number_integer_t /*value*/) override { return true; }
    bool number_unsigned(number_unsigned_t /*value*/) override { return true; }
    bool number_float(number_float_t /*value*/, const string_t& /*text*/) override { return true; }
    bool string(string_t& /*value*/) override { return true; }
    bool binary(binary_t& /*value*/) override { return true; }
    bool start_object(std::size_t /*size*/) override { return true; }
    bool end_object() override { return true; }
    bool start_array(std::size_t /*size*/) override { return true; }
    bool end_array() override { return true; }
};

Json parsed(const std::string& text) {
    // A parsed document takes some forty times the memory of its text.
    if (text.size() > most_json_bytes) throw RequestError(413, "the request is too large");
    if (const auto fault = json_fault(text)) refuse("the request: ", *fault);
    Json json = Json::parse(text, nullptr, false);
    if (OverflowFinder finder; json.is_discarded() && !Json::sax_parse(text, &finder) &&
                               finder.overflows && !finder.last_key.empty())
        refuse('"', finder.last_key, "\" is too large a number");
    if (json.is_discarded() || !json.is_object()) refuse("the request is not a JSON object");
    return json;
}

double number(const Json& object, const char* key, double usual, double low, double high) {
    if (!object.contains(key)) return usual;
    const Json& value = object.at(key);
    if (!value.is_number()) refuse('"', key, "\" is not a number");
    const auto result = value.get<double>();
    if (!(result >= low && result <= high))
        refuse('"', key, "\" must be from ", low, " to ", high, ", got ", result);
    return result;
}

std::string text(const Json& object, const char* key, const std::string& usual = {}) {
    if (!object.contains(key)) return usual;
    if (!object.at(key).is_string()) refuse('"', key, "\" is not a text");
    return object.at(key).get<std::string>();
}

template <std::size_t count>
std::size_t choice(const Json& object, const char* key,
                   const std::array<const char*, count>& choices) {
    const std::string chosen = text(object, key, choices.front());
    const auto found = std::ranges::find(choices, chosen);
    if (found == choices.end()) refuse('"', key, "\": there is no \"", chosen, '"');
    return static_cast<std::size_t>(found - choices.begin());
}

const Json& member(const Json& object, const char* key) {
    if (!object.contains(key)) refuse('"', key, "\" is missing");
    return object.at(key);
}

std::vector<double> numbers(const Json& array, const char* key, std::size_t most, double low,
                            double high) {
    if (!array.is_array() || array.size() > most)
        refuse('"', key, "\" must be an array of at most ", most, " numbers");
    std::vector<double> result;
    for (const Json& item : array) {
        if (!item.is_number() || !(item.get<double>() >= low && item.get<double>() <= high))
            refuse('"', key, "\" must be numbers from ", low, " to ", high);
        result.push_back(item.get<double>());
    }
    return result;
}

Sliders sliders_of(const Json& object) {
    Sliders sliders;
    if (!object.contains("sliders")) return sliders;
    const Json& all = object.at("sliders");
    if (!all.is_object()) refuse("\"sliders\" is not an object");
    constexpr std::size_t most_directions = 64;
    for (std::size_t group = 0; group < code_names.size(); ++group) {
        if (all.contains(code_names[group]))
            sliders[group] = numbers(all.at(code_names[group]), code_names[group], most_directions,
                                     -most_deviations, most_deviations);
    }
    return sliders;
}

/// The camera of an eye before the screen: lengths in metres from the middle of the picture.
Camera window_camera(const Json& object, const CameraConfig& model) {
    const std::vector<double> eye = numbers(object.at("eye"), "eye", 3, -5.0, 5.0);
    if (eye.size() != 3) refuse("\"eye\" must be three numbers");
    const double screen = number(object, "screen", 0.2, 0.02, 10.0);
    // The window has the size of the model's frontal view at the depth of the face.
    const Window window{.center = {0.0, 0.0, model.pivot_depth},
                        .side = (model.distance - model.pivot_depth) / model.intrinsics.focal};
    const double scale = window.side / screen;
    constexpr double nearest = 2.0;  // world units before the screen
    Eigen::Vector3d position = scale * Eigen::Vector3d(eye[0], eye[1], eye[2]);
    position[2] = std::max(position[2], nearest);
    return off_axis_camera(window, window.center + position);
}

/// A camera that looks at the head: angles in degrees, distance relative to the frontal camera's.
Camera orbit_camera(double yaw, double pitch, double roll, double distance,
                    const CameraConfig& model) {
    return turned_camera(model, head_middle, radians_from_degrees(yaw), radians_from_degrees(pitch),
                         radians_from_degrees(roll), distance);
}

Camera camera_of(const Json& object, const CameraConfig& model) {
    if (!object.is_object()) refuse("\"camera\" is not an object");
    if (object.contains("eye")) return window_camera(object, model);
    return orbit_camera(number(object, "yaw", 0.0, -180.0, 180.0),
                        number(object, "pitch", 0.0, -89.0, 89.0),
                        number(object, "roll", 0.0, -180.0, 180.0),
                        number(object, "distance", 1.0, 0.5, 3.0), model);
}

/// What a request of any kind shows: face and sliders.
template <class Query>
Query query_for_face(const Json& object) {
    Query query;
    query.face = text(object, "face");
    query.sliders = sliders_of(object);
    return query;
}

/// The same as seen by a camera.
template <class Query>
Query query_for_view(const Json& object, const CameraConfig& model) {
    auto query = query_for_face<Query>(object);
    query.camera = camera_of(object.value("camera", Json::object()), model);
    return query;
}

/// A smooth curve through the keys (Catmull and Rom 1974), limited to the range of the keys; `part`
/// in [0, 1].
double along(const std::vector<double>& keys, double part) {
    const double position = part * static_cast<double>(keys.size() - 1);
    const auto last = std::ssize(keys) - 1;
    const auto first =
        std::min(static_cast<std::ptrdiff_t>(position), std::max<std::ptrdiff_t>(last - 1, 0));
    const double t = position - static_cast<double>(first);
    const auto key = [&](std::ptrdiff_t i) {
        return keys[static_cast<std::size_t>(std::clamp<std::ptrdiff_t>(i, 0, last))];
    };
    const double a = key(first - 1), b = key(first), c = key(first + 1), d = key(first + 2);
    const double value =
        b + 0.5 * t * (c - a + t * (2.0 * a - 5.0 * b + 4.0 * c - d + t * (3.0 * (b - c) + d - a)));
    const auto [low, high] = std::ranges::minmax(keys);
    return std::clamp(value, low, high);
}

}  // namespace

const std::string& Request::value(const std::string& name) const {
    const auto found = query.find(name);
    if (found == query.end()) refuse('"', name, "\" is missing");
    return found->second;
}

double Request::number(const std::string& name, double usual, double low, double high) const {
    const auto found = query.find(name);
    if (found == query.end()) return usual;
    const std::string& text = found->second;
    double result = 0.0;
    const char* end = text.data() + text.size();
    const auto [last, error] = std::from_chars(text.data(), end, result);
    if (error != std::errc() || last != end || !(result >= low && result <= high))
        refuse('"', name, "\" must be a number from ", low, " to ", high);
    return result;
}

FrameQuery frame_query(const std::string& json, const CameraConfig& camera) {
    const Json object = parsed(json);
    auto query = query_for_view<FrameQuery>(object, camera);
    if (object.contains("expression"))
        query.expression =
            numbers(object.at("expression"), "expression", std::size_t{code_size}, -100.0, 100.0);
    if (!query.expression.empty() && std::ssize(query.expression) != code_sizes[1])
        refuse("\"expression\" must be ", code_sizes[1], " numbers");
    query.layer = static_cast<Layer>(
        choice(object, "layer", std::array{"image", "depth", "mask", "normals"}));
    query.quality = static_cast<Quality>(
        choice(object, "quality", std::array{"moving", "still", "thumbnail", "snapshot"}));
    return query;
}

ColorQuery color_query(const std::string& json, const CameraConfig& camera) {
    const Json object = parsed(json);
    auto query = query_for_view<ColorQuery>(object, camera);
    query.x = number(object, "x", 0.5, 0.0, 1.0);
    query.y = number(object, "y", 0.5, 0.0, 1.0);
    const std::vector<double> color = numbers(member(object, "color"), "color", 3, 0.0, 1.0);
    if (color.size() != 3) refuse("\"color\" must be three numbers");
    query.color = {color[0], color[1], color[2]};
    return query;
}

FaceQuery face_query(const std::string& json) {
    const Json object = parsed(json);
    auto query = query_for_face<FaceQuery>(object);
    query.name = text(object, "name");
    if (object.contains("codes")) {
        query.source = FaceQuery::Source::codes;
        query.codes = text(object, "codes");
    } else if (object.contains("file")) {
        query.source = FaceQuery::Source::file;
        query.codes = text(object, "file");
    } else if (object.contains("source")) {
        query.source = FaceQuery::Source::mixed;
        query.other = text(object, "source");
        const Json& groups = member(object, "groups");
        if (!groups.is_array() || groups.empty()) refuse("\"groups\" names no group");
        for (const Json& group : groups) {
            const auto found = std::ranges::find(
                code_names, group.is_string() ? group.get<std::string>() : std::string());
            if (found == code_names.end()) refuse("\"groups\" are id, expr, tex, light");
            query.groups[static_cast<std::size_t>(found - code_names.begin())] = true;
        }
    } else if (!query.face.empty()) {
        query.source = FaceQuery::Source::moved;
    } else {
        query.seed = static_cast<std::uint64_t>(number(object, "seed", 1.0, 0.0, 4294967295.0));
        query.truncation = number(object, "truncation", 0.7, 0.0, 2.0);
    }
    return query;
}

FilmQuery film_query(const std::string& json, const CameraConfig& camera) {
    const Json object = parsed(json);
    auto query = query_for_face<FilmQuery>(object);
    query.frames_per_second = number(object, "fps", 24.0, 1.0, 60.0);
    constexpr std::array formats{"gif", "webp", "mp4"};
    query.extension = std::string(".") + formats[choice(object, "format", formats)];
    const Json& keys = member(object, "keys");
    if (!keys.is_array() || keys.size() < 2 || keys.size() > most_keys)
        refuse("a path has from 2 to ", most_keys, " keys");
    std::array<std::vector<double>, 4> tracks;
    for (const Json& key : keys) {
        if (!key.is_object()) refuse("a key is an object");
        tracks[0].push_back(number(key, "yaw", 0.0, -180.0, 180.0));
        tracks[1].push_back(number(key, "pitch", 0.0, -80.0, 80.0));
        tracks[2].push_back(number(key, "roll", 0.0, -180.0, 180.0));
        tracks[3].push_back(number(key, "distance", 1.0, 0.6, 2.5));
    }
    const double seconds = number(object, "seconds", 3.0, 0.1, 60.0);
    const auto frames =
        std::max<std::size_t>(static_cast<std::size_t>(seconds * query.frames_per_second), 2);
    if (frames > most_frames)
        refuse("a film of ", frames, " frames is too long; at most ", most_frames, " are made");
    for (std::size_t i = 0; i < frames; ++i) {
        const double part = static_cast<double>(i) / static_cast<double>(frames - 1);
        query.cameras.push_back(orbit_camera(along(tracks[0], part), along(tracks[1], part),
                                             along(tracks[2], part), along(tracks[3], part),
                                             camera));
    }
    return query;
}

}  // namespace stymo::view
