#include "apps/fit/folder_fit.h"

#include <algorithm>
#include <atomic>
#include <iomanip>
#include <iterator>
#include <sstream>

#include "apps/common/begun_settings.h"
#include "apps/common/folder_lock.h"
#include "core/clock.h"
#include "core/interrupt.h"
#include "core/io/checksum.h"
#include "core/io/file.h"
#include "core/io/image.h"
#include "core/parallel.h"
#include "core/progress.h"
#include "nn/models/code_file.h"

namespace stymo {

namespace {

namespace fs = std::filesystem;

constexpr const char* settings_file = "settings.json";

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

}  // namespace

void claim_folder(const fs::path& photos, const fs::path& out) {
    static_cast<void>(scan_folder(photos));
    if (fs::exists(out) && !fs::exists(out / settings_file) &&
        (!fs::is_directory(out) || !fs::is_empty(out)))
        fail<FileError>(out.string(), ": exists already; choose another folder or remove it");
    require_writable_folder(out);
}

FolderFit::FolderFit(const Fitting& fitting, fs::path photos, fs::path out,
                     const Settings& settings, Ranks& ranks)
    : fitting_(fitting),
      photos_(std::move(photos)),
      out_(std::move(out)),
      ranks_(ranks),
      scan_(scan_folder(photos_)),
      lines_(out_, ranks.rank()) {
    for (const auto& [name, value] : settings) settings_.add(name, value);
    // Nothing is written yet.
    if (fs::exists(out_ / settings_file)) begin_or_continue(out_, settings_, "faces.jsonl");
    for (const FaceFiles& files : scan_.faces)
        if (!lines_.contains(name_of(files))) waiting_.push_back(&files);
}

CommonState FolderFit::state() const {
    std::string photos;
    for (const FaceFiles* files : waiting_) photos += name_of(*files) + '\n';
    CommonState state = program_state();
    state.emplace_back("settings", settings_.text());
    state.emplace_back("a folder of photos", std::to_string(crc32c(photos)));
    return state;
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
    line.add("id", files.id).add("file", name_of(files));
    const std::lock_guard lock(mutex_);
    if (report) {
        write_code_file(file_in(out_ / "codes", files.id, ".json"), done->fit.fitted, 0,
                        pose_from_camera(done->fit.cameras.front()), fitting_.mark);
        write_image(file_in(out_ / "fits", files.id, ".jpg"), comparison_sheet(*report));
        if (done->changes) done->changes->save(file_in(out_ / "tuned", files.id, ".safetensors"));
    }
    // Last, so that the files of every line exist.
    lines_.append(line);
    ++done_now_;
    return true;
}

void FolderFit::fit_share() {
    std::vector<const FaceFiles*> share;
    for (std::size_t i = 0; i < waiting_.size(); ++i)
        if (static_cast<int>(i % static_cast<std::size_t>(ranks_.size())) == ranks_.rank())
            share.push_back(waiting_[i]);
    Progress progress({.title = "photos", .total = std::ssize(share), .unit = "photos"});
    std::atomic<bool> stopped = false;
    const auto work = [&](std::int64_t i) {
        if (stopped.load() || interrupted()) return;
        try {
            if (!fit_photo(*share[static_cast<std::size_t>(i)])) return;
        } catch (...) {
            // Otherwise the other threads would go on as long as there are photos.
            stopped = true;
            throw;
        }
        const std::lock_guard lock(mutex_);
        progress.update(done_now_);
    };
    if (fitting_.job.options().tunes()) {
        for (std::int64_t i = 0; i < std::ssize(share); ++i) work(i);
    } else {
        parallel_tasks(std::ssize(share), work);
    }
}

AppResult FolderFit::lead() {
    const FolderLock lock(out_);
    begin_or_continue(out_, settings_, "faces.jsonl");
    const InterruptGuard guard;
    const double start = seconds_now();
    fit_share();
    const bool stopped = any(ranks_, interrupted());
    return result(seconds_now() - start, stopped);
}

void FolderFit::follow() {
    const InterruptGuard guard;
    fit_share();
    static_cast<void>(any(ranks_, interrupted()));
}

AppResult FolderFit::result(double seconds, bool stopped) {
    std::vector<std::string> files;
    for (const FaceFiles& face : scan_.faces) files.push_back(name_of(face));
    lines_.join(files);
    std::vector<JsonValue> failed;
    std::ostringstream text;
    std::int64_t done = 0;
    for (const std::string& file : files) {
        if (!lines_.contains(file)) continue;
        ++done;
        if (lines_.failure_of(file).empty()) continue;
        failed.push_back(JsonValue::object({{"file", file}, {"reason", lines_.failure_of(file)}}));
        text << "skipped " << file << ": " << lines_.failure_of(file) << '\n';
    }
    if (!scan_.left_out.empty()) text << left_out_text(scan_.left_out) << '\n';
    const std::int64_t fitted = done - std::ssize(failed);
    const std::int64_t found = std::ssize(files);
    const std::int64_t before = found - std::ssize(waiting_);
    const double a_minute = 60.0 * static_cast<double>(done - before) / std::max(seconds, 1e-9);
    if (!stopped && fitted == 0) {
        const std::string first = files.front() + ": " + lines_.failure_of(files.front());
        for (const char* name : {"faces.jsonl", settings_file, ".lock"}) fs::remove(out_ / name);
        if (fs::is_empty(out_)) fs::remove(out_);
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
    write_file(out_ / "report.json", result.json.text() + "\n", Durability::none);
    if (done < found)
        result.incomplete = "interrupted after " + std::to_string(done) + " of " +
                            std::to_string(found) + " photos; the same command continues";
    return result;
}

}  // namespace stymo
