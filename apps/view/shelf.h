#pragma once

#include <cstdint>
#include <memory>
#include <mutex>
#include <string>
#include <vector>

#include "nn/models/code_file.h"
#include "nn/models/model.h"

namespace stymo::view {

/// One face of a viewer.
struct ShelfFace {
    std::string name;
    CodeFile face;
    std::shared_ptr<const Model> model;  ///< with the weights of this face, if it is tuned
    bool tuned = false;
};

/// The faces that one viewer can show and mix. Thread-safe.
class Shelf {
public:
    /// Returns the id of the new face. Throws ValueError if there is no room.
    [[nodiscard]] std::string add(ShelfFace face);
    /// Throws ValueError for an unknown id.
    [[nodiscard]] ShelfFace find(const std::string& id) const;
    /// Replaces a face that is still changing, such as one that is being fitted. Throws ValueError
    /// for an unknown id.
    void replace(const std::string& id, ShelfFace face);
    void remove(const std::string& id);
    /// (id, face), in the order in which they came.
    [[nodiscard]] std::vector<std::pair<std::string, ShelfFace>> all() const;

private:
    mutable std::mutex mutex_;
    std::uint64_t count_ = 0;
    std::vector<std::pair<std::string, ShelfFace>> faces_;
};

/// Codes in Z as hexadecimal digits, four for each of the 306 elements (float16): short enough for
/// the address of a page.
[[nodiscard]] std::string text_of_codes(const Codes& codes);
/// The inverse. Throws ValueError for a text of another length, digits that are none, or numbers
/// that are not finite.
[[nodiscard]] Codes codes_of_text(const std::string& text);

}  // namespace stymo::view
