#include "train/data/training_images.h"

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

}  // namespace

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
    std::vector<Face> faces;
    for (std::int64_t number = first_image; number < first_image + count; ++number) {
        Face face = faces_.load(face_of(number));
        if (ahead_ > 0) faces_.announce(face_of(number + ahead_));
        const bool mirror =
            mirror_ && rng_.split("mirror").split(static_cast<std::uint64_t>(number)).below(2) == 1;
        faces.push_back(mirror ? mirrored(face) : std::move(face));
    }
    return make_batch(faces, smallest_target_, largest_target);
}

}  // namespace stymo
