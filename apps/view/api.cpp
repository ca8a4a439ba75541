#include "apps/view/api.h"

#include <array>
#include <cmath>

#include "apps/view/jobs.h"
#include "core/angle.h"
#include "core/clock.h"
#include "core/io/jpeg.h"
#include "core/io/json_writer.h"
#include "core/ops/elementwise.h"
#include "fit/edit/style_mix.h"
#include "nn/realtime/view.h"

namespace stymo::view {

namespace {

constexpr std::array group_labels{"Identity", "Expression", "Texture", "Light"};
constexpr std::int64_t most_camera_pixels = 1280 * 960;
/// A film is kept as a whole until it is written, with 12 bytes for each pixel.
constexpr std::int64_t most_film_pixels = 900 * 256 * 256;

JsonValue to_json(const std::string& id, const ListedFace& face) {
    // As the page's address has it.
    constexpr double digits = 1000.0;
    const double distance = usual_distance(face.model->config().camera, face.face.pose);
    const double rounded = std::ceil(digits * distance) / digits;
    return JsonValue::object({{"face", id},
                              {"name", face.name},
                              {"tuned", face.tuned},
                              {"distance", rounded},
                              {"codes", text_of_codes(face.face.codes)}});
}

Answer json(const JsonValue& value) {
    return {.body = value.text()};
}

Answer faces_answer(Session& session, const std::string& chosen) {
    std::vector<JsonValue> faces;
    for (const auto& [id, face] : session.faces().all()) faces.push_back(to_json(id, face));
    JsonValue value = JsonValue::object({{"faces", faces}});
    if (!chosen.empty()) value.add("face", chosen);
    return json(value);
}

Answer job_answer(const Session& session) {
    const std::optional<JobStatus> status = session.job_status();
    if (!status) return json(JsonValue::object({{"state", "none"}}));
    constexpr std::array states{"running", "done", "failed", "cancelled"};
    return json(JsonValue::object({{"state", states[static_cast<std::size_t>(status->state)]},
                                   {"phase", status->phase},
                                   {"done", status->done},
                                   {"total", status->total},
                                   {"loss", status->loss},
                                   {"face", status->face},
                                   {"note", status->note},
                                   {"faces", status->faces},
                                   {"error", status->error},
                                   {"artifact", status->has_artifact}}));
}

/// {"names": {"id": [[more, less], ...], ...}}, or {} until they are known.
Answer names_answer(const std::optional<DirectionNames>& names) {
    JsonValue groups = JsonValue::object();
    for (std::size_t group = 0; names && group < code_names.size(); ++group) {
        std::vector<JsonValue> ends;
        for (const auto& [more, less] : (*names)[group])
            ends.emplace_back(std::vector<JsonValue>{more, less});
        groups.add(code_names[group], ends);
    }
    return json(names ? JsonValue::object({{"names", groups}}) : JsonValue::object());
}

Answer download(std::string bytes, const std::string& type, const std::string& name) {
    return {.type = type,
            .body = std::move(bytes),
            .headers = {{"Content-Disposition", "attachment; filename=\"" + name + "\""}}};
}

Codes moved(const SharedState& shared, const Codes& codes, const Sliders& sliders) {
    return moved_along(codes, shared.directions(), sliders);
}

}  // namespace

Api::Api(SharedState& shared, std::size_t most_sessions)
    : shared_(shared), sessions_(shared, most_sessions) {}

Answer Api::operator()(const Request& request) {
    const auto failed = [](int status, const std::string& message) {
        Answer answer = json(JsonValue::object({{"error", message}}));
        answer.status = status;
        return answer;
    };
    try {
        return answer(request);
    } catch (const RequestError& error) {
        return failed(error.status(), error.what());
    } catch (const ValueError& error) {
        return failed(400, error.what());
    } catch (const FileError& error) {
        return failed(400, error.what());
    } catch (const std::exception& error) {
        return failed(500, error.what());
    }
}

Answer Api::answer(const Request& request) {
    if (request.path == "/api/session") return open_session();
    const std::shared_ptr<Session> session = sessions_.find(request.session);
    if (!session) throw RequestError(410, "this session has ended; load the page again");
    if (!session->allows_request()) throw RequestError(429, "too many requests; wait a moment");
    const std::string& path = request.path;
    if (path == "/api/frame") return frame(*session, request);
    if (path == "/api/faces") return faces_answer(*session, "");
    if (path == "/api/names") return names_answer(shared_.direction_names());
    if (path == "/api/face") return new_face(*session, request);
    if (path == "/api/remove") {
        session->faces().remove(request.value("face"));
        return faces_answer(*session, "");
    }
    if (path == "/api/photo") return fit(*session, request);
    if (path == "/api/color") return color(*session, request);
    if (path == "/api/film") return film_path(*session, request);
    if (path == "/api/mesh") return make_mesh(*session, request);
    if (path == "/api/job") return job_answer(*session);
    if (path == "/api/cancel") {
        session->cancel();
        return job_answer(*session);
    }
    if (path == "/api/result") {
        const std::optional<Artifact> artifact = session->artifact();
        if (!artifact) throw RequestError(404, "there is no result yet");
        return download(artifact->bytes, artifact->type, artifact->name);
    }
    if (path == "/api/codes") return codes_file(*session, request);
    if (path == "/api/tuned") return tuned_file(*session, request);
    if (path == "/api/weights") return tuned_face(*session, request);
    if (path == "/api/eyes") return eyes(*session, request);
    if (path == "/api/expression") return own_expression(*session, request);
    if (path == "/api/close") {
        sessions_.close(request.session);
        return {};
    }
    throw RequestError(404, "there is no " + path);
}

Answer Api::open_session() {
    if (!sessions_.allows_opening())
        throw RequestError(429, "too many pages are opened at once; wait a moment");
    const std::shared_ptr<Session> session = sessions_.open();
    if (!session) throw RequestError(503, "too many viewers are open; close one and try again");
    std::vector<JsonValue> groups;
    for (std::size_t group = 0; group < code_names.size(); ++group) {
        groups.push_back(JsonValue::object({{"group", code_names[group]},
                                            {"label", group_labels[group]},
                                            {"shares", shared_.directions()[group].shares}}));
    }
    std::vector<JsonValue> faces;
    for (const auto& [id, face] : session->faces().all()) faces.push_back(to_json(id, face));
    const Model& model = *shared_.model();
    return json(JsonValue::object({{"session", session->id()},
                                   {"model", shared_.mark()},
                                   {"faces", faces},
                                   {"groups", groups},
                                   {"resolution", model.config().decoder.resolution},
                                   {"psnr", shared_.options().frames.psnr},
                                   {"draws", model.code_statistics().has_value()},
                                   {"fits", model.has_encoder() && FaceDetector::available()}}));
}

Answer Api::frame(Session& session, const Request& request) {
    const FrameQuery query = frame_query(request.body, shared_.model()->config().camera);
    const ListedFace face = session.faces().find(query.face);
    Codes codes = moved(shared_, face.face.codes, query.sliders);
    if (!query.expression.empty()) {
        Variable& expression = codes.groups[1];
        expression =
            (expression +
             Variable(Tensor::from(expression.shape(), query.expression).to(expression.dtype())))
                .detach();
    }
    const double start = seconds_now();
    const std::optional<Frame> frame = shared_.scheduler().render(
        session.id(), {face.model, codes, query.camera, query.layer, query.quality});
    if (!frame) return {.status = 204, .body = {}};  // a newer one was asked for
    JsonValue frame_info = JsonValue::object({{"milliseconds", frame->milliseconds},
                                              {"waited", 1e3 * (seconds_now() - start)},
                                              {"mode", frame->mode},
                                              {"side", frame->side},
                                              {"tolerance", frame->tolerance}});
    if (frame->moving_psnr) frame_info.add("psnr", *frame->moving_psnr);
    return {.type = "image/jpeg",
            .body = frame->jpeg,
            .headers = {{"X-Stymo-Frame", frame_info.text()}}};
}

Answer Api::new_face(Session& session, const Request& request) {
    const FaceQuery query = face_query(request.body);
    ListedFace face{query.name, {}, shared_.model()};
    switch (query.source) {
        case FaceQuery::Source::drawn:
            face.face = shared_.drawn_face(query.seed, query.truncation);
            if (face.name.empty()) face.name = "drawn " + std::to_string(query.seed);
            break;
        case FaceQuery::Source::codes:
            face.face = {codes_of_text(query.codes),
                         frontal_pose(shared_.model()->config().camera)};
            if (face.name.empty()) face.name = "shared";
            break;
        case FaceQuery::Source::file:
            face.face = parse_code_file(query.codes, "the file");
            require_mark(face.face, shared_.mark(), "the file");
            if (face.name.empty()) face.name = "opened";
            break;
        case FaceQuery::Source::mixed: {
            const ListedFace target = session.faces().find(query.face),
                             source = session.faces().find(query.other);
            face.model = target.model;
            face.tuned = target.tuned;
            face.face = target.face;
            face.face.codes = mix_codes(moved(shared_, target.face.codes, query.sliders),
                                        source.face.codes, query.groups);
            if (face.name.empty()) face.name = target.name + " + " + source.name;
            break;
        }
        case FaceQuery::Source::moved: {
            face = moved_face(session, query.face, query.sliders);
            face.name = query.name.empty() ? face.name + ", changed" : query.name;
            break;
        }
    }
    return faces_answer(session, session.faces().add(face));
}

ListedFace Api::shown_face(Session& session, const Request& request) const {
    const FrameQuery query = frame_query(request.body, shared_.model()->config().camera);
    return moved_face(session, query.face, query.sliders);
}

ListedFace Api::moved_face(Session& session, const std::string& id, const Sliders& sliders) const {
    ListedFace face = session.faces().find(id);
    face.face.codes = moved(shared_, face.face.codes, sliders);
    return face;
}

Answer Api::fit(Session& session, const Request& request) {
    constexpr double longest_tuning = 600.0;
    const double tune = request.number("tune", 0.0, 0.0, longest_tuning);
    const auto face = static_cast<std::int64_t>(request.number("face", 0.0, 0.0, 1000.0));
    const auto cover = static_cast<std::size_t>(
        request.number("cover", 0.0, 0.0, static_cast<double>(request.body.size())));
    if (request.body.size() <= cover) throw RequestError(400, "the photo is missing");
    const std::string photo = request.body.substr(0, request.body.size() - cover);
    if (!shared_.model()->has_encoder())
        throw RequestError(400, "this model has no encoder, so no photo can be fitted");
    if (tune > 0.0) session.faces().require_room_for_tuned();
    session.start(
        fit_photo(shared_, session, photo, request.body.substr(photo.size()), tune, face));
    return job_answer(session);
}

Answer Api::color(Session& session, const Request& request) {
    const ColorQuery query = color_query(request.body, shared_.model()->config().camera);
    session.start(recolor(shared_, session, moved_face(session, query.face, query.sliders), query));
    return job_answer(session);
}

Answer Api::film_path(Session& session, const Request& request) {
    const FilmQuery query = film_query(request.body, shared_.model()->config().camera);
    const std::int64_t side = shared_.model()->config().decoder.resolution;
    if (std::ssize(query.cameras) * side * side > most_film_pixels)
        throw RequestError(400, "this film is too long for its size; give fewer seconds");
    const ListedFace face = moved_face(session, query.face, query.sliders);
    session.start(film(shared_, face, query));
    return job_answer(session);
}

Answer Api::make_mesh(Session& session, const Request& request) {
    session.start(mesh(shared_, shown_face(session, request)));
    return job_answer(session);
}

Answer Api::codes_file(Session& session, const Request& request) {
    const ListedFace face = shown_face(session, request);
    return download(code_file_text(face.face.codes, 0, face.face.pose, shared_.mark()),
                    "application/json", "codes.json");
}

Answer Api::tuned_file(Session& session, const Request& request) {
    const ListedFace face = session.faces().find(request.value("face"));
    if (!face.tuned) throw RequestError(400, "this face is not tuned");
    session.start(save_tuned(shared_, face));
    return job_answer(session);
}

Answer Api::tuned_face(Session& session, const Request& request) {
    const ListedFace face = session.faces().find(request.value("face"));
    if (request.body.empty()) throw RequestError(400, "the tuned file is missing");
    session.faces().require_room_for_tuned();
    session.start(open_tuned(shared_, session, face, request.body));
    return job_answer(session);
}

Answer Api::eyes(Session& session, const Request& request) {
    EyeCamera camera;
    camera.field_of_view = request.number("fov", camera.field_of_view, 0.2, 2.6);
    camera.position = {request.number("x", 0.0, -2.0, 2.0), request.number("y", 0.15, -2.0, 2.0),
                       request.number("z", 0.0, -2.0, 2.0)};
    const double start = seconds_now();
    const std::optional<EyeTracker::Sight> sight =
        session.see(image_from_jpeg(request.body, most_camera_pixels), camera);
    JsonValue value = JsonValue::object(
        {{"found", sight.has_value()}, {"milliseconds", 1e3 * (seconds_now() - start)}});
    if (sight) {
        const auto list = [](const Eigen::Vector3d& point) {
            return std::vector<double>{point[0], point[1], point[2]};
        };
        value.add("measured", list(sight->measured));
        value.add("eye", list(sight->filtered));
        value.add("lag", 1e3 * sight->lag);
    }
    return json(value);
}

Answer Api::own_expression(Session& session, const Request& request) {
    const double start = seconds_now();
    const std::optional<LiveFace::Sight> sight = session.see_face(
        image_from_jpeg(request.body, most_camera_pixels), request.query.contains("anew"));
    JsonValue value = JsonValue::object(
        {{"found", sight.has_value()}, {"milliseconds", 1e3 * (seconds_now() - start)}});
    if (sight)
        value.add("expression", sight->change.to_vector())
            .add("yaw", degrees_from_radians(sight->yaw))
            .add("pitch", degrees_from_radians(sight->pitch))
            .add("roll", degrees_from_radians(sight->roll));
    return json(value);
}

}  // namespace stymo::view
