#pragma once

#include <cstdint>
#include <filesystem>
#include <vector>

#include "nn/models/model.h"
#include "train/data/batch.h"

namespace stymo {

/// What is measured, and how long.
struct BenchOptions {
    std::filesystem::path model{};  ///< empty: paper-512 with random weights
    std::filesystem::path
        data{};       ///< photos whose initial codes are shown; empty: random codes and photos
    int repeats = 5;  ///< of whatever is timed
    int faces = 5;
    int views = 20;  ///< of each face, for errors
    std::int64_t samples = 64;
    std::int64_t steps = 100;  ///< of a fit whose outcome is compared
};

/// A model with the faces and cameras that it is measured on.
struct BenchSubject {
    Model model;  ///< frozen
    std::vector<Face> photos;
    Codes codes;  ///< one row for each photo, in Z
    std::vector<Camera>
        views;  ///< yaw within 30 degrees to either side, pitch within 8 up and down
    bool trained = false;
};

/// Throws what loading the model and the photos throws.
[[nodiscard]] BenchSubject make_subject(const BenchOptions& options, std::uint64_t seed);
/// The same faces and cameras with a model of random weights.
[[nodiscard]] BenchSubject random_subject(const ModelConfig& config, const BenchOptions& options,
                                          std::uint64_t seed);

}  // namespace stymo
