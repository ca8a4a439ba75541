#pragma once

#include <chrono>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <string>

#include "apps/view/eye_tracker.h"
#include "apps/view/job.h"
#include "apps/view/shelf.h"
#include "apps/view/studio.h"

namespace stymo::view {

/// One page in one browser: its faces, its job, and the eyes of the one who looks at it.
class Session {
public:
    Session(std::string id, Studio& studio);
    /// Cancels the job and waits for it.
    ~Session();
    Session(const Session&) = delete;
    Session& operator=(const Session&) = delete;

    [[nodiscard]] const std::string& id() const { return id_; }
    [[nodiscard]] Shelf& shelf() { return shelf_; }

    /// Throws ValueError while another job runs.
    void start(Job::Body body);
    void cancel();
    /// Of the last job; nothing before the first.
    [[nodiscard]] std::optional<JobStatus> job_status() const;
    [[nodiscard]] std::optional<Artifact> artifact() const;

    /// Thread-safe; images of one session are looked at one after the other.
    [[nodiscard]] std::optional<EyeTracker::Sight> see(const Tensor& image,
                                                       const EyeCamera& camera);

    /// Whether this request is within the rate that a session is allowed.
    [[nodiscard]] bool allows_request();
    [[nodiscard]] double idle_seconds() const;

private:
    using Clock = std::chrono::steady_clock;

    std::string id_;
    Studio& studio_;
    Shelf shelf_;
    mutable std::mutex mutex_;
    std::unique_ptr<Job> job_;
    std::mutex eye_mutex_;
    std::optional<EyeTracker> eyes_;
    mutable std::mutex rate_mutex_;
    Clock::time_point last_used_ = Clock::now();
    double allowance_;
};

/// The open sessions, of which there is a limited number. Thread-safe.
class Sessions {
public:
    Sessions(Studio& studio, std::size_t most);

    /// A new session with the first faces on its shelf; null if there are too many. One that has
    /// not been used for a while makes room.
    [[nodiscard]] std::shared_ptr<Session> open();
    /// Null for an unknown id.
    [[nodiscard]] std::shared_ptr<Session> find(const std::string& id) const;
    void close(const std::string& id);
    [[nodiscard]] std::size_t count() const;

private:
    Studio& studio_;
    std::size_t most_;
    mutable std::mutex mutex_;
    std::map<std::string, std::shared_ptr<Session>> sessions_;
};

/// 128 random bits of the system as hexadecimal digits.
[[nodiscard]] std::string random_token();

}  // namespace stymo::view
