#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include "apps/common/model_options.h"
#include "apps/view/frame.h"
#include "apps/view/scheduler.h"
#include "fit/photo/face_detector.h"
#include "nn/models/code_directions.h"
#include "nn/models/code_file.h"
#include "nn/models/reconstruction.h"

namespace stymo::view {

struct StudioOptions {
    ModelOptions model;
    std::vector<std::string> codes;  ///< faces that every session starts with
    std::filesystem::path parser;    ///< finds the part to recolour; empty: by its colour
    std::int64_t fit_steps = 60;     ///< of L-BFGS
    std::int64_t color_steps = 60;
    std::int64_t most_photo_pixels = 50'000'000;
    FrameSettings frames;
    bool chooses_mode = true;  ///< the faster one of skip and half, in place of that of `frames`
};

/// What all sessions share: the model and what goes with it. Everything but the scheduler and the
/// locks stays as it is made.
class Studio {
public:
    /// Throws what loading the model and the faces throws.
    explicit Studio(const StudioOptions& options);

    [[nodiscard]] const StudioOptions& options() const { return options_; }
    [[nodiscard]] const std::shared_ptr<const Model>& model() const { return model_; }
    [[nodiscard]] const std::vector<std::pair<std::string, CodeFile>>& first_faces() const {
        return first_faces_;
    }
    /// Empty groups for a model without statistics of codes.
    [[nodiscard]] const std::array<GroupDirections, code_names.size()>& directions() const {
        return directions_;
    }
    /// Face `seed` of the model's distribution. Throws ValueError for a model without one.
    [[nodiscard]] CodeFile drawn_face(std::uint64_t seed, double truncation) const;
    /// What fits minimise. Throws FileError if the model needs weights that are not there.
    [[nodiscard]] const ReconstructionLoss& loss();
    /// Throws Error in a build without dlib.
    [[nodiscard]] std::shared_ptr<const FaceDetector> face_detector();
    [[nodiscard]] Scheduler& scheduler() { return *scheduler_; }
    /// Held by the job that uses all threads; the others wait.
    [[nodiscard]] std::timed_mutex& heavy_work() { return heavy_work_; }

private:
    /// For the wanted PSNR of the first face.
    [[nodiscard]] double chosen_tolerance() const;

    StudioOptions options_;
    std::shared_ptr<const Model> model_;
    std::vector<std::pair<std::string, CodeFile>> first_faces_;
    std::array<GroupDirections, code_names.size()> directions_;
    std::mutex made_when_needed_;
    std::unique_ptr<ReconstructionLoss> loss_;
    std::shared_ptr<const FaceDetector> detector_;
    std::timed_mutex heavy_work_;
    std::unique_ptr<Scheduler> scheduler_;
};

}  // namespace stymo::view
