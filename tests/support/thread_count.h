#pragma once

#include "core/parallel.h"

namespace stymo::test {

/// Puts the number of threads back when a test ends, however it ends.
class ThreadCount {
public:
    ThreadCount() = default;
    ThreadCount(const ThreadCount&) = delete;
    ThreadCount& operator=(const ThreadCount&) = delete;
    ~ThreadCount() { set_thread_count(before_); }

private:
    int before_ = thread_count();
};

}  // namespace stymo::test
