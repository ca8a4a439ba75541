#include "apps/view_client.h"

#include <catch2/catch.hpp>
#include <chrono>
#include <thread>

#include "apps/tiny_run.h"

namespace stymo {

namespace {

view::ViewerOptions tiny_viewer(const std::function<void(view::ViewerOptions&)>& change) {
    view::ViewerOptions options;
    options.model.file = tiny_run() / "run/model.safetensors";
    options.codes = {(tiny_run() / "fit/codes.json").string()};
    options.fit_steps = 3;
    options.color_steps = 2;
    if (change) change(options);
    return options;
}

}  // namespace

ViewClient::ViewClient(const std::function<void(view::ViewerOptions&)>& change)
    : shared_(tiny_viewer(change)), api_(shared_, 4) {
    opened_ = nlohmann::json::parse(api_({.path = "/api/session"}).body);
}

view::Answer ViewClient::ask(const std::string& path, const nlohmann::json& body) {
    return send(path, body.is_null() ? "" : body.dump());
}

view::Answer ViewClient::send(const std::string& path, const std::string& body,
                              const std::map<std::string, std::string>& query) {
    return api_({.path = "/api/" + path,
                 .session = opened_.value("session", ""),
                 .query = query,
                 .body = body});
}

nlohmann::json ViewClient::json(const std::string& path, const nlohmann::json& body) {
    const view::Answer answer = ask(path, body);
    INFO(answer.body);
    REQUIRE(answer.status == 200);
    return nlohmann::json::parse(answer.body);
}

nlohmann::json ViewClient::ended_job() {
    using std::chrono_literals::operator""ms;
    nlohmann::json status;
    for (int i = 0; i < 600; ++i) {
        status = json("job");
        if (status["state"] != "running") break;
        std::this_thread::sleep_for(50ms);
    }
    return status;
}

}  // namespace stymo
