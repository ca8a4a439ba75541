#include "train/data/json_values.h"

#include <algorithm>
#include <cmath>

#include "core/error.h"

namespace stymo {

void require_keys(const nlohmann::json& object, const char* what,
                  std::initializer_list<std::string_view> known) {
    if (!object.is_object()) fail<FileError>(what, " must be an object");
    for (const auto& member : object.items())
        if (std::find(known.begin(), known.end(), member.key()) == known.end())
            fail<FileError>("unknown key \"", member.key(), "\" in ", what);
}

double finite_number(const nlohmann::json& value, const char* what) {
    const auto number = value.get<double>();
    if (!std::isfinite(static_cast<float>(number)))
        fail<FileError>("\"", what, "\" holds ", number, ", which is too large");
    return number;
}

std::string plain_message(const nlohmann::json::exception& error) {
    const std::string message = error.what();
    const std::size_t end = message.find("] ");
    return end == std::string::npos ? message : message.substr(end + 2);
}

}  // namespace stymo
