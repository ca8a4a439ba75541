#pragma once

#include <filesystem>
#include <functional>
#include <mutex>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "fit/fit_report.h"
#include "fit/fitter.h"
#include "fit/photo/prepared_photos.h"
#include "fit/tuning.h"
#include "nn/models/weight_changes.h"

namespace stymo {

struct FitJobOptions {
    PhotoPreparationSettings preparation{};
    /// The linear head to which the faces' codes belong, as in PhotoPreparationSettings::morphable
    /// (an empty path: the built-in head). Nothing, and poses of a network: depth follows from
    /// colours alone.
    std::optional<std::filesystem::path> head{};
    FitOptions fit{};        ///< the job sets `one_person`, `head` and `on_step`
    TuningOptions tuning{};  ///< the job sets `samples_per_ray`, `tolerance`, `head` and `on_step`

    [[nodiscard]] bool tunes() const { return tuning.seconds > 0.0 || tuning.steps > 0; }
};

/// What a job calls while it runs, on its own thread; each function may be empty. An exception ends
/// the job.
struct FitObserver {
    std::function<void(const FitStep&)> on_fit_step{};
    std::function<void(const FitResult&)> on_fitted{};  ///< before tuning, which takes longer
    std::function<void(const TuningStep&)> on_tuning_step{};
};

/// The result of a job for the photos of one person.
struct FittedFaces {
    FaceBatch faces;
    FitResult fit{};
    double fit_seconds = 0.0;
    /// The tuned decoder and its changes, which have the 16 bits of a file of weight changes.
    /// Nothing without tuning, and after an interruption.
    std::optional<Model> tuned{};
    std::optional<WeightChanges> changes{};
    TuningResult tuning{};
    std::string incomplete{};  ///< progress at an interruption; empty if the job is complete
    std::vector<std::string> warnings{};  ///< one line for each result that was not kept, and if
                                          ///< the photos have fewer pixels than the model
};

/// Fitting a photo from beginning to end: preparation, fit, tuning, report. Thread-safe.
class FitJob {
public:
    /// `model` and `loss` must outlive the job. Reads the head, and throws what
    /// `morphable_head_from` throws.
    FitJob(const Model& model, const ReconstructionLoss& loss, FitJobOptions options);

    [[nodiscard]] const Model& model() const { return model_; }
    [[nodiscard]] const FitJobOptions& options() const { return options_; }
    [[nodiscard]] const MorphableHead* head() const { return head_ ? &*head_ : nullptr; }

    /// What prepares photos for the model; read when it is first used. Throws what its constructor
    /// throws.
    [[nodiscard]] const PhotoPreparation& preparation() const;
    /// Finds, aligns and masks the face of each photo, as `prepare_photos` does.
    [[nodiscard]] std::vector<PreparedPhoto> prepare(std::span<const std::string> images,
                                                     const Tensor& known = {}) const;
    /// The faces as a batch whose targets have the model's sides up to `compared_side`.
    [[nodiscard]] FaceBatch batch_of(std::span<const Face> faces) const;

    /// Fits the codes to photos of one person and tunes the decoder, if the options ask for it. A
    /// fit that does not lower the loss leaves the initial codes, and tuning that does not lower
    /// the reconstruction loss of the photos the original decoder; both add a warning.
    /// Throws what `fit_codes` and `tune_decoder` throw. After an interrupt (core/interrupt.h) it
    /// returns what it has.
    [[nodiscard]] FittedFaces fit(FaceBatch faces, const FitObserver& observer = {}) const;
    /// The fit alone with these options, of which the job sets `head`: frames of a film
    /// (fit/video).
    [[nodiscard]] FitResult fit_frames(const FaceBatch& frames, FitOptions options) const;
    /// The faces with the codes from which a fit starts.
    [[nodiscard]] FittedFaces unfitted(FaceBatch faces) const;
    /// Shows and measures row `index` within `mask` (B, S, S, 1), as `report_fit` does; tuned, too,
    /// if the faces are.
    [[nodiscard]] FitReport report(const FittedFaces& done, std::int64_t index, const Tensor& mask,
                                   const Lpips* lpips, bool with_head_mask = false) const;

private:
    void tune(FittedFaces& done, const FitObserver& observer) const;

    const Model& model_;
    const ReconstructionLoss& loss_;
    FitJobOptions options_;
    std::optional<MorphableHead> head_;
    mutable std::once_flag preparation_read_;
    mutable std::optional<PhotoPreparation> preparation_;
};

/// The report's members, and "terms": the value of each term of the loss, by name, at the last step
/// of the fit under "fitted" and of the tuning under "tuned", whether or not its result was kept.
[[nodiscard]] JsonValue to_json(const FitReport& report, const FittedFaces& done);

}  // namespace stymo
