#include "apps/view/scheduler.h"

#include <algorithm>

#include "core/clock.h"

namespace stymo::view {

namespace {

/// Number of sessions whose renderers are kept. Other sessions get a new renderer with their next
/// frame.
constexpr std::size_t most_renderers = 8;
/// Requests that have waited longer than this go before moving frames.
constexpr double patience_seconds = 0.5;

}  // namespace

Scheduler::Scheduler(const FrameSettings& settings)
    : settings_(settings), thread_([this] { run(); }) {}

Scheduler::~Scheduler() {
    {
        const std::lock_guard lock(mutex_);
        ends_ = true;
        stop_running_.request_stop();
    }
    work_.notify_all();
    thread_.join();
    for (auto& [key, waiting] : waiting_) waiting.answer.set_value(std::nullopt);
}

std::optional<Frame> Scheduler::render(const std::string& session, FrameRequest request) {
    std::future<std::optional<Frame>> answer;
    {
        const std::lock_guard lock(mutex_);
        if (ends_) return std::nullopt;
        const Quality quality = request.quality;
        const int kind = quality == Quality::thumbnail ? 1 : quality == Quality::snapshot ? 2 : 0;
        const Key key{session, kind};
        Waiting waiting{std::move(request), {}, order_++, seconds_now()};
        answer = waiting.answer.get_future();
        if (const auto old = waiting_.find(key); old != waiting_.end()) {
            old->second.answer.set_value(std::nullopt);
            old->second = std::move(waiting);
        } else {
            waiting_.emplace(key, std::move(waiting));
        }
        const bool newer = running_ == key;
        if (running_is_still_ && (newer || (running_may_stop_ && quality == Quality::moving)))
            stop_running_.request_stop();
    }
    work_.notify_one();
    return answer.get();
}

void Scheduler::forget(const std::string& session) {
    {
        const std::lock_guard lock(mutex_);
        forgotten_.push_back(session);
    }
    work_.notify_one();
}

/// Moving frames and requests that have waited for long come first; among equals, the one that
/// waits longest.
std::map<Scheduler::Key, Scheduler::Waiting>::iterator Scheduler::next() {
    const double now = seconds_now();
    const auto urgency = [&](const Waiting& waiting) {
        const bool urgent =
            waiting.request.quality == Quality::moving || now - waiting.since > patience_seconds;
        return std::pair(urgent ? 0 : 1, waiting.order);
    };
    return std::ranges::min_element(waiting_, {},
                                    [&](const auto& entry) { return urgency(entry.second); });
}

void Scheduler::run() {
    std::unique_lock lock(mutex_);
    while (true) {
        work_.wait(lock, [this] { return ends_ || !waiting_.empty() || !forgotten_.empty(); });
        if (ends_) return;
        for (const std::string& session : std::exchange(forgotten_, {})) renderers_.erase(session);
        if (waiting_.empty()) continue;
        const auto chosen = next();
        const Key key = chosen->first;
        Waiting waiting = std::move(chosen->second);
        waiting_.erase(chosen);
        running_ = key;
        running_is_still_ = waiting.request.quality == Quality::still;
        running_may_stop_ = !waiting.was_stopped;
        stop_running_ = {};
        finish(std::move(waiting), key, lock);
        running_.reset();
        running_is_still_ = false;
    }
}

void Scheduler::finish(Waiting waiting, const Key& key, std::unique_lock<std::mutex>& lock) {
    const std::stop_token stop = stop_running_.get_token();
    lock.unlock();
    std::optional<Frame> frame;
    std::exception_ptr error;
    try {
        frame = renderer_of(key.first).render(waiting.request, stop);
    } catch (...) {
        error = std::current_exception();
    }
    lock.lock();
    if (error) {
        waiting.answer.set_exception(error);
    } else if (!frame && !ends_ && !waiting_.contains(key)) {
        waiting.was_stopped = true;
        waiting_.emplace(key, std::move(waiting));
    } else {
        waiting.answer.set_value(std::move(frame));
    }
}

FrameRenderer& Scheduler::renderer_of(const std::string& session) {
    auto found = renderers_.find(session);
    if (found == renderers_.end()) {
        if (renderers_.size() >= most_renderers) {
            renderers_.erase(std::ranges::min_element(
                renderers_, {}, [](const auto& entry) { return entry.second.used; }));
        }
        found = renderers_.emplace(session, KeptRenderer{FrameRenderer(settings_)}).first;
    }
    found->second.used = ++uses_;
    return found->second.renderer;
}

}  // namespace stymo::view
