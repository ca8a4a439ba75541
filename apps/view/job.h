#pragma once

#include <atomic>
#include <cstdint>
#include <functional>
#include <mutex>
#include <optional>
#include <string>
#include <thread>

namespace stymo::view {

/// A file that a job has made for download.
struct Artifact {
    std::string bytes;
    std::string type;  ///< "video/mp4"
    std::string name;  ///< "orbit.mp4"
};

/// How far a job has come.
struct JobStatus {
    enum class State { running, done, failed, cancelled };
    State state = State::running;
    std::string phase;      ///< "fitting"
    std::int64_t done = 0;  ///< steps of this phase
    std::int64_t total = 0;
    double loss = 0.0;  ///< where there is one
    std::string face;   ///< id of the face that it makes, once there is one
    std::string error;  ///< why it failed
    std::string note;   ///< what else there is to say, such as a warning of the photo
    bool has_artifact = false;
};

/// Something that takes seconds, on a thread of its own at low priority: a fit, a film. Its body
/// reports to it and is ended at the next report when it is cancelled.
class Job {
public:
    using Body = std::function<void(Job&)>;
    explicit Job(Body body);
    /// Cancels and waits.
    ~Job();
    Job(const Job&) = delete;
    Job& operator=(const Job&) = delete;

    void cancel() { cancelled_ = true; }
    [[nodiscard]] bool running() const { return status().state == JobStatus::State::running; }
    [[nodiscard]] JobStatus status() const;
    [[nodiscard]] std::optional<Artifact> artifact() const;

    // For the body. All but `set_note` throw what ends it if the job is cancelled.
    void report(const std::string& phase, std::int64_t done, std::int64_t total, double loss = 0.0);
    void set_face(const std::string& id);
    void set_note(const std::string& note);
    void set_artifact(Artifact artifact);

private:
    class Cancelled {};

    void run(const Body& body);
    void require_wanted() const;

    mutable std::mutex mutex_;
    JobStatus status_;
    std::optional<Artifact> artifact_;
    std::atomic<bool> cancelled_{false};
    std::thread thread_;
};

}  // namespace stymo::view
