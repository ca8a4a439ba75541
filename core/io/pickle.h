#pragma once

#include <cstddef>
#include <cstdint>
#include <deque>
#include <functional>
#include <memory>
#include <string>
#include <string_view>
#include <variant>
#include <vector>

namespace stymo {

struct PickleNode;

/// None, a boolean, an integer, a float (also for integers beyond 64 bits), text or bytes, or a
/// node.
using PickleValue = std::variant<std::monostate, bool, std::int64_t, double,
                                 std::shared_ptr<const std::string>, const PickleNode*>;

/// A composite value of a pickle. Calls are only described and never made.
struct PickleNode {
    enum class Kind {
        list,
        tuple,
        set,
        dictionary,
        name,      ///< a class or function
        call,      ///< the object that a call of the named function with `arguments` would make
        reference  ///< a reference to something outside the pickle, identified by its only item
    };
    Kind kind = Kind::list;
    std::string name{};  ///< full name of a class or function, or of the called one:
                         ///< "collections.OrderedDict"
    const PickleNode* arguments = nullptr;  ///< arguments of a call: a tuple
    /// Elements. A dictionary, and an object of a call into which items are put, have key, value,
    /// key, value...
    std::vector<PickleValue> items{};
};

/// The contents of a pickle as plain data. Nodes may occur several times and may contain
/// themselves.
class Pickle {
public:
    /// Reads the pickle at the beginning of `bytes`, protocols 2 to 5. Nothing is executed: a class
    /// or function is represented by its name, and only the full names that `allowed` accepts may
    /// occur. Throws FileError, one line that begins with `source`, for any other name and for
    /// truncated or malformed input.
    Pickle(std::string_view bytes, const std::string& source,
           const std::function<bool(const std::string& name)>& allowed);
    Pickle(const Pickle&) = delete;  // its nodes point at each other
    Pickle& operator=(const Pickle&) = delete;
    Pickle(Pickle&&) noexcept = default;
    Pickle& operator=(Pickle&&) noexcept = default;
    ~Pickle() = default;

    [[nodiscard]] const PickleValue& root() const { return root_; }
    [[nodiscard]] const std::deque<PickleNode>& nodes() const { return nodes_; }
    /// Length of the pickle in bytes.
    [[nodiscard]] std::size_t length() const { return length_; }

private:
    class Reader;

    std::deque<PickleNode> nodes_;
    PickleValue root_;
    std::size_t length_ = 0;
};

}  // namespace stymo
