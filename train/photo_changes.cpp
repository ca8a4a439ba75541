#include "train/photo_changes.h"

#include <algorithm>
#include <cstdint>
#include <map>
#include <optional>
#include <sstream>
#include <string_view>

#include "train/photo_offsets.h"

namespace stymo {

namespace {

constexpr const char* photos_key = "photos";

std::vector<std::string> lines_of(const std::string& text) {
    std::vector<std::string> lines;
    std::istringstream stream(text);
    for (std::string line; std::getline(stream, line);) lines.push_back(line);
    return lines;
}

/// An id in ASCII and on one line, because metadata is UTF-8 and file names need not be.
std::string escaped(const std::string& id) {
    constexpr std::string_view digits = "0123456789ABCDEF";
    std::string text;
    for (const char letter : id) {
        const auto byte = static_cast<unsigned char>(letter);
        if (byte < ' ' || byte > '~' || letter == '%') {
            text += '%';
            text += digits[byte / digits.size()];
            text += digits[byte % digits.size()];
        } else {
            text += letter;
        }
    }
    return text;
}

using Rows = std::map<std::string, std::int64_t>;

Rows rows_of(const std::vector<std::string>& ids) {
    Rows rows;
    for (const std::string& id : ids) rows.emplace(id, std::ssize(rows));
    return rows;
}

/// The ids that `others` does not have.
std::vector<std::string> missing_in(const Rows& others, const std::vector<std::string>& ids) {
    std::vector<std::string> missing;
    std::ranges::copy_if(ids, std::back_inserter(missing),
                         [&](const std::string& id) { return !others.contains(id); });
    return missing;
}

/// "3 photos (a, b, ...)".
std::string counted(const std::vector<std::string>& ids) {
    constexpr std::size_t named = 3;
    std::ostringstream text;
    text << ids.size() << (ids.size() == 1 ? " photo" : " photos");
    for (std::size_t i = 0; i < std::min(named, ids.size()); ++i)
        text << (i == 0 ? " (" : ", ") << ids[i];
    if (ids.size() > named) text << ", ...";
    if (!ids.empty()) text << ')';
    return text.str();
}

/// The rows of `tensor` in their new places; codes of mirror images are a second block of rows.
Tensor moved_rows(const Tensor& tensor, const Rows& before, const Rows& after) {
    const auto old_count = std::ssize(before), count = std::ssize(after);
    const std::int64_t blocks = tensor.shape(0) / old_count, columns = tensor.shape(1);
    Tensor result = Tensor::zeros({blocks * count, columns}, tensor.dtype());
    dispatch(tensor.dtype(), [&]<class T>(T) {
        const auto from = tensor.values<T>().begin();
        const auto to = result.mutable_values<T>().begin();
        for (const auto& [id, row] : after) {
            const auto old = before.find(id);
            for (std::int64_t block = 0; old != before.end() && block < blocks; ++block)
                std::copy_n(from + (block * old_count + old->second) * columns, columns,
                            to + (block * count + row) * columns);
        }
    });
    return result;
}

bool is_of_photos(const std::string& name) {
    return name.find(PhotoOffsets::code_prefix) != std::string::npos ||
           name.find(std::string(PhotoOffsets::pose_prefix) + "offset") != std::string::npos;
}

}  // namespace

void store_photo_ids(TensorFile& state, const std::vector<std::string>& ids) {
    std::string text;
    for (const std::string& id : ids) text += escaped(id) + '\n';
    state.metadata[photos_key] = text;
}

std::string follow_photos(TensorFile& state, const std::vector<std::string>& photo_ids) {
    const bool learnt = std::ranges::any_of(
        state.tensors, [](const auto& entry) { return is_of_photos(entry.first); });
    const auto stored = state.metadata.find(photos_key);
    if (stored == state.metadata.end())
        return learnt ? "the checkpoint does not name its photos; their learnt offsets are taken "
                        "in the order of the ids"
                      : "";
    const std::vector<std::string> earlier = lines_of(stored->second);
    std::vector<std::string> ids;
    for (const std::string& id : photo_ids) ids.push_back(escaped(id));
    const Rows before = rows_of(earlier), after = rows_of(ids);
    const std::vector<std::string> gone = missing_in(after, earlier),
                                   added = missing_in(before, ids);
    if (earlier == ids) return {};
    for (auto& [name, tensor] : state.tensors)
        if (is_of_photos(name) && tensor.rank() == 2 && tensor.shape(0) % std::ssize(before) == 0)
            tensor = moved_rows(tensor, before, after);
    std::ostringstream line;
    line << "the folder has changed since the checkpoint: " << counted(gone) << " gone, "
         << counted(added) << " new";
    if (learnt)
        line << "; learnt offsets: " << gone.size() << " dropped, " << added.size() << " from zero";
    return line.str();
}

}  // namespace stymo
