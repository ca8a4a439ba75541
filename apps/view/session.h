#pragma once

#include <chrono>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <string>

#include "apps/view/eye_tracker.h"
#include "apps/view/face_list.h"
#include "apps/view/job.h"
#include "apps/view/shared_state.h"
#include "fit/video/live_face.h"

namespace stymo::view {

/// Limits how often something happens. Thread-safe.
class RateLimit {
public:
    RateLimit(double per_second, double at_once)
        : per_second_(per_second), at_once_(at_once), allowance_(at_once) {}
    /// Counts an event, and returns whether it is within the limit.
    [[nodiscard]] bool allows();
    /// Since the last event, or since the beginning.
    [[nodiscard]] double idle_seconds() const;

private:
    using Clock = std::chrono::steady_clock;

    double per_second_;
    double at_once_;
    mutable std::mutex mutex_;
    Clock::time_point last_ = Clock::now();
    double allowance_;
};

/// One page in one browser: its faces, its job, and what follows its viewer.
class Session {
public:
    Session(std::string id, SharedState& shared);
    /// Cancels the job and waits for it.
    ~Session();
    Session(const Session&) = delete;
    Session& operator=(const Session&) = delete;

    [[nodiscard]] const std::string& id() const { return id_; }
    [[nodiscard]] FaceList& faces() { return faces_; }

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
    /// The viewer's face (LiveFace::see), which is at rest at first; `anew`: from this image on.
    /// Thread-safe like `see`.
    [[nodiscard]] std::optional<LiveFace::Sight> see_face(const Tensor& image, bool anew);

    /// Counts a request, and returns whether it is within the rate limit of a session.
    [[nodiscard]] bool allows_request() { return requests_.allows(); }
    /// Whether its job runs, or it had a request within the last `idle_seconds`. The page makes one
    /// every 20 s while it is open.
    [[nodiscard]] bool in_use(double idle_seconds) const;
    [[nodiscard]] double idle_seconds() const { return requests_.idle_seconds(); }

private:
    std::string id_;
    SharedState& shared_;
    FaceList faces_;
    mutable std::mutex mutex_;
    std::unique_ptr<Job> job_;
    std::mutex camera_mutex_;
    std::optional<EyeTracker> eyes_;
    std::optional<LiveFace> face_;
    RateLimit requests_;
};

/// The open sessions. Their number is limited. Thread-safe.
class Sessions {
public:
    /// A session without requests for `idle_seconds` may be closed for a new one.
    Sessions(SharedState& shared, std::size_t most, double idle_seconds = 180.0);

    /// Counts a request to open a session, and returns whether it is within the rate limit: one
    /// a second on average, and at once 16 more than twice as many as there may be sessions.
    [[nodiscard]] bool allows_opening() { return openings_.allows(); }
    /// Opens a session with the first faces in its list. If there are too many sessions, the one
    /// that has been idle for longest is closed. The result is null if all of them are in use.
    [[nodiscard]] std::shared_ptr<Session> open();
    /// Null for an unknown id.
    [[nodiscard]] std::shared_ptr<Session> find(const std::string& id) const;
    void close(const std::string& id);
    [[nodiscard]] std::size_t count() const;

private:
    SharedState& shared_;
    std::size_t most_;
    double idle_seconds_;
    RateLimit openings_;
    mutable std::mutex mutex_;
    std::map<std::string, std::shared_ptr<Session>> sessions_;
};

}  // namespace stymo::view
