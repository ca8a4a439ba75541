#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <span>
#include <vector>

#include "core/rng.h"
#include "core/tensor.h"
#include "train/data/folder_scan.h"
#include "train/data/image_files.h"
#include "train/head_mask_variation.h"

namespace stymo {

/// What a head-mask network learns from, in memory: photos of HeadMaskNetwork::usual_side with
/// masks, 0.4 megabytes each.
class HeadMaskExamples {
public:
    struct Batch {
        Tensor images;  ///< (B, S, S, 3) in [0, 1]
        Tensor masks;   ///< (B, S, S, 1) in [0, 1]
        Tensor known;   ///< (B, S, S, 1) in [0, 1], 0 where the mask counts for nothing
    };

    /// Reads an FFHQ folder of aligned photos (train/data/folder_scan.h) with `masks/ID.png`.
    /// Optional: `unknown/ID.png`, 1 where the mask is not to be trusted; `persons/ID.png`, the
    /// mask of the whole person, which makes it possible to change the background; and images in
    /// `backgrounds`. Throws FileError for a folder without images, and for an image without mask.
    explicit HeadMaskExamples(const std::filesystem::path& folder);

    [[nodiscard]] std::size_t size() const { return photos_.size(); }
    [[nodiscard]] const std::vector<BrokenFile>& left_out() const { return left_out_; }
    /// Examples drawn with replacement and varied: mirrored, turned, scaled and shifted, with
    /// larger hair, hats and other backgrounds, partly covered, in other colours, blurred and
    /// noisy. The same `rng` gives the same batch.
    [[nodiscard]] Batch draw(std::int64_t count, const HeadMaskVariation& variation,
                             const Rng& rng) const;

private:
    /// Bytes of all channels of a pixel one after the other.
    struct Picture {
        std::vector<std::uint8_t> bytes;
        bool has_person = false;
    };
    struct Example;

    [[nodiscard]] static Picture read_photo(const std::filesystem::path& folder,
                                            const FaceFiles& files);
    [[nodiscard]] Example varied(const HeadMaskVariation& variation, Rng& rng) const;
    void change_background(Example& example, Rng& rng) const;
    void cover(Example& example, Rng& rng) const;
    /// What hats and covers are made of: a background, or nothing for a plain colour.
    [[nodiscard]] std::span<const std::uint8_t> drawn_cloth(Rng& rng) const;

    std::vector<BrokenFile> left_out_;  ///< of the folder: what is no image
    std::vector<Picture> photos_;       ///< red, green, blue, mask, known, person
    std::vector<Picture> backgrounds_;  ///< red, green, blue
};

}  // namespace stymo
