// Tasks on several threads, with help from threads that have no task.
//
// A training step has a few micro-batches, tuning two losses, and a processor may have more cores
// than that. Dividing each op among all cores instead scales badly, because the ops of one image
// are short. So tasks run side by side, and a thread without a task looks for loops inside the
// tasks of others. Each thread has one slot in which it offers its present loop; helpers take
// chunks of it from a common counter. Chunks do not depend on who runs them, so neither do the
// results.
//
// The owner of a loop always works on it itself, and waits only for chunks that helpers have begun.
// A helper never waits for a loop. So nothing can block, whatever the number of threads.

#include "core/task_team.h"

#include <thread>

namespace stymo {

namespace {

struct Membership {
    TaskTeam* team = nullptr;
    int thread = 0;
    bool offers = false;  ///< the thread's slot is in use, or the thread helps
};
thread_local Membership member;

}  // namespace

void FirstError::keep_current() {
    const std::lock_guard lock(mutex_);
    if (!error_) error_ = std::current_exception();
}

void FirstError::rethrow() const {
    if (error_) std::rethrow_exception(error_);
}

TaskTeam* TaskTeam::of_this_thread() {
    return member.team;
}

void TaskTeam::InnerLoop::take_chunks(int thread) {
    for (std::int64_t chunk = next.fetch_add(1, std::memory_order_relaxed); chunk < chunks;
         chunk = next.fetch_add(1, std::memory_order_relaxed)) {
        try {
            (*body)(chunk, thread);
        } catch (...) {
            error.keep_current();
        }
    }
}

void TaskTeam::run(int thread, const std::function<bool()>& task,
                   const std::function<bool()>& may_help) {
    member = {this, thread, false};
    while (task()) {
    }
    member.offers = true;
    if (busy_.fetch_sub(1) == 1) announce_change();
    constexpr int tries_before_sleep = 200;
    for (int tries = 0; busy_ > 0 && may_help();) {
        const std::uint32_t seen = changes_;
        if (help_once(thread)) {
            tries = 0;
        } else if (++tries > tries_before_sleep) {
            ++waiting_;
            if (busy_ > 0) changes_.wait(seen);
            --waiting_;
        }
    }
    member = {};
}

bool TaskTeam::help_once(int thread) {
    bool helped = false;
    for (Slot& slot : slots_) {
        InnerLoop* loop = nullptr;
        {
            const std::lock_guard lock(slot.mutex);
            if (slot.loop == nullptr || slot.loop->next >= slot.loop->chunks) continue;
            loop = slot.loop;
            ++slot.helpers;
        }
        loop->take_chunks(thread);
        slot.helpers.fetch_sub(1);
        helped = true;
    }
    return helped;
}

void TaskTeam::announce_change() {
    ++changes_;
    if (waiting_ > 0) changes_.notify_all();
}

void TaskTeam::inner_loop(std::int64_t chunks, const std::function<void(std::int64_t, int)>& body) {
    if (member.offers) {
        for (std::int64_t chunk = 0; chunk < chunks; ++chunk) body(chunk, member.thread);
        return;
    }
    InnerLoop loop{.chunks = chunks, .body = &body, .next = 0, .error = {}};
    Slot& slot = slots_[static_cast<std::size_t>(member.thread)];
    {
        const std::lock_guard lock(slot.mutex);
        slot.loop = &loop;
    }
    member.offers = true;
    announce_change();
    loop.take_chunks(member.thread);
    {
        const std::lock_guard lock(slot.mutex);
        slot.loop = nullptr;
    }
    while (slot.helpers > 0) std::this_thread::yield();
    member.offers = false;
    loop.error.rethrow();
}

}  // namespace stymo
