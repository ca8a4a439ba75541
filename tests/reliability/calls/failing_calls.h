#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <string>

namespace stymo {

/// Calls of the C library that can be made to fail. `create` is what a read-only file system
/// refuses.
enum class CallKind { none, open, read, write, flush, rename, create, allocate };

/// Decides which calls fail. It must not allocate, and calls that it makes do not count.
class CallVisitor {
public:
    virtual ~CallVisitor() = default;
    /// `number` counts from 1 on.
    [[nodiscard]] virtual bool fails(long number) = 0;
};

/// Which calls of this process a visitor is asked about. Calls on files are those whose absolute
/// path, without symbolic links, begins with `place`.
struct WatchedCalls {
    CallKind kind = CallKind::none;
    int error = 0;  ///< errno of those that fail
    std::string place;
};

/// Begins to count calls. Both arguments must outlive the watching.
void watch_calls(const WatchedCalls& calls, CallVisitor& visitor);
void stop_watching_calls();

/// The innermost return addresses of a call, from the caller of the C library's function on.
struct CallStack {
    static constexpr std::size_t depth = 4;
    std::array<void*, depth> frames{};
    std::size_t count = 0;
    [[nodiscard]] std::uint64_t hash() const;  ///< never 0
};
/// To be called by `CallVisitor::fails` itself.
[[nodiscard]] CallStack current_call_stack();

/// Fails one call, or all from one on.
class FailingNumber : public CallVisitor {
public:
    explicit FailingNumber(long at, bool ever = false) : at_(at), ever_(ever) {}
    [[nodiscard]] bool fails(long number) override {
        return number == at_ || (ever_ && number > at_);
    }

private:
    long at_;
    bool ever_;
};

}  // namespace stymo
