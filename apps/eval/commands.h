#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "apps/common/command_line.h"
#include "apps/common/tool_options.h"

namespace stymo {

struct PairOptions {
    std::filesystem::path a;
    std::filesystem::path b;
    LpipsOptions lpips;
};

/// Compares two images of the same size without a mask: L1, SSIM, PSNR, and, if a network is given,
/// LPIPS and its terms.
[[nodiscard]] AppResult compare_pair(const PairOptions& options);

/// Kernel Inception Distance (Binkowski et al. 2018) for features of any network: the unbiased
/// estimate of the squared maximum mean discrepancy between two sets of features, with the kernel
/// (x.y / d + 1)^3 for features of d numbers. For two sets from the same distribution its
/// expectation is 0, so it may be negative. Throws ValueError unless both sets have at least two
/// features and all features have the same length.
[[nodiscard]] double kernel_distance(const std::vector<std::vector<double>>& a,
                                     const std::vector<std::vector<double>>& b);

struct DrawnOptions {
    ModelOptions model;
    std::filesystem::path data;
    std::string ids;
    std::filesystem::path identity;  ///< weights of MobileFaceNet
    std::int64_t count = 200;        ///< number of faces to sample
    double truncation = 0.7;         ///< CodeStatistics::sample
    std::filesystem::path sheet;     ///< image file; empty: none is written
};

/// Compares faces sampled from the model with photos: the kernel distance of their embeddings, and
/// for reference that between two halves of the photos. Each sampled face is rendered with the
/// camera of a photo. The sheet shows the first 32 faces. Throws ValueError for a model without
/// code statistics.
[[nodiscard]] AppResult evaluate_drawn(const DrawnOptions& options, std::uint64_t seed);

/// Whether the codes of photos tell who they show.
struct PeopleScore {
    std::int64_t photos = 0;  ///< of people with at least two
    std::int64_t people = 0;
    /// Share of these photos whose nearest photo shows the same person.
    double nearest = 0.0;
    /// Share of these people whose photos are all nearer to each other than to anyone else's.
    double apart = 0.0;
    double same_cosine = 0.0;   ///< mean over the pairs of photos of one person
    double other_cosine = 0.0;  ///< mean over the pairs of photos of two people
    /// Photos that are nearer to somebody else's photo than to any of their own person, in their
    /// order: the position of the photo and that of the other one.
    std::vector<std::pair<std::size_t, std::size_t>> doubtful;
};

/// Compares the rows of `codes`, one for each name in `people` (empty: nobody's photo is known to
/// show the same person), by the cosine after each column has the mean 0 and the variance 1. Throws
/// ValueError if no person has two photos.
[[nodiscard]] PeopleScore people_score(const std::vector<std::vector<double>>& codes,
                                       const std::vector<std::string>& people);

struct PeopleOptions {
    ModelOptions model;
    std::filesystem::path data;
    std::string ids;
};

/// `stymo-eval people`: the score of the first guess's identity and texture codes of the photos of
/// a folder that names people. Throws ValueError for a model without an encoder.
[[nodiscard]] AppResult evaluate_people(const PeopleOptions& options);

}  // namespace stymo
