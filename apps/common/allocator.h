#pragma once

namespace stymo {

/// Configures the C library's allocator for a process that frees and allocates the same large
/// buffers all the time.
void tune_allocator();

}  // namespace stymo
