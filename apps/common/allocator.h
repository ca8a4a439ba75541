#pragma once

namespace stymo {

/// Configures the C library's allocator for a process that repeatedly frees and allocates the same
/// large buffers.
void tune_allocator();

}  // namespace stymo
