#include "train/data/training_images.h"

#include <algorithm>
#include <iterator>
#include <numeric>
#include <utility>

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

bool same_series(const Dataset& faces, std::int64_t a, std::int64_t b) {
    const FaceEntry *const one = faces.entry(a), *const other = faces.entry(b);
    return !one->origin.series.empty() && one->origin.series == other->origin.series;
}

}  // namespace

TrainingImages::TrainingImages(const Dataset& faces, const DataConfig& config, const Rng& rng,
                               std::int64_t smallest_target, std::int64_t ahead)
    : faces_(faces),
      mirror_(config.mirror),
      other_photo_(config.other_photo),
      person_of_(static_cast<std::size_t>(faces.size()), -1),
      rng_(rng),
      smallest_target_(smallest_target),
      ahead_(ahead) {
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

FaceBatch TrainingImages::batch(std::int64_t first_image, std::int64_t count,
                                std::int64_t largest_target) const {
    std::vector<Face> faces, others;
    std::vector<bool> same_light;
    bool has_others = false;
    for (std::int64_t number = first_image; number < first_image + count; ++number) {
        const std::int64_t index = face_of(number);
        std::int64_t other = other_photo_of(number, index);
        if (ahead_ > 0) faces_.announce(face_of(number + ahead_));
        const bool mirror =
            mirror_ && rng_.split("mirror").split(static_cast<std::uint64_t>(number)).below(2) == 1;
        const auto loaded = [&](std::int64_t photo) {
            Face face = faces_.load(photo);
            return mirror ? mirrored(face) : face;
        };
        faces.push_back(loaded(index));
        if (other_photo_ == 0.0) continue;
        others.push_back(other == index ? faces.back() : loaded(other));
        // In place of a broken file the data set returns a photo of somebody else.
        const auto is_of = [&](const Face& face, std::int64_t photo) {
            return face.id == faces_.ids()[static_cast<std::size_t>(photo)];
        };
        if (!is_of(faces.back(), index) || !is_of(others.back(), other)) {
            others.back() = faces.back();
            other = index;
        }
        same_light.push_back(other == index || same_series(faces_, index, other));
        has_others = has_others || other != index;
    }
    FaceBatch batch = make_batch(faces, smallest_target_, largest_target);
    if (has_others) read_people_from(batch, others, std::move(same_light));
    return batch;
}

}  // namespace stymo
