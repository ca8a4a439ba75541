#pragma once

#include <cstdint>
#include <filesystem>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include "apps/common/command_line.h"
#include "apps/common/result_folder.h"
#include "apps/common/tool_options.h"
#include "fit/fit_job.h"
#include "fit/video/video_fit.h"
#include "train/data/folder_scan.h"

namespace stymo {

/// The job of stymo-fit, with everything that must outlive it.
struct Fitting {
    /// Loads the model and the networks. Throws what they throw.
    Fitting(const ModelOptions& model, const LpipsOptions& lpips, FitJobOptions options);
    Fitting(const Fitting&) = delete;
    Fitting& operator=(const Fitting&) = delete;

    /// What is strange about the score of the final image; empty if nothing is.
    [[nodiscard]] std::string doubt_of(const FitReport& report) const;

    std::string mark;  ///< model_mark
    Model model;
    ReconstructionConfig config;
    ReconstructionLoss loss;
    std::optional<Lpips> own_lpips;
    const Lpips* lpips;  ///< measures LPIPS; null: it is not measured
    FitJob job;
};

/// Fits each photo of a folder by itself: a line of faces.jsonl, codes/ID.json, fits/ID.jpg (the
/// photo, the initial and the fitted face) and with tuning tuned/ID.safetensors. A photo that
/// cannot be used gets a line with its "failure". The ranks take the photos that have no line yet
/// in turn; the files have the same bits for any number of ranks.
class FolderFit {
public:
    /// Writes nothing. `fitting` and `ranks` must outlive the object. Throws FileError for photos
    /// that cannot be listed, and for an output folder that was begun with other settings or holds
    /// something else.
    FolderFit(const Fitting& fitting, std::filesystem::path photos,
              const std::filesystem::path& out, const Settings& settings, Ranks& ranks);

    /// What must be the same on all ranks.
    [[nodiscard]] CommonState state() const { return results_.state(names_); }
    /// Fits the share of rank 0, waits for the others and joins the results.
    [[nodiscard]] AppResult lead();
    /// Fits the share of another rank.
    void follow();
    /// Number of photos that this process has finished.
    [[nodiscard]] std::int64_t done_now() const { return done_now_; }

private:
    /// Returns whether a signal stopped any rank.
    bool fit_share();
    /// Returns false if a signal arrived before the photo was finished.
    bool fit_photo(const FaceFiles& files);
    [[nodiscard]] AppResult result(double seconds, bool stopped);
    /// Photos that earlier runs have fitted and that are no longer in the folder.
    [[nodiscard]] std::vector<std::string> gone() const;

    const Fitting& fitting_;
    std::filesystem::path photos_;
    Ranks& ranks_;
    FolderScan scan_;
    ResultFolder results_;
    std::vector<std::string> names_;  ///< of the photos, relative to their folder
    std::vector<const FaceFiles*> waiting_;
    std::mutex mutex_;  ///< held while results are written
    std::int64_t done_now_ = 0;
};

/// Fits a film and writes `codes.jsonl`, a code file a line with the members "frame", "face" (false
/// where the frame does not show it and the line repeats the one before), "starts" and "roll_deg"
/// (of the head in the frame), and report.json. Throws what VideoFit throws, and Error, before
/// codes.jsonl exists, if the process is interrupted.
[[nodiscard]] AppResult fit_video(const Fitting& fitting, const std::filesystem::path& film,
                                  const std::filesystem::path& out, FilmOptions frames,
                                  const VideoFitOptions& options);

}  // namespace stymo
