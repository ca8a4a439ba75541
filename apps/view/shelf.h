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
    /// The tuned model if the face is tuned, else the common one.
    std::shared_ptr<const Model> model;
    bool tuned = false;
};

/// The faces that one viewer can show and mix. Thread-safe.
class Shelf {
public:
    /// Adds a face and returns its id. Throws ValueError if the shelf is full.
    [[nodiscard]] std::string add(ShelfFace face);
    /// Throws ValueError for an unknown id.
    [[nodiscard]] ShelfFace find(const std::string& id) const;
    /// Replaces a face, for example during its fit. Throws ValueError for an unknown id.
    void replace(const std::string& id, ShelfFace face);
    void remove(const std::string& id);
    /// All pairs (id, face) in the order in which they were added.
    [[nodiscard]] std::vector<std::pair<std::string, ShelfFace>> all() const;

private:
    mutable std::mutex mutex_;
    std::uint64_t count_ = 0;
    std::vector<std::pair<std::string, ShelfFace>> faces_;
};

/// Codes in Z as hexadecimal digits, four for each of the 306 elements (float16): short enough for
/// the address of a page.
[[nodiscard]] std::string text_of_codes(const Codes& codes);
/// The inverse. Throws ValueError for a text of another length, characters that are not hexadecimal
/// digits, or numbers that are not finite.
[[nodiscard]] Codes codes_of_text(const std::string& text);

}  // namespace stymo::view
