#include "apps/view/job.h"

#include <sys/resource.h>
#include <unistd.h>

#include <exception>
#include <utility>

namespace stymo::view {

namespace {

/// Frames go first: threads that a job's thread starts have its priority.
constexpr int niceness = 5;

}  // namespace

Job::Job(Body body) : thread_([this, work = std::move(body)] { run(work); }) {}

Job::~Job() {
    cancel();
    thread_.join();
}

JobStatus Job::status() const {
    const std::lock_guard lock(mutex_);
    return status_;
}

std::optional<Artifact> Job::artifact() const {
    const std::lock_guard lock(mutex_);
    return artifact_;
}

void Job::require_wanted() const {
    if (cancelled_) throw Cancelled{};
}

void Job::report(const std::string& phase, std::int64_t done, std::int64_t total, double loss) {
    require_wanted();
    const std::lock_guard lock(mutex_);
    status_.phase = phase;
    status_.done = done;
    status_.total = total;
    status_.loss = loss;
}

void Job::set_face(const std::string& id) {
    require_wanted();
    const std::lock_guard lock(mutex_);
    status_.face = id;
}

void Job::set_faces(std::int64_t count) {
    require_wanted();
    const std::lock_guard lock(mutex_);
    status_.faces = count;
}

void Job::add_note(const std::string& note) {
    const std::lock_guard lock(mutex_);
    status_.note += (status_.note.empty() ? "" : "; ") + note;
}

void Job::set_artifact(Artifact artifact) {
    require_wanted();
    const std::lock_guard lock(mutex_);
    artifact_ = std::move(artifact);
    status_.has_artifact = true;
}

void Job::run(const Body& body) {
    setpriority(PRIO_PROCESS, static_cast<id_t>(gettid()), niceness);
    auto state = JobStatus::State::done;
    std::string error;
    try {
        body(*this);
    } catch (const Cancelled&) {
        state = JobStatus::State::cancelled;
    } catch (const std::exception& failure) {
        state = JobStatus::State::failed;
        error = failure.what();
    } catch (...) {
        state = JobStatus::State::failed;
        error = "an unknown error";
    }
    const std::lock_guard lock(mutex_);
    status_.state = state;
    status_.error = error;
}

}  // namespace stymo::view
