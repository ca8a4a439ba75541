#pragma once

#include <string>

#include "core/error.h"

namespace stymo::test {

/// What the `ErrorType` that `body` throws says, or an empty string if it throws none.
template <class ErrorType = Error, class Body>
[[nodiscard]] std::string error_message(Body body) {
    try {
        body();
    } catch (const ErrorType& error) {
        return error.what();
    }
    return {};
}

[[nodiscard]] inline bool is_one_line(const std::string& text) {
    return !text.empty() && text.find('\n') == std::string::npos;
}

}  // namespace stymo::test
