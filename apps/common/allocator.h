#pragma once

namespace stymo {

/// Sets the C library's allocator up for a process that frees and asks again for the same large buffers all the time.
void tune_allocator();

}  // namespace stymo
