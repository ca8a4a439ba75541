#include "train/data/training_images.h"

#include <algorithm>
#include <iterator>
#include <numeric>
#include <utility>

#include "render/morphable/builtin_head.h"
#include "train/data/turned_face.h"

namespace stymo {

namespace {

/// Order of the images in one pass over them.
std::vector<std::int64_t> shuffled(std::int64_t count, Rng rng) {
    std::vector<std::int64_t> order(static_cast<std::size_t>(count));
    std::iota(order.begin(), order.end(), 0);
    for (std::int64_t i = count - 1; i > 0; --i)
        std::swap(order[static_cast<std::size_t>(i)],
                  order[static_cast<std::size_t>(rng.below(i + 1))]);
    return order;
}

Shared shared_by(const Dataset& faces, std::int64_t a, std::int64_t b) {
    if (a == b) return Shared::all;
    const PhotoOrigin &one = faces.entry(a)->origin, &other = faces.entry(b)->origin;
    if (!one.take.empty() && one.take == other.take) return Shared::all;
    return !one.series.empty() && one.series == other.series ? Shared::light : Shared::person;
}

/// Most radians by which a photo's face is turned. Farther around, its linear head shows mostly
/// what the photo does not.
constexpr double most_yaw = 0.7, most_pitch = 0.2;

}  // namespace

TrainingImages::TrainingImages(const Dataset& faces, const DataConfig& config, const Rng& rng,
                               std::int64_t smallest_target, std::int64_t ahead, CameraCheck check)
    : faces_(faces),
      mirror_(config.mirror),
      other_photo_(config.other_photo),
      turned_photos_(config.turned_photos),
      person_of_(static_cast<std::size_t>(faces.size()), -1),
      rng_(rng),
      smallest_target_(smallest_target),
      ahead_(ahead),
      check_(std::move(check)) {
    if (other_photo_ == 0.0) return;
    std::map<std::string, std::vector<std::int64_t>> people;
    for (std::int64_t face = 0; face < faces.size(); ++face) {
        const FaceEntry* const entry = faces.entry(face);
        if (entry != nullptr && !entry->origin.person.empty())
            people[entry->origin.person].push_back(face);
    }
    for (auto& [name, photos] : people) {
        if (photos.size() < 2) continue;
        for (const std::int64_t face : photos)
            person_of_[static_cast<std::size_t>(face)] = std::ssize(people_);
        people_.push_back(std::move(photos));
    }
}

std::int64_t TrainingImages::photos_with_partner() const {
    return std::ranges::count_if(person_of_, [](std::int64_t person) { return person >= 0; });
}

std::int64_t TrainingImages::photos_to_turn() const {
    std::int64_t count = 0;
    for (std::int64_t face = 0; face < faces_.size(); ++face) {
        const FaceEntry* const entry = faces_.entry(face);
        if (entry != nullptr && entry->pose && entry->has_code) ++count;
    }
    return count;
}

std::int64_t TrainingImages::other_photo_of(std::int64_t image, std::int64_t face) const {
    const std::int64_t person = person_of_[static_cast<std::size_t>(face)];
    if (person < 0) return face;
    Rng rng = rng_.split("other photo").split(static_cast<std::uint64_t>(image));
    if (rng.uniform() >= other_photo_) return face;
    const std::vector<std::int64_t>& photos = people_[static_cast<std::size_t>(person)];
    const std::int64_t other = photos[static_cast<std::size_t>(rng.below(std::ssize(photos) - 1))];
    return other == face ? photos.back() : other;
}

std::shared_ptr<const TrainingImages::Order> TrainingImages::order(std::int64_t pass) const {
    const std::lock_guard lock(mutex_);
    std::shared_ptr<const Order>& order = orders_[pass];
    if (!order) {
        order = std::make_shared<const Order>(
            shuffled(faces_.size(), rng_.split("order").split(static_cast<std::uint64_t>(pass))));
    }
    const std::shared_ptr<const Order> result = order;
    constexpr std::size_t kept = 2;
    if (orders_.size() > kept)
        orders_.erase(orders_.begin()->first == pass ? std::prev(orders_.end()) : orders_.begin());
    return result;
}

std::int64_t TrainingImages::face_of(std::int64_t image) const {
    return (*order(image / faces_.size()))[static_cast<std::size_t>(image % faces_.size())];
}

std::optional<Face> TrainingImages::turned(std::int64_t image, const Face& face) const {
    if (turned_photos_ == 0.0) return std::nullopt;
    Rng rng = rng_.split("turned").split(static_cast<std::uint64_t>(image));
    if (rng.uniform() >= turned_photos_) return std::nullopt;
    const double yaw = most_yaw * (2.0 * rng.uniform() - 1.0);
    const double pitch = most_pitch * (2.0 * rng.uniform() - 1.0);
    std::optional<Face> result = turned_face(face, builtin_head(), yaw, pitch);
    if (result && check_ && check_(result->pose, result->intrinsics)) return std::nullopt;
    return result;
}

TrainingImages::Trio TrainingImages::trio(std::int64_t image) const {
    const std::int64_t index = face_of(image);
    const std::int64_t other = other_photo_of(image, index);
    const bool mirror =
        mirror_ && rng_.split("mirror").split(static_cast<std::uint64_t>(image)).below(2) == 1;
    const auto as_shown = [mirror](const Face& face) { return mirror ? mirrored(face) : face; };
    // In place of a broken file the data set returns a photo of somebody else.
    const auto is_of = [this](const Face& face, std::int64_t photo) {
        return face.id == faces_.ids()[static_cast<std::size_t>(photo)];
    };
    const Face face = faces_.load(index);
    const std::optional<Face> view = turned(image, face);
    const Face shown = as_shown(view ? *view : face), own = as_shown(face);
    if (other != index && is_of(face, index))
        if (const Face photo = faces_.load(other); is_of(photo, other))
            return {shown, own, as_shown(photo), shared_by(faces_, index, other), true};
    return {shown, own, own, Shared::all, view.has_value()};
}

FaceBatch TrainingImages::batch(std::int64_t first_image, std::int64_t count,
                                std::int64_t largest_target) const {
    std::vector<Face> faces, own, others;
    std::vector<Shared> shared;
    bool has_others = false;
    for (std::int64_t image = first_image; image < first_image + count; ++image) {
        if (ahead_ > 0) faces_.announce(face_of(image + ahead_));
        Trio trio = this->trio(image);
        faces.push_back(std::move(trio.face));
        own.push_back(std::move(trio.own));
        others.push_back(std::move(trio.read));
        shared.push_back(trio.shared);
        has_others = has_others || trio.differ;
    }
    FaceBatch batch = make_batch(faces, smallest_target_, largest_target);
    if (has_others) read_people_from(batch, own, others, std::move(shared));
    return batch;
}

}  // namespace stymo
