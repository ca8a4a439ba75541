#pragma once

#include <filesystem>
#include <functional>
#include <nlohmann/json.hpp>
#include <string>

#include "apps/view/api.h"

namespace stymo {

/// The API of a viewer of the tiny run's model, with one session.
class ViewClient {
public:
    /// `change` may change the options of the viewer.
    explicit ViewClient(const std::function<void(view::ViewerOptions&)>& change = {});
    view::Answer ask(const std::string& path, const nlohmann::json& body = {});
    view::Answer send(const std::string& path, const std::string& body,
                      const std::map<std::string, std::string>& query = {});
    /// The JSON of an answer that must be 200.
    nlohmann::json json(const std::string& path, const nlohmann::json& body = {});
    /// Waits for the job to end, at most half a minute.
    [[nodiscard]] nlohmann::json ended_job();

    [[nodiscard]] view::SharedState& shared() { return shared_; }
    [[nodiscard]] view::Api& api() { return api_; }
    [[nodiscard]] std::size_t sessions() const { return api_.sessions().count(); }
    /// What opening the session answered.
    [[nodiscard]] const nlohmann::json& opened() const { return opened_; }
    [[nodiscard]] std::string first_face() const { return opened_["faces"][0]["face"]; }

private:
    view::SharedState shared_;
    view::Api api_;
    nlohmann::json opened_;
};

}  // namespace stymo
