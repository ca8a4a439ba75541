#pragma once

#include <locale>
#include <sstream>
#include <stdexcept>
#include <string>

namespace stymo {

/// Root of every error the library throws. The message is one line that says what is wrong, where,
/// and what to do.
class Error : public std::runtime_error {
public:
    using std::runtime_error::runtime_error;
};

/// Shapes, ranks or axes that do not fit together.
class ShapeError : public Error {
public:
    using Error::Error;
};

/// A tensor of another element type than the operation needs.
class TypeError : public Error {
public:
    using Error::Error;
};

/// An argument outside its domain.
class ValueError : public Error {
public:
    using Error::Error;
};

/// A missing gradient rule, a rule that broke its contract, or a gradient with respect to an
/// untracked value.
class GradientError : public Error {
public:
    using Error::Error;
};

/// A file that is missing, unreadable, malformed or cannot be written.
class FileError : public Error {
public:
    using Error::Error;
};

/// A configuration key that is unknown, of the wrong type or out of range.
class ConfigError : public Error {
public:
    using Error::Error;
};

/// A value that became infinite or not a number.
class NumericError : public Error {
public:
    using Error::Error;
};

/// Throws `ErrorType` with the concatenation of `parts`, each written with operator<<.
template <class ErrorType = Error, class... Parts>
[[noreturn]] void fail(const Parts&... parts) {
    std::ostringstream message;
    message.imbue(std::locale::classic());
    (message << ... << parts);
    throw ErrorType(message.str());
}

}  // namespace stymo
