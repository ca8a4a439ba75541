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
/// A session has at most one frame that waits: a newer request takes its place. A request for a
/// moving frame stops a still frame that is being rendered, of whichever session; that of another
/// session is rendered again afterwards, and then to its end. Moving frames go before others
/// unless these have waited for long, and sessions take turns.
class Scheduler {
public:
    explicit Scheduler(const FrameSettings& settings);
    /// Answers what waits with nothing.
    ~Scheduler();
    Scheduler(const Scheduler&) = delete;
    Scheduler& operator=(const Scheduler&) = delete;

    /// Waits for the frame; nothing if a newer request of the session took its place. Throws what
    /// rendering throws. Thread-safe.
    [[nodiscard]] std::optional<Frame> render(const std::string& session, FrameRequest request);
    /// Lets go of what is kept for a session.
    void forget(const std::string& session);

private:
    struct Waiting {
        FrameRequest request;
        std::promise<std::optional<Frame>> answer;
        std::uint64_t order = 0;
        double since = 0.0;        ///< seconds, as seconds_now()
        bool was_stopped = false;  ///< for another session; once is enough
    };
    /// A session, and which of its pictures: thumbnails and snapshots have places of their own, so
    /// that they do not take that of the picture on the page.
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
    bool running_may_stop_ = false;  ///< for another session
    bool running_is_still_ = false;
    std::stop_source stop_running_;
    std::vector<std::string> forgotten_;
    bool ends_ = false;
    struct KeptRenderer {
        FrameRenderer renderer;
        std::uint64_t used = 0;
    };
    std::map<std::string, KeptRenderer> renderers_;  ///< of the thread alone
    std::uint64_t uses_ = 0;                         ///< likewise
    std::thread thread_;
};

}  // namespace stymo::view
