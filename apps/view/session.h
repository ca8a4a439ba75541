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

/// One page in one browser: its faces, its job, and the eye tracker of its viewer.
class Session {
public:
    Session(std::string id, Studio& studio);
    /// Cancels the job and waits for it.
    ~Session();
    Session(const Session&) = delete;
    Session& operator=(const Session&) = delete;

    [[nodiscard]] const std::string& id() const { return id_; }
    [[nodiscard]] Shelf& shelf() { return shelf_; }

    /// Starts a job. Throws ValueError while another job runs.
    void start(Job::Body body);
    void cancel();
    /// The status of the last job; nothing before the first job.
    [[nodiscard]] std::optional<JobStatus> job_status() const;
    [[nodiscard]] std::optional<Artifact> artifact() const;

    /// Finds the viewer's eyes (EyeTracker::see). Thread-safe; images of a session are processed
    /// one after the other.
    [[nodiscard]] std::optional<EyeTracker::Sight> see(const Tensor& image,
                                                       const EyeCamera& camera);

    /// Counts a request, and returns whether it is within the rate limit of a session.
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

/// The open sessions. Their number is limited. Thread-safe.
class Sessions {
public:
    Sessions(Studio& studio, std::size_t most);

    /// Opens a session with the first faces on its shelf. If there are too many sessions, one that
    /// has not been used for a while is closed; if there is none, the result is null.
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

}  // namespace stymo::view
