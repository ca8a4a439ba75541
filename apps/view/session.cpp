#include "apps/view/session.h"

#include <algorithm>

#include "apps/view/access.h"
#include "core/error.h"

namespace stymo::view {

namespace {

/// Rate limit of a session: requests per second, and largest burst.
constexpr double requests_per_second = 200.0, requests_at_once = 400.0;
constexpr double openings_per_second = 1.0;

}  // namespace

bool RateLimit::allows() {
    const std::lock_guard lock(mutex_);
    const Clock::time_point now = Clock::now();
    const double passed = std::chrono::duration<double>(now - last_).count();
    last_ = now;
    allowance_ = std::min(allowance_ + passed * per_second_, at_once_);
    if (allowance_ < 1.0) return false;
    allowance_ -= 1.0;
    return true;
}

double RateLimit::idle_seconds() const {
    const std::lock_guard lock(mutex_);
    return std::chrono::duration<double>(Clock::now() - last_).count();
}

Session::Session(std::string id, SharedState& shared)
    : id_(std::move(id)),
      shared_(shared),
      faces_(shared.tuned_models()),
      requests_(requests_per_second, requests_at_once) {
    for (const ListedFace& face : shared.first_faces()) static_cast<void>(faces_.add(face));
}

Session::~Session() {
    job_.reset();
    shared_.scheduler().forget(id_);
}

void Session::start(Job::Body body) {
    const std::lock_guard lock(mutex_);
    if (job_ && job_->running()) fail<ValueError>("another job is running; cancel it first");
    job_.reset();
    job_ = std::make_unique<Job>(std::move(body));
}

void Session::cancel() {
    const std::lock_guard lock(mutex_);
    if (job_) job_->cancel();
}

std::optional<JobStatus> Session::job_status() const {
    const std::lock_guard lock(mutex_);
    if (!job_) return std::nullopt;
    return job_->status();
}

std::optional<Artifact> Session::artifact() const {
    const std::lock_guard lock(mutex_);
    if (!job_) return std::nullopt;
    return job_->artifact();
}

std::optional<EyeTracker::Sight> Session::see(const Tensor& image, const EyeCamera& camera) {
    const double seconds =
        std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count();
    const std::lock_guard lock(camera_mutex_);
    if (!eyes_) {
        const std::shared_ptr<const PhotoPreparation> tools = shared_.preparation();
        eyes_.emplace(std::shared_ptr<const FaceDetector>(tools, &tools->detector()));
    }
    return eyes_->see(image, camera, seconds);
}

std::optional<LiveFace::Sight> Session::see_face(const Tensor& image, bool anew) {
    const std::lock_guard lock(camera_mutex_);
    if (!face_ || anew) face_.emplace(*shared_.preparation(), *shared_.model());
    return face_->see(image);
}

bool Session::in_use(double idle_seconds) const {
    const std::optional<JobStatus> job = job_status();
    return (job && job->state == JobStatus::State::running) ||
           requests_.idle_seconds() < idle_seconds;
}

Sessions::Sessions(SharedState& shared, std::size_t most, double idle_seconds)
    : shared_(shared),
      most_(most),
      idle_seconds_(idle_seconds),
      openings_(openings_per_second, 2.0 * static_cast<double>(most) + 16.0) {}

std::shared_ptr<Session> Sessions::open() {
    std::shared_ptr<Session> leaving;  // ends without the lock, since its job may take a moment
    const std::lock_guard lock(mutex_);
    if (sessions_.size() >= most_) {
        auto idlest = sessions_.end();
        for (auto entry = sessions_.begin(); entry != sessions_.end(); ++entry) {
            const Session& session = *entry->second;
            if (session.in_use(idle_seconds_)) continue;
            if (idlest == sessions_.end() ||
                session.idle_seconds() > idlest->second->idle_seconds())
                idlest = entry;
        }
        if (idlest == sessions_.end()) return nullptr;
        leaving = std::move(idlest->second);
        sessions_.erase(idlest);
    }
    auto session = std::make_shared<Session>(random_token(), shared_);
    sessions_.emplace(session->id(), session);
    return session;
}

std::shared_ptr<Session> Sessions::find(const std::string& id) const {
    const std::lock_guard lock(mutex_);
    const auto found = sessions_.find(id);
    return found == sessions_.end() ? nullptr : found->second;
}

void Sessions::close(const std::string& id) {
    std::shared_ptr<Session> leaving;
    const std::lock_guard lock(mutex_);
    const auto found = sessions_.find(id);
    if (found == sessions_.end()) return;
    leaving = std::move(found->second);
    sessions_.erase(found);
}

std::size_t Sessions::count() const {
    const std::lock_guard lock(mutex_);
    return sessions_.size();
}

}  // namespace stymo::view
