#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <limits>
#include <vector>

#include "core/median.h"
#include "nn/models/face_batch.h"
#include "nn/models/model.h"
#include "nn/realtime/face_renderer.h"

namespace stymo {

/// Times of repeated runs.
struct Timing {
    std::vector<double> seconds;
    std::vector<double> multiply_adds{};  ///< float32 operations per second of the machine after
                                          ///< each run (measure_multiply_adds)

    /// Adds a run, and measures the current performance of the machine.
    void add(double run_seconds);
    void add(const Timing& other);
    [[nodiscard]] double median() const { return stymo::median(seconds); }
};

/// Calls `body` once without timing, then at least `repeats` times and for at least
/// `at_least_seconds`, but at most a hundred times.
[[nodiscard]] Timing time_repeated(int repeats, double at_least_seconds,
                                   const std::function<void()>& body);

/// What is measured, and how often.
struct BenchOptions {
    std::filesystem::path model{};  ///< empty: paper-512 with random weights
    /// Photos whose initial codes are rendered; empty: random codes and photos.
    std::filesystem::path data{};
    int repeats = 5;  ///< repetitions of each timing
    int faces = 5;
    int views = 20;  ///< views of each face, for errors
    std::int64_t samples = 64;
    std::uint64_t seed = 0;
};

/// A model with the faces and cameras that it is measured on.
struct BenchSubject {
    Model model;  ///< frozen
    std::vector<Face> photos;
    Codes codes;  ///< one row for each photo, in Z
    /// Yaw within 30 degrees to either side, pitch within 8 degrees up and down.
    std::vector<Camera> views;
};

/// Throws what loading the model and the photos throws.
[[nodiscard]] BenchSubject make_subject(const BenchOptions& options);
/// The last `faces` photos of the folder, which trainings hold out; fewer if it has fewer.
[[nodiscard]] std::vector<Face> last_photos(const BenchOptions& options, const ModelConfig& config,
                                            std::int64_t faces);

/// Times frames of each face in turn. Consecutive frames have different views.
[[nodiscard]] Timing time_frames(const BenchSubject& subject, FaceRenderer& renderer, int repeats);

/// Multiply-adds of the matrix products and convolutions of a frame with every sample, and of its
/// field alone. They are nearly all of the arithmetic.
[[nodiscard]] double frame_work(const Model& model, std::int64_t samples_per_ray);
[[nodiscard]] double field_work(const Model& model, std::int64_t samples_per_ray);

/// Images of every face in every view, for comparison.
using Images = std::vector<Tensor>;
[[nodiscard]] Images all_images(const BenchSubject& subject, const RendererOptions& options);

/// Errors of images against exact ones, for values in [0, 1].
struct ImageError {
    double psnr_mean = 0.0;  ///< decibels, mean over the images
    /// Infinite if all images are equal.
    double psnr_worst = std::numeric_limits<double>::infinity();
    double root_mean_square = 0.0;  ///< over all values of all images
    double worst_pixel = 0.0;       ///< largest difference of any value
};
[[nodiscard]] ImageError error_of(const Images& images, const Images& exact);

}  // namespace stymo
