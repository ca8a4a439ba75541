#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <mutex>
#include <vector>

#include "core/rng.h"
#include "train/data/batch.h"
#include "train/data/dataset.h"

namespace stymo {

/// The images of a run in the order in which it consumes them: pass after pass over the data set,
/// each shuffled anew. The n-th image is a pure function of data set and generator.
class TrainingImages {
public:
    /// `mirror`: half of the faces, drawn at random, as a mirror shows them. `smallest_target` as
    /// in make_batch. When an image is loaded, the one `ahead` later is announced to the system; 0:
    /// none is. The data set outlives this.
    TrainingImages(const Dataset& faces, bool mirror, const Rng& rng,
                   std::int64_t smallest_target = 64, std::int64_t ahead = 0)
        : faces_(faces),
          mirror_(mirror),
          rng_(rng),
          smallest_target_(smallest_target),
          ahead_(ahead) {}

    /// May be called by several threads at once.
    [[nodiscard]] FaceBatch batch(std::int64_t first_image, std::int64_t count) const;
    /// Passes over the data set that so many images make.
    [[nodiscard]] double epochs(std::int64_t images) const {
        return static_cast<double>(images) / static_cast<double>(faces_.size());
    }
    /// Of all threads together, in which they waited for the disk instead of computing.
    [[nodiscard]] double waiting_seconds() const { return faces_.waiting_seconds(); }

private:
    using Order = std::vector<std::int64_t>;  ///< of the images in one pass
    [[nodiscard]] std::shared_ptr<const Order> order(std::int64_t pass) const;
    [[nodiscard]] std::int64_t face_of(std::int64_t image) const;

    const Dataset& faces_;
    bool mirror_;
    Rng rng_;
    std::int64_t smallest_target_;
    std::int64_t ahead_;
    mutable std::mutex mutex_;
    /// Of the last two passes: shuffling a million faces for each batch would take its time.
    mutable std::map<std::int64_t, std::shared_ptr<const Order>> orders_;
};

}  // namespace stymo
