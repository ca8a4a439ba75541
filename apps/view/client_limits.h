#pragma once

#include <cstddef>

namespace stymo::view {

/// Limits on what one client can take from the others.
struct ClientLimits {
    std::size_t connections = 128;  ///< served at once; further ones wait
    double read_seconds = 10.0;     ///< largest time between two bytes
    double head_seconds = 10.0;     ///< largest time for the head of a request, from its first byte
    /// Largest time for the body of a request, and again for its answer. A body or an answer gets
    /// one second more for each 64 KiB.
    double body_seconds = 30.0;
};

}  // namespace stymo::view
