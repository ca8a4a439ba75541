#pragma once

#include "core/rng.h"
#include "train/data/batch.h"
#include "train/data/dataset.h"

namespace stymo {

/// The images of a run in the order in which it consumes them: pass after pass over the data set,
/// each shuffled anew. The n-th image is a pure function of data set and generator.
class TrainingImages {
public:
    /// `mirror`: half of the faces, drawn at random, as a mirror shows them. `smallest_target` as
    /// in make_batch. The data set outlives this.
    TrainingImages(const Dataset& faces, bool mirror, const Rng& rng,
                   std::int64_t smallest_target = 64)
        : faces_(faces), mirror_(mirror), rng_(rng), smallest_target_(smallest_target) {}

    [[nodiscard]] FaceBatch batch(std::int64_t first_image, std::int64_t count) const;
    /// Passes over the data set that so many images make.
    [[nodiscard]] double epochs(std::int64_t images) const {
        return static_cast<double>(images) / static_cast<double>(faces_.size());
    }

private:
    const Dataset& faces_;
    bool mirror_;
    Rng rng_;
    std::int64_t smallest_target_;
};

}  // namespace stymo
