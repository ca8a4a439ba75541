#pragma once

#include <condition_variable>
#include <cstdint>
#include <future>
#include <map>
#include <mutex>
#include <optional>
#include <string>
#include <thread>

#include "apps/view/frame.h"

namespace stymo::view {

/// Renders the frames of all sessions, one after the other, each with all threads.
///
/// A session has at most one waiting frame: a newer request replaces it. A request for a moving
/// frame stops a still frame of any session that is being rendered. If the still frame belongs to
/// another session, it is rendered again later, and then not stopped. Moving frames have priority
/// over others, unless these have waited for long. Sessions take turns.
class Scheduler {
public:
    explicit Scheduler(const FrameSettings& settings);
    /// Waiting requests return nothing.
    ~Scheduler();
    Scheduler(const Scheduler&) = delete;
    Scheduler& operator=(const Scheduler&) = delete;

    /// Waits for the frame; returns nothing if a newer request of the session replaced it. Throws
    /// what rendering throws. Thread-safe.
    [[nodiscard]] std::optional<Frame> render(const std::string& session, FrameRequest request);
    /// Releases the renderers of a session.
    void forget(const std::string& session);

private:
    struct Waiting {
        FrameRequest request;
        std::promise<std::optional<Frame>> answer;
        std::uint64_t order = 0;
        double since = 0.0;        ///< time of the request by seconds_now()
        bool was_stopped = false;  ///< stopped for another session; it is stopped only once
    };
    /// A session and the kind of picture. Thumbnails and snapshots are kept apart, so that
    /// they do not replace the picture on the page.
    using Key = std::pair<std::string, int>;

    void run();
    [[nodiscard]] std::map<Key, Waiting>::iterator next();
    void finish(Waiting waiting, const Key& key, std::unique_lock<std::mutex>& lock);
    [[nodiscard]] FrameRenderer& renderer_of(const std::string& session);

    FrameSettings settings_;
    std::mutex mutex_;
    std::condition_variable work_;
    std::map<Key, Waiting> waiting_;
    std::uint64_t order_ = 0;
    std::optional<Key> running_;
    bool running_may_stop_ = false;  ///< whether it may be stopped for another session
    bool running_is_still_ = false;
    std::stop_source stop_running_;
    std::vector<std::string> forgotten_;
    bool ends_ = false;
    struct KeptRenderer {
        FrameRenderer renderer;
        std::uint64_t used = 0;
    };
    std::map<std::string, KeptRenderer> renderers_;  ///< used only by the thread
    std::uint64_t uses_ = 0;                         ///< likewise
    std::thread thread_;
};

}  // namespace stymo::view
