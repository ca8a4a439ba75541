#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include "apps/common/tool_options.h"
#include "apps/view/code_directions.h"
#include "apps/view/face_list.h"
#include "apps/view/frame.h"
#include "apps/view/job.h"
#include "apps/view/scheduler.h"
#include "fit/photo/prepared_photos.h"
#include "nn/models/code_file.h"
#include "nn/models/reconstruction.h"

namespace stymo::view {

struct ViewerOptions {
    ModelOptions model;              ///< `tuned` is for the faces of `codes` alone
    std::vector<std::string> codes;  ///< files of the faces with which every session starts
    std::filesystem::path parser;  ///< face parser that finds the part to recolour; empty: the part
                                   ///< is found by its colour
    std::int64_t fit_steps = 60;
    std::int64_t color_steps = 60;
    std::int64_t most_photo_pixels = std::int64_t{1} << 26;  ///< what 64-megapixel cameras make
    FrameSettings frames;
};

using DirectionNames = std::array<std::vector<EndNames>, code_names.size()>;

/// The objects that all sessions share. The model and its data never change; everything else is
/// made when it is first needed, under a lock.
class SharedState {
public:
    /// Throws what loading the model and the faces throws.
    explicit SharedState(const ViewerOptions& options);

    [[nodiscard]] const ViewerOptions& options() const { return options_; }
    [[nodiscard]] const std::shared_ptr<const Model>& model() const { return model_; }
    /// Identifies the model in code files.
    [[nodiscard]] const std::string& mark() const { return mark_; }
    /// Faces of `codes`, with the model that `tuned` gives.
    [[nodiscard]] const std::vector<ListedFace>& first_faces() const { return first_faces_; }
    /// Directions of the sliders; empty groups for a model without code statistics.
    [[nodiscard]] const std::array<GroupDirections, code_names.size()>& directions() const {
        return directions_;
    }
    /// What the ends of the directions do, measured when first asked for, in the background;
    /// nothing until then. Empty names if the model or the landmark network does not allow it.
    [[nodiscard]] std::optional<DirectionNames> direction_names();
    /// A face sampled from the model's code statistics with this seed. Throws ValueError for a
    /// model without statistics.
    [[nodiscard]] CodeFile drawn_face(std::uint64_t seed, double truncation) const;
    /// The loss of fits, which is made when first needed. Throws FileError if weights for it are
    /// missing.
    [[nodiscard]] const ReconstructionLoss& loss();
    /// What prepares photos and images of cameras, made when first needed. Throws Error in a build
    /// without dlib.
    [[nodiscard]] std::shared_ptr<const PhotoPreparation> preparation();
    /// The settings of `preparation`, but for those of the model.
    [[nodiscard]] PhotoPreparationSettings preparation_settings() const;
    [[nodiscard]] Scheduler& scheduler() { return *scheduler_; }
    [[nodiscard]] TunedModels& tuned_models() { return tuned_models_; }
    /// Locked by the job that uses all threads, so that other jobs wait.
    [[nodiscard]] std::timed_mutex& heavy_work() { return heavy_work_; }

private:
    ViewerOptions options_;
    std::shared_ptr<const Model> model_;
    std::string mark_;
    std::vector<ListedFace> first_faces_;
    std::array<GroupDirections, code_names.size()> directions_;
    std::mutex made_when_needed_;
    std::mutex preparing_;  ///< its networks take a while to read; nothing else waits for them
    std::unique_ptr<ReconstructionLoss> loss_;
    std::shared_ptr<const PhotoPreparation> preparation_;
    TunedModels tuned_models_;
    std::timed_mutex heavy_work_;
    std::unique_ptr<Scheduler> scheduler_;
    DirectionNames direction_names_;
    std::unique_ptr<Job> naming_;  ///< last, because it uses the other members
};

}  // namespace stymo::view
