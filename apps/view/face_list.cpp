#include "apps/view/face_list.h"

#include <Eigen/Core>
#include <algorithm>
#include <charconv>
#include <cmath>
#include <set>

#include "core/error.h"

namespace stymo::view {

namespace {

constexpr std::size_t most_tuned_models = 16;
constexpr std::size_t digits_of_element = 4;

/// The beginning of a name in UTF-8, without half a character at its end.
std::string shortened(std::string name) {
    constexpr std::size_t most_bytes = 80;
    if (name.size() <= most_bytes) return name;
    const auto continues = [&](std::size_t index) {
        return (static_cast<unsigned char>(name[index]) & 0xC0U) == 0x80U;
    };
    std::size_t end = most_bytes;
    while (end > 0 && continues(end)) --end;
    name.resize(end);
    return name;
}

}  // namespace

void TunedModels::require_room_locked() {
    std::erase_if(models_, [](const auto& model) { return model.expired(); });
    if (models_.size() >= most_)
        fail<ValueError>("all open pages have room for ", most_,
                         " faces with tuned weights; remove one first");
}

void TunedModels::require_room() {
    const std::lock_guard lock(mutex_);
    require_room_locked();
}

void TunedModels::count(const std::shared_ptr<const Model>& model) {
    const std::lock_guard lock(mutex_);
    if (std::ranges::any_of(models_, [&](const auto& known) { return known.lock() == model; }))
        return;
    require_room_locked();
    models_.emplace_back(model);
}

void FaceList::count_model(const ListedFace& face, const std::string& except) const {
    if (!face.tuned) return;
    std::set<const Model*> models{face.model.get()};
    for (const auto& [id, other] : faces_) {
        if (other.tuned && id != except) models.insert(other.model.get());
    }
    if (models.size() > most_tuned_models)
        fail<ValueError>("there is room for ", most_tuned_models,
                         " faces with tuned weights; remove one first");
    if (face.model) all_.count(face.model);
}

void FaceList::require_room_for_tuned() const {
    const std::lock_guard lock(mutex_);
    count_model({.name = {}, .face = {}, .model = nullptr, .tuned = true});
    all_.require_room();
}

std::string FaceList::add(ListedFace face) {
    face.name = shortened(std::move(face.name));
    const std::lock_guard lock(mutex_);
    if (faces_.size() >= most_faces)
        fail<ValueError>("there is room for ", most_faces, " faces; remove one first");
    count_model(face);
    const std::string id = "f" + std::to_string(++count_);
    faces_.emplace_back(id, std::move(face));
    return id;
}

ListedFace FaceList::find(const std::string& id) const {
    const std::lock_guard lock(mutex_);
    const auto found = std::ranges::find(faces_, id, &std::pair<std::string, ListedFace>::first);
    if (found == faces_.end()) fail<ValueError>("there is no face ", id);
    return found->second;
}

bool FaceList::replace(const std::string& id, ListedFace face) {
    const std::lock_guard lock(mutex_);
    const auto found = std::ranges::find(faces_, id, &std::pair<std::string, ListedFace>::first);
    if (found == faces_.end()) return false;
    count_model(face, id);
    found->second = std::move(face);
    return true;
}

void FaceList::remove(const std::string& id) {
    const std::lock_guard lock(mutex_);
    std::erase_if(faces_, [&](const auto& entry) { return entry.first == id; });
}

std::vector<std::pair<std::string, ListedFace>> FaceList::all() const {
    const std::lock_guard lock(mutex_);
    return faces_;
}

std::string text_of_codes(const Codes& codes) {
    constexpr const char* digits = "0123456789abcdef";
    std::string text;
    for (const Variable& group : codes.groups) {
        for (const float value : group.value().values<float>()) {
            const auto bits = Eigen::numext::bit_cast<std::uint16_t>(Eigen::half(value));
            for (int shift = 12; shift >= 0; shift -= 4) text += digits[(bits >> shift) & 15];
        }
    }
    return text;
}

Codes codes_of_text(const std::string& text) {
    if (text.size() != digits_of_element * static_cast<std::size_t>(code_size))
        fail<ValueError>("codes are ", digits_of_element * static_cast<std::size_t>(code_size),
                         " hexadecimal digits, got ", text.size(), " characters");
    std::vector<float> values;
    for (std::size_t at = 0; at < text.size(); at += digits_of_element) {
        std::uint16_t bits = 0;
        const char* end = text.data() + at + digits_of_element;
        if (std::from_chars(text.data() + at, end, bits, 16).ptr != end)
            fail<ValueError>("codes are hexadecimal digits, got \"",
                             text.substr(at, digits_of_element), '"');
        values.push_back(static_cast<float>(Eigen::numext::bit_cast<Eigen::half>(bits)));
        if (!std::isfinite(values.back())) fail<ValueError>("codes must be finite numbers");
    }
    return split_codes(Variable(Tensor::from({1, code_size}, std::span<const float>(values))));
}

}  // namespace stymo::view
