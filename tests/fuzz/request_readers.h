#pragma once

#include <string>

#include "core/error.h"

namespace stymo::fuzz {

/// Calls each, though the one before may have refused the bytes; then throws its refusal.
template <class First, class... Rest>
void each(const First& first, const Rest&... rest) {
    if constexpr (sizeof...(rest) == 0) {
        first();
    } else {
        try {
            first();
        } catch (const Error&) {
            each(rest...);
            throw;
        }
        each(rest...);
    }
}

/// Parses the body of a request to stymo-view in every way.
void read_request_body(const std::string& bytes);

}  // namespace stymo::fuzz
