#include "train/data/training_images.h"

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

FaceBatch TrainingImages::batch(std::int64_t first_image, std::int64_t count) const {
    std::vector<Face> faces;
    std::int64_t epoch = -1;
    std::vector<std::int64_t> order;
    for (std::int64_t number = first_image; number < first_image + count; ++number) {
        if (number / faces_.size() != epoch) {
            epoch = number / faces_.size();
            order = shuffled(faces_.size(),
                             rng_.split("order").split(static_cast<std::uint64_t>(epoch)));
        }
        Face face = faces_.load(order[static_cast<std::size_t>(number % faces_.size())]);
        const bool mirror =
            mirror_ && rng_.split("mirror").split(static_cast<std::uint64_t>(number)).below(2) == 1;
        faces.push_back(mirror ? mirrored(face) : std::move(face));
    }
    return make_batch(faces, smallest_target_);
}

}  // namespace stymo
