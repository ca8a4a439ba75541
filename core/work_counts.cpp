#include "core/work_counts.h"

#include <atomic>
#include <mutex>

namespace stymo {

namespace {

using Count = std::atomic<std::int64_t>;

/// Counts of the process since it began.
struct Counters {
    Count operations{0};
    Count gradient_rules{0};
    Count gradients{0};
    Count field_points{0};
    Count parameters{0};
    Count buffers{0};
    Count buffer_bytes{0};
    Count live_bytes{0};
    Count peak_bytes{0};
};

/// Has no destructor, because tensors may outlive every other static object.
Counters& counters() {
    static constinit Counters instance;
    return instance;
}

struct NamedCounters {
    std::mutex mutex;
    std::map<std::string, std::map<std::string, std::int64_t>> groups;
};
NamedCounters& named_counters() {
    static NamedCounters instance;
    return instance;
}

// The counts synchronise nothing, so relaxed order suffices.
void add(Count& count, std::int64_t amount) {
    count.fetch_add(amount, std::memory_order_relaxed);
}
std::int64_t value(const Count& count) {
    return count.load(std::memory_order_relaxed);
}

void raise(Count& count, std::int64_t least) {
    for (std::int64_t present = value(count);
         present < least && !count.compare_exchange_weak(present, least);) {
    }
}

WorkCounts so_far() {
    const Counters& all = counters();
    const std::lock_guard lock(named_counters().mutex);
    return {.operations = value(all.operations),
            .gradient_rules = value(all.gradient_rules),
            .gradients = value(all.gradients),
            .field_points = value(all.field_points),
            .parameters = value(all.parameters),
            .buffers = value(all.buffers),
            .buffer_bytes = value(all.buffer_bytes),
            .peak_bytes = value(all.peak_bytes),
            .named = named_counters().groups};
}

}  // namespace

WorkMeter::WorkMeter()
    : begin_(so_far()),
      peak_before_(counters().peak_bytes.exchange(value(counters().live_bytes))) {}

WorkMeter::~WorkMeter() {
    raise(counters().peak_bytes, peak_before_);
}

WorkCounts WorkMeter::counts() const {
    WorkCounts counts = so_far();
    counts.operations -= begin_.operations;
    counts.gradient_rules -= begin_.gradient_rules;
    counts.gradients -= begin_.gradients;
    counts.field_points -= begin_.field_points;
    counts.parameters -= begin_.parameters;
    counts.buffers -= begin_.buffers;
    counts.buffer_bytes -= begin_.buffer_bytes;
    for (const auto& [group, before] : begin_.named) {
        std::map<std::string, std::int64_t>& names = counts.named[group];
        for (const auto& [name, count] : before) names[name] -= count;
        std::erase_if(names, [](const auto& named) { return named.second == 0; });
    }
    return counts;
}

namespace work {

void count_operation() {
    add(counters().operations, 1);
}
void count_gradient_rule() {
    add(counters().gradient_rules, 1);
}
void count_gradients(std::int64_t tensors) {
    add(counters().gradients, tensors);
}
void count_field_points(std::int64_t points) {
    add(counters().field_points, points);
}
void count_parameter() {
    add(counters().parameters, 1);
}
void count_named(std::string_view group, std::string_view name, std::int64_t amount) {
    const std::lock_guard lock(named_counters().mutex);
    named_counters().groups[std::string(group)][std::string(name)] += amount;
}
void count_buffer(std::int64_t bytes) {
    Counters& all = counters();
    add(all.buffers, 1);
    add(all.buffer_bytes, bytes);
    raise(all.peak_bytes, all.live_bytes.fetch_add(bytes, std::memory_order_relaxed) + bytes);
}
void count_release(std::int64_t bytes) {
    add(counters().live_bytes, -bytes);
}

}  // namespace work

}  // namespace stymo
