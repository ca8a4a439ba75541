#pragma once

#include <atomic>
#include <cstdint>
#include <functional>
#include <mutex>
#include <optional>
#include <string>
#include <thread>

namespace stymo::view {

/// A file for download that a job has made.
struct Artifact {
    std::string bytes;
    std::string type;  ///< "video/mp4"
    std::string name;  ///< "orbit.mp4"
};

/// The progress of a job.
struct JobStatus {
    enum class State { running, done, failed, cancelled };
    State state = State::running;
    std::string phase;      ///< "fitting"
    std::int64_t done = 0;  ///< finished steps of this phase
    std::int64_t total = 0;
    double loss = 0.0;       ///< 0 if the phase has no loss
    std::string face;        ///< id of the resulting face; empty before there is one
    std::string error;       ///< reason of a failure
    std::string note;        ///< further information, such as a warning about the photo
    std::int64_t faces = 0;  ///< number of faces among which a photo's was chosen
    bool has_artifact = false;
};

/// A task of several seconds, such as a fit or a film, on its own thread with low priority. Its
/// body reports progress; after `cancel` the next report ends the body by an exception.
class Job {
public:
    using Body = std::function<void(Job&)>;
    explicit Job(Body body);
    /// Cancels the job and waits for it.
    ~Job();
    Job(const Job&) = delete;
    Job& operator=(const Job&) = delete;

    void cancel() { cancelled_ = true; }
    [[nodiscard]] bool running() const { return status().state == JobStatus::State::running; }
    [[nodiscard]] JobStatus status() const;
    [[nodiscard]] std::optional<Artifact> artifact() const;

    // For the body. If the job is cancelled, all of these except `add_note` throw the exception
    // that ends it.
    void report(const std::string& phase, std::int64_t done, std::int64_t total, double loss = 0.0);
    void set_face(const std::string& id);
    void set_faces(std::int64_t count);
    /// Adds to the note, after "; ".
    void add_note(const std::string& note);
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
