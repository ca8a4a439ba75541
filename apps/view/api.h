#pragma once

#include <string>
#include <utility>
#include <vector>

#include "apps/view/request.h"
#include "apps/view/session.h"
#include "apps/view/shared_state.h"

namespace stymo::view {

/// An HTTP response.
struct Answer {
    int status = 200;
    std::string type = "application/json";
    std::string body = "{}";
    std::vector<std::pair<std::string, std::string>> headers{};
};

/// Handles the requests of the page under /api, independently of the HTTP library. Thread-safe.
class Api {
public:
    Api(SharedState& shared, std::size_t most_sessions);

    /// Handles a request. Errors become answers {"error": one line}; it throws nothing.
    [[nodiscard]] Answer operator()(const Request& request);
    [[nodiscard]] const Sessions& sessions() const { return sessions_; }

private:
    [[nodiscard]] Answer answer(const Request& request);
    [[nodiscard]] Answer open_session();
    [[nodiscard]] Answer frame(Session& session, const Request& request);
    [[nodiscard]] Answer new_face(Session& session, const Request& request);
    [[nodiscard]] Answer fit(Session& session, const Request& request);
    [[nodiscard]] Answer color(Session& session, const Request& request);
    [[nodiscard]] Answer film_path(Session& session, const Request& request);
    [[nodiscard]] Answer make_mesh(Session& session, const Request& request);
    /// The face of the request with its sliders applied.
    [[nodiscard]] ListedFace shown_face(Session& session, const Request& request) const;
    [[nodiscard]] ListedFace moved_face(Session& session, const std::string& id,
                                        const Sliders& sliders) const;
    [[nodiscard]] Answer codes_file(Session& session, const Request& request);
    [[nodiscard]] Answer tuned_file(Session& session, const Request& request);
    /// The inverse of tuned_file; the body of the request is the file.
    [[nodiscard]] Answer tuned_face(Session& session, const Request& request);
    [[nodiscard]] Answer eyes(Session& session, const Request& request);
    /// What moves the shown face as the viewer's own; the body is an image of the camera.
    [[nodiscard]] Answer own_expression(Session& session, const Request& request);

    SharedState& shared_;
    Sessions sessions_;
};

}  // namespace stymo::view
