#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <vector>

#include "core/rng.h"
#include "nn/models/face_batch.h"
#include "train/data/dataset.h"

namespace stymo {

/// The images of a run in the order in which it consumes them: passes over the data set, each
/// shuffled differently. The n-th image is a pure function of data set and generator.
class TrainingImages {
public:
    /// Of `config`, `mirror` and the two shares of photos are read. `smallest_target` as in
    /// make_batch. When an image is loaded, the operating system is told to read the image that is
    /// used `ahead` images later; 0: it is not. A face is not turned to where `check` objects to
    /// its camera. The data set must outlive this object.
    TrainingImages(const Dataset& faces, const DataConfig& config, const Rng& rng,
                   std::int64_t smallest_target = 64, std::int64_t ahead = 0,
                   CameraCheck check = {});

    /// The batch of images [first_image, first_image + count), `largest_target` as in make_batch.
    /// Thread-safe.
    [[nodiscard]] FaceBatch batch(std::int64_t first_image, std::int64_t count,
                                  std::int64_t largest_target = 0) const;
    /// The number of passes over the data set that this number of images makes.
    [[nodiscard]] double epochs(std::int64_t images) const {
        return static_cast<double>(images) / static_cast<double>(faces_.size());
    }
    /// The number of photos in whose place another one of the same person may be encoded.
    [[nodiscard]] std::int64_t photos_with_partner() const;
    /// The number of photos that may be shown turned: those with a pose and a code.
    [[nodiscard]] std::int64_t photos_to_turn() const;
    /// Seconds in which threads waited for the disk, summed over all threads.
    [[nodiscard]] double waiting_seconds() const { return faces_.waiting_seconds(); }

private:
    /// The face that an image shows, the photo that it was made of, and the photo of the same
    /// person from which the encoder reads what both share.
    struct Trio {
        Face face, own, read;
        Shared shared = Shared::all;
        bool differ = false;
    };
    using Order = std::vector<std::int64_t>;  ///< face of each image in one pass
    [[nodiscard]] std::shared_ptr<const Order> order(std::int64_t pass) const;
    [[nodiscard]] std::int64_t face_of(std::int64_t image) const;
    /// The photo of the same person that the encoder sees for image `image`, or the face itself.
    [[nodiscard]] std::int64_t other_photo_of(std::int64_t image, std::int64_t face) const;
    [[nodiscard]] Trio trio(std::int64_t image) const;
    /// The face turned by a random angle, for some of the images.
    [[nodiscard]] std::optional<Face> turned(std::int64_t image, const Face& face) const;

    const Dataset& faces_;
    bool mirror_;
    double other_photo_;
    double turned_photos_;
    std::vector<std::vector<std::int64_t>> people_;  ///< of each person with several photos
    std::vector<std::int64_t> person_of_;            ///< of each face the index into people_, or -1
    Rng rng_;
    std::int64_t smallest_target_;
    std::int64_t ahead_;
    CameraCheck check_;
    mutable std::mutex mutex_;
    /// The orders of the last two passes, because shuffling a million faces for each batch would be
    /// slow.
    mutable std::map<std::int64_t, std::shared_ptr<const Order>> orders_;
};

}  // namespace stymo
