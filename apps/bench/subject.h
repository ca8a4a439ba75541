#pragma once

#include <cstdint>
#include <filesystem>
#include <vector>

#include "nn/models/face_batch.h"
#include "nn/models/model.h"

namespace stymo {

/// What is measured, and how often.
struct BenchOptions {
    std::filesystem::path model{};  ///< empty: paper-512 with random weights
    /// Photos whose initial codes are rendered; empty: random codes and photos.
    std::filesystem::path data{};
    int repeats = 5;  ///< repetitions of each timing
    int faces = 5;
    int views = 20;  ///< views of each face, for errors
    std::int64_t samples = 64;
    std::int64_t steps = 100;  ///< steps of fits whose results are compared
};

/// A model with the faces and cameras that it is measured on.
struct BenchSubject {
    Model model;  ///< frozen
    std::vector<Face> photos;
    Codes codes;  ///< one row for each photo, in Z
    /// Yaw within 30 degrees to either side, pitch within 8 degrees up and down.
    std::vector<Camera> views;
    bool trained = false;
};

/// Throws what loading the model and the photos throws.
[[nodiscard]] BenchSubject make_subject(const BenchOptions& options, std::uint64_t seed);
/// The same faces and cameras with a model of random weights.
[[nodiscard]] BenchSubject random_subject(const ModelConfig& config, const BenchOptions& options,
                                          std::uint64_t seed);

}  // namespace stymo
