#include "apps/fit/fitting.h"

#include <algorithm>
#include <fstream>
#include <iomanip>
#include <iterator>
#include <nlohmann/json.hpp>
#include <set>
#include <sstream>

#include "apps/common/command_line.h"
#include "apps/common/fit_options.h"
#include "apps/common/table.h"
#include "core/angle.h"
#include "core/clock.h"
#include "core/error.h"
#include "core/interrupt.h"
#include "core/io/file.h"
#include "core/io/image.h"
#include "core/metrics.h"
#include "core/progress.h"
#include "nn/models/code_file.h"

namespace stymo {

namespace {

/// The network that measures LPIPS: that of the loss, or the one of the command line, which is read
/// even if the fit does not use the term. Null without one.
const Lpips* metric_network(const LpipsOptions& options, const ReconstructionConfig& config,
                            const ReconstructionLoss& loss, std::optional<Lpips>& own) {
    if (loss.lpips() != nullptr) return loss.lpips();
    if (!options.trunk.empty())
        return &own.emplace(metric_config(options, config.perceptual), "leave out --lpips-trunk");
    // With a loss that has LPIPS the trunk may be the one that the configuration names.
    if (!options.heads.empty())
        fail<UsageError>("--lpips-heads requires --lpips-trunk where the fit has no LPIPS");
    return nullptr;
}

}  // namespace

Fitting::Fitting(const ModelOptions& model_options, const LpipsOptions& lpips_options,
                 FitJobOptions options)
    : mark(model_mark(model_options)),
      model(load_model(model_options)),
      config(fitting_config(lpips_options, model.config().reconstruction)),
      loss(config, "--perceptual-weight 0", model.has_encoder() ? &model.encoder() : nullptr),
      lpips(metric_network(lpips_options, config, loss, own_lpips)),
      job(model, loss, std::move(options)) {}

std::string Fitting::doubt_of(const FitReport& report) const {
    const double usual = model.validation_psnr().value_or(0.0);
    constexpr double far_below = 4.5;
    const double psnr =
        (report.tuned.defined() ? report.tuned_metrics : report.fitted_metrics).psnr;
    std::ostringstream text;
    text << std::fixed << std::setprecision(1) << "the PSNR is " << psnr << " dB";
    if (psnr > most_plausible_psnr) return text.str() + implausible_psnr;
    if (psnr >= usual - far_below) return {};
    text << ", far below what photos usually reach with this model (its first guesses of held-out "
            "photos: "
         << usual << " dB); look at the picture";
    return text.str();
}

namespace {

namespace fs = std::filesystem;

/// A file of the output; its folder is made.
fs::path file_in(const fs::path& folder, const std::string& id, const char* extension) {
    fs::path file = folder / (id + extension);
    require_writable_folder(file.parent_path());
    return file;
}

/// The line of a fitted photo. It holds no times, so that it is the same in every run.
JsonValue line_of(const FittedFaces& done, const FitReport& report,
                  const std::vector<std::string>& warnings, const std::string& mark) {
    JsonValue line =
        code_file_json(done.fit.fitted, 0, pose_from_camera(done.fit.cameras.front()), mark);
    line.add("steps", done.fit.losses.size());
    line.add("initial", to_json(report.initial_metrics));
    line.add("fitted", to_json(report.fitted_metrics));
    if (report.tuned.defined()) line.add("tuned", to_json(report.tuned_metrics));
    return line.add("warnings", warnings);
}

/// Why the photo of a line cannot be used; empty if it can.
std::string failure_in(const std::string& line) {
    const auto value = nlohmann::json::parse(line);
    return value.contains("failure") && value["failure"].is_string()
               ? value["failure"].get<std::string>()
               : "";
}

}  // namespace

FolderFit::FolderFit(const Fitting& fitting, fs::path photos, const fs::path& out,
                     const Settings& settings, Ranks& ranks)
    : fitting_(fitting),
      photos_(std::move(photos)),
      ranks_(ranks),
      scan_((ResultFolder::require_apart(out, photos_), ResultFolder::require_own(out),
             scan_folder(photos_))),
      results_(out, settings, "faces", "file", ranks) {
    for (const FaceFiles& files : scan_.faces) {
        names_.push_back(files.image.lexically_relative(photos_).string());
        if (!results_.contains(names_.back())) waiting_.push_back(&files);
    }
}

bool FolderFit::fit_photo(const FaceFiles& files) {
    const std::string name = files.image.string();
    JsonValue line;
    std::optional<FittedFaces> done;
    std::optional<FitReport> report;
    try {
        PreparedPhoto photo = fitting_.job.prepare({&name, 1}).front();
        done.emplace(fitting_.job.fit(fitting_.job.batch_of({&photo.face, 1})));
        if (!done->incomplete.empty()) return false;
        report.emplace(fitting_.job.report(*done, 0, done->faces.mask, fitting_.lpips));
        std::ranges::copy(done->warnings, std::back_inserter(photo.warnings));
        if (const std::string doubt = fitting_.doubt_of(*report); !doubt.empty())
            photo.warnings.push_back(doubt);
        line = line_of(*done, *report, photo.warnings, fitting_.mark);
    } catch (const Error& error) {
        std::string reason = error.what();
        if (reason.starts_with(name + ": ")) reason.erase(0, name.size() + 2);
        line.add("failure", reason);
        report.reset();
    }
    line.add("id", files.id).add("file", files.image.lexically_relative(photos_).string());
    const std::lock_guard lock(mutex_);
    if (report) {
        write_code_file(file_in(results_.path() / "codes", files.id, ".json"), done->fit.fitted, 0,
                        pose_from_camera(done->fit.cameras.front()), fitting_.mark);
        write_image(file_in(results_.path() / "fits", files.id, ".jpg"), comparison_sheet(*report));
        if (done->changes)
            done->changes->save(file_in(results_.path() / "tuned", files.id, ".safetensors"));
    }
    // Last, so that the files of every line exist.
    results_.append(line);
    ++done_now_;
    return true;
}

bool FolderFit::fit_share() {
    results_.begin();
    const std::vector<const FaceFiles*> share = share_of(ranks_, waiting_);
    Progress progress({.title = "photos", .total = std::ssize(share), .unit = "photos"});
    work_until_stopped(std::ssize(share), fitting_.job.options().tunes(), [&](std::int64_t i) {
        if (!fit_photo(*share[static_cast<std::size_t>(i)])) return;
        const std::lock_guard lock(mutex_);
        progress.update(done_now_);
    });
    return any(ranks_, interrupted());
}

void FolderFit::follow() {
    const InterruptGuard guard;
    static_cast<void>(fit_share());
}

AppResult FolderFit::lead() {
    const InterruptGuard guard;
    const double start = seconds_now();
    const bool stopped = fit_share();
    return result(seconds_now() - start, stopped);
}

std::vector<std::string> FolderFit::gone() const {
    const std::set<std::string> here(names_.begin(), names_.end());
    std::vector<std::string> gone;
    for (const std::string& photo : results_.photos())
        if (!here.contains(photo) && results_.read(photo, failure_in).empty())
            gone.push_back(photo);
    return gone;
}

AppResult FolderFit::result(double seconds, bool stopped) {
    std::vector<std::string> kept = names_;
    const std::vector<std::string> gone = this->gone();
    kept.insert(kept.end(), gone.begin(), gone.end());
    results_.join(kept);
    std::vector<JsonValue> failed;
    std::ostringstream text;
    std::string first;
    std::int64_t done = 0;
    for (const std::string& file : names_) {
        if (!results_.contains(file)) continue;
        ++done;
        const std::string failure = results_.read(file, failure_in);
        if (failure.empty()) continue;
        if (failed.empty()) first = file + ": " + failure;
        failed.push_back(JsonValue::object({{"file", file}, {"reason", failure}}));
        text << one_line("skipped " + file + ": " + failure) << '\n';
    }
    if (!scan_.left_out.empty()) text << left_out_text(scan_.left_out) << '\n';
    const std::int64_t fitted = done - std::ssize(failed);
    const std::int64_t found = std::ssize(names_);
    const std::int64_t before = found - std::ssize(waiting_);
    const double a_minute = 60.0 * static_cast<double>(done - before) / std::max(seconds, 1e-9);
    if (!stopped && fitted == 0) {
        if (gone.empty()) {
            std::filesystem::remove(results_.path() / "report.json");
            results_.remove();
        }
        fail<FileError>(photos_.string(), ": none of its ", found,
                        " photos can be used; the first: ", first);
    }
    text << fitted << " of " << found << " photos fitted";
    if (done > before)
        text << ", " << std::fixed << std::setprecision(2) << a_minute << " photos a minute";
    AppResult result{text.str(), JsonValue::object({{"found", found},
                                                    {"fitted", fitted},
                                                    {"failed", failed},
                                                    {"ranks", ranks_.size()},
                                                    {"photos_a_minute", a_minute}})};
    const bool repeats =
        done == before && gone.empty() && std::filesystem::exists(results_.path() / "report.json");
    if (!repeats)
        write_file(results_.path() / "report.json", result.json.text() + "\n", Durability::none);
    if (done < found)
        result.incomplete = "interrupted after " + std::to_string(done) + " of " +
                            std::to_string(found) + " photos; the same command continues";
    return result;
}

AppResult fit_video(const Fitting& fitting, const std::filesystem::path& film,
                    const std::filesystem::path& out, FilmOptions frames,
                    const VideoFitOptions& options) {
    const InterruptGuard guard;
    frames.on_progress = video_progress();
    const VideoFit video(fitting.job, film, std::move(frames), options);
    require_writable_folder(out);
    VideoSummary summary;
    const std::filesystem::path file = out / "codes.jsonl";
    write_whole(file, [&](const std::filesystem::path& temporary) {
        std::ofstream stream(temporary, std::ios::binary);
        const auto require_written = [&] {
            if (!stream) fail<FileError>(file.string(), ": cannot be written; is the disk full?");
        };
        summary = video.run([&](const FilmFrame& frame) {
            JsonValue line = code_file_json(frame.codes, 0, frame.pose, fitting.mark);
            line.add("frame", frame.index).add("face", frame.found).add("starts", frame.starts);
            stream << line.add("roll_deg", degrees_from_radians(frame.roll)).text() << '\n';
            // A full disk ends the run here, not after hours of other frames.
            require_written();
        });
        if (interrupted()) fail("interrupted; nothing was written");
        stream.flush();
        require_written();
    });
    const std::string loss =
        summary.loss ? "; photometric loss " + decimal(*summary.loss, 4) : std::string();
    AppResult result{text_from(text_of(summary.film), loss, "; person ",
                               decimal(summary.person_seconds, 1), " s"),
                     to_json(summary.film)};
    result.json.add("photometric", summary.loss ? JsonValue(*summary.loss) : JsonValue());
    result.json.add("person_seconds", summary.person_seconds);
    result.json.add("frames_per_second", video.frames_per_second());
    write_file(out / "report.json", result.json.text() + "\n", Durability::none);
    return result;
}

}  // namespace stymo
