#include "apps/eval/evaluate.h"

#include <algorithm>
#include <charconv>
#include <map>
#include <set>
#include <sstream>

#include "apps/common/command_line.h"
#include "apps/eval/person_measures.h"
#include "core/error.h"
#include "core/interrupt.h"
#include "core/io/file.h"
#include "core/io/image.h"
#include "core/ops/elementwise.h"
#include "core/ops/resample.h"
#include "core/progress.h"
#include "fit/photo/prepared_photos.h"
#include "nn/models/display_image.h"
#include "render/parsing_classes.h"
#include "train/train_config.h"

namespace stymo {

FaceRegion::FaceRegion(const std::filesystem::path& parser) {
    if (!parser.empty()) parser_.emplace(parser);
}

Tensor FaceRegion::mask(const FaceFiles& files, std::int64_t side) {
    if (tells_face_region(files)) return at_model_side(read_face_region(files), side);
    if (!parser_)
        fail<FileError>(files.image.string(),
                        ": nothing tells its face from hair and ears (parsing/", files.id,
                        ".png, CelebAMask-HQ's parts); give --parser");
    const Tensor photo = central_square(read_image(files.image));
    const std::lock_guard lock(parsing_);
    Tensor region = parser_->parse(photo);
    for (float& value : region.mutable_values<float>())
        value = is_face_class(static_cast<int>(value)) ? 1.0F : 0.0F;
    return at_model_side(region, side);
}

namespace {

std::int64_t parse_index(std::string_view text, const std::string& whole) {
    std::int64_t value = 0;
    const auto end = std::from_chars(text.data(), text.data() + text.size(), value);
    if (text.empty() || end.ec != std::errc{} || end.ptr != text.data() + text.size() ||
        value < 0) {
        fail<UsageError>("--ids ", whole,
                         ": must be a range of positions in the order of ids, such as 700-799, or "
                         "a file of ids");
    }
    return value;
}

FaceRange read_list(const std::string& file) {
    FaceRange range{.list = file};
    std::istringstream lines(read_file(file));
    std::set<std::string> known;
    for (std::string line; std::getline(lines, line);) {
        if (line.ends_with('\r')) line.pop_back();
        const std::size_t number = range.ids.size() + 1;
        if (line.empty()) fail<FileError>(file, ", line ", number, ": there is no id");
        if (!known.insert(line).second)
            fail<FileError>(file, ", line ", number, ": ", line, " is listed twice");
        range.ids.push_back(std::move(line));
    }
    if (range.ids.empty()) fail<FileError>(file, ": lists no ids");
    return range;
}

FaceScore score_of(const std::string& id, const FitReport& report, const ComparedFace& face,
                   const EvaluationOptions& options) {
    FaceScore score{id, {}, report.counting_samples};
    const bool tuned = report.tuned.defined();
    for (std::size_t k = 0; k < options.regions.size(); ++k) {
        RegionScore& region =
            score.regions.emplace_back(RegionScore{options.regions[k], report.initial_metrics});
        if (options.fit) region.fitted = report.fitted_metrics;
        if (tuned) region.tuned = report.tuned_metrics;
        if (k == 0) continue;
        const MetricTarget measured(report.target, display_mask(face.masks[k], 0), options.lpips,
                                    known_in(face.batch, 0));
        region.initial = measured.measure(report.initial);
        if (options.fit) region.fitted = measured.measure(report.fitted);
        if (tuned) region.tuned = measured.measure(report.tuned);
    }
    return score;
}

/// The results of several threads, by position in the order of ids.
class Findings {
public:
    Findings(const Dataset& faces, const std::vector<std::int64_t>& positions, ScoreFolder* folder)
        : faces_(faces), folder_(folder), asked_(std::ssize(positions)) {
        if (folder == nullptr) return;
        for (const std::int64_t position : positions)
            if (folder->results().contains(id_of(position)))
                keep(position, folder->score(id_of(position)));
    }

    [[nodiscard]] bool contains(std::int64_t position) const { return scores_.contains(position); }
    [[nodiscard]] std::int64_t count() const { return std::ssize(scores_); }

    void add(std::int64_t position, FaceScore score, const FitResult& fit, Progress& progress) {
        const std::lock_guard lock(mutex_);
        if (folder_ != nullptr) folder_->add(score, fit);
        keep(position, std::move(score));
        progress.update(done(), text());
    }
    void add_failure(std::int64_t position, const std::string& reason) {
        const std::lock_guard lock(mutex_);
        failed_.insert_or_assign(position, FailedFace{id_of(position), reason});
    }

    /// Adds what the other ranks have found.
    void join(Ranks& ranks) {
        if (ranks.size() == 1) return;
        std::string own;
        const auto add_record = [&](char kind, std::int64_t position, const std::string& text) {
            own += kind + std::to_string(position) + ' ' + text + '\0';
        };
        for (const auto& [position, score] : scores_)
            add_record('s', position, to_json(score).text());
        for (const auto& [position, face] : failed_) add_record('f', position, face.reason);
        for (const std::string& found : gather(ranks, own)) {
            std::istringstream records(found);
            for (std::string record; std::getline(records, record, '\0');) {
                const std::int64_t position = std::stoll(record.substr(1));
                const std::string text = record.substr(record.find(' ') + 1);
                if (record.front() == 's')
                    keep(position, parse_face_score(text));
                else
                    failed_.insert_or_assign(position, FailedFace{id_of(position), text});
            }
        }
    }

    [[nodiscard]] Evaluation evaluation() const {
        Evaluation evaluation;
        for (const auto& [position, score] : scores_) evaluation.scores.push_back(score);
        for (const auto& [position, face] : failed_) evaluation.failed.push_back(face);
        if (done() < asked_) {
            std::ostringstream text;
            text << "interrupted after " << done() << " of " << asked_ << " faces";
            if (folder_ != nullptr) text << "; the same command continues from there";
            evaluation.incomplete = text.str();
        }
        return evaluation;
    }

private:
    [[nodiscard]] const std::string& id_of(std::int64_t position) const {
        return faces_.ids()[static_cast<std::size_t>(position)];
    }
    [[nodiscard]] std::int64_t done() const { return std::ssize(scores_) + std::ssize(failed_); }
    void keep(std::int64_t position, FaceScore score) {
        const auto [place, is_new] = scores_.try_emplace(position, std::move(score));
        if (!is_new) return;
        const auto& region = place->second.regions.front();
        initial_psnr_ += region.initial.psnr;
        last_psnr_ += region.last().psnr;
        fitted_ = fitted_ || region.fitted;
    }
    [[nodiscard]] std::string text() const {
        const auto mean = [this](double sum) {
            return decimal(sum / static_cast<double>(scores_.size()), 2);
        };
        const std::string first = text_from("PSNR ", mean(initial_psnr_), " initial");
        return fitted_ ? text_from(first, ", ", mean(last_psnr_), " fitted") : first;
    }

    const Dataset& faces_;
    ScoreFolder* folder_;
    std::int64_t asked_;
    std::mutex mutex_;
    std::map<std::int64_t, FaceScore> scores_;
    double initial_psnr_ = 0.0, last_psnr_ = 0.0;  ///< sums over `scores_`
    bool fitted_ = false;
    std::map<std::int64_t, FailedFace> failed_;
};

/// The next readable photo of somebody else; nothing if there is none.
std::optional<ComparedFace> photo_of_another(const FitJob& job, const Dataset& faces,
                                             std::int64_t index, const EvaluationOptions& options) {
    const auto person_of = [&faces](std::int64_t face) {
        const FaceEntry* const entry = faces.entry(face);
        return entry == nullptr ? std::string() : entry->origin.person;
    };
    const std::string person = person_of(index);
    EvaluationOptions whole = options;
    whole.regions = {Region::head};  // the part of a face that networks see
    for (std::int64_t step = 1; step < faces.size(); ++step) {
        const std::int64_t other = (index + step) % faces.size();
        if (!person.empty() && person_of(other) == person) continue;
        try {
            return compared_face(job.model(), faces, other, whole);
        } catch (const Error&) {
            continue;  // reported where this photo itself is scored
        }
    }
    return std::nullopt;
}

/// Adds identity and shape to a score, if they are measured.
void measure_person(const FitJob& job, const Dataset& faces, const ComparedFace& face,
                    const FittedFaces& done, const EvaluationOptions& options, FaceScore& score) {
    if (options.identity != nullptr) {
        const auto found = photo_of_another(job, faces, face.index, options);
        const ComparedFace* const other = found ? &*found : nullptr;
        score.identity = options.identity->measure(job.model(), face, other, done.fit);
        if (done.tuned)
            score.tuned_identity = options.identity->measure(*done.tuned, face, other, done.fit);
    }
    if (options.shape != nullptr) {
        score.shape = options.shape->measure(job.model(), face, done.fit);
        if (done.tuned) score.tuned_shape = options.shape->measure(*done.tuned, face, done.fit);
    }
}

}  // namespace

FaceRange parse_range(const std::string& text) {
    if (text.empty()) return {};
    if (std::filesystem::is_regular_file(text)) return read_list(text);
    const std::size_t dash = text.find('-');
    const std::int64_t first = parse_index(std::string_view(text).substr(0, dash), text);
    if (dash == std::string::npos) return {first, first};
    if (dash + 1 == text.size()) return {first, -1};
    const std::int64_t last = parse_index(std::string_view(text).substr(dash + 1), text);
    if (last < first) fail<UsageError>("--ids ", text, ": the range ends before it begins");
    return {first, last};
}

std::vector<std::int64_t> positions_of(const Dataset& faces, const FaceRange& range) {
    std::vector<std::int64_t> positions;
    for (std::size_t i = 0; i < range.ids.size(); ++i) {
        const auto found = std::ranges::find(faces.ids(), range.ids[i]);
        if (found == faces.ids().end())
            fail<FileError>(range.list.string(), ", line ", i + 1, ": the folder has no face ",
                            range.ids[i]);
        positions.push_back(found - faces.ids().begin());
    }
    std::ranges::sort(positions);
    if (!range.ids.empty()) return positions;
    const std::int64_t last =
        range.last < 0 ? faces.size() - 1 : std::min(range.last, faces.size() - 1);
    if (range.first > last)
        fail<ConfigError>("--ids: the folder has only ", faces.size(), " faces, counted from 0");
    for (std::int64_t i = range.first; i <= last; ++i) positions.push_back(i);
    return positions;
}

void require_comparable(const Dataset& faces, const EvaluationOptions& options) {
    const std::vector<std::int64_t> positions = positions_of(faces, options.range);
    if (std::ranges::find(options.regions, Region::face) == options.regions.end()) return;
    if (options.face_region == nullptr)
        fail<ValueError>("the region of the face needs a FaceRegion");
    if (std::ranges::any_of(
            positions, [&](std::int64_t i) { return options.face_region->tells(faces.files(i)); }))
        return;
    fail<FileError>(
        "--region: the folder has neither parsing/ID.png nor CelebAMask-HQ's parts to tell faces "
        "from hair; give ",
        "--parser with an ONNX file, or --region head");
}

ComparedFace compared_face(const Model& model, const Dataset& faces, std::int64_t index,
                           const EvaluationOptions& options) {
    const Face face = faces.load_exactly(index);
    ComparedFace result{index, make_batch({&face, 1}, model.decoder().ladder().smallest()), {}};
    std::vector<Tensor>& targets = result.batch.targets;
    while (options.resolution > 0 && targets.size() > 1 &&
           targets.back().shape(1) > options.resolution)
        targets.pop_back();
    const std::int64_t side = model.config().decoder.resolution;
    const int compared = static_cast<int>(targets.back().shape(1));
    for (const Region region : options.regions) {
        Tensor mask = result.batch.mask;
        if (region == Region::face) {
            // Outside the head the target is always black.
            const Tensor within =
                options.face_region->mask(faces.files(index), side).reshaped(mask.shape());
            mask = (Variable(mask) * within).value();
        }
        result.masks.push_back(resize_box(mask, compared, compared).value());
    }
    return result;
}

Evaluation evaluate(const FitJob& job, const Dataset& faces, const EvaluationOptions& options) {
    require_comparable(faces, options);
    OneRank alone;
    Ranks& ranks = options.ranks != nullptr ? *options.ranks : alone;
    const std::vector<std::int64_t> asked = positions_of(faces, options.range);
    Findings findings(faces, asked, options.folder);
    std::vector<std::int64_t> positions = asked;
    std::erase_if(positions, [&](std::int64_t position) { return findings.contains(position); });
    positions = share_of(ranks, positions);

    const InterruptGuard guard;
    if (options.folder != nullptr) options.folder->results().begin();
    Progress progress({.title = "evaluate",
                       .total = findings.count() + std::ssize(positions),
                       .first = findings.count(),
                       .unit = "faces"});
    const auto do_face = [&](std::int64_t position) {
        const std::string& id = faces.ids()[static_cast<std::size_t>(position)];
        std::optional<FittedFaces> done;
        FaceScore score;
        try {
            const ComparedFace face = compared_face(job.model(), faces, position, options);
            done.emplace(options.fit ? job.fit(face.batch) : job.unfitted(face.batch));
            if (!done->incomplete.empty()) return;
            score = score_of(id, job.report(*done, 0, face.masks.front(), options.lpips), face,
                             options);
            measure_person(job, faces, face, *done, options, score);
        } catch (const Error& error) {
            findings.add_failure(position, error.what());
            return;
        }
        // A disk that is full is no fault of the face: it stops the run.
        if (done->changes && options.folder != nullptr)
            done->changes->save(options.folder->tuned_of(id));
        findings.add(position, std::move(score), done->fit, progress);
    };
    work_until_stopped(std::ssize(positions),
                       options.one_by_one || (options.fit && job.options().tunes()),
                       [&](std::int64_t k) { do_face(positions[static_cast<std::size_t>(k)]); });
    findings.join(ranks);
    if (!ranks.leads()) return {};
    if (options.folder != nullptr) {
        std::vector<std::string> ids;
        for (const std::int64_t i : asked) ids.push_back(faces.ids()[static_cast<std::size_t>(i)]);
        options.folder->results().join(ids);
    }
    Evaluation evaluation = findings.evaluation();
    if (evaluation.scores.empty()) {
        if (evaluation.failed.empty()) fail<FileError>("interrupted; no face was scored");
        fail<FileError>("none of the ", evaluation.failed.size(),
                        " faces could be scored; the first: ", evaluation.failed.front().reason);
    }
    progress.finish();
    return evaluation;
}

Split split_called(const std::string& name) {
    if (name.empty()) return Split::all;
    if (name == "train") return Split::training;
    if (name == "val") return Split::validation;
    if (name == "test") return Split::test;
    fail<UsageError>("--split ", name, ": must be train, val or test");
}

DataConfig split_of_run(const std::filesystem::path& model) {
    const std::filesystem::path folder = std::filesystem::absolute(model).parent_path();
    for (const std::filesystem::path& run : {folder, folder.parent_path().parent_path()})
        if (std::filesystem::exists(run / "config.json"))
            return load_train_config(run / "config.json", {}).data;
    fail<FileError>(
        model.string(),
        ": no config.json of its training run beside it to say how the data was split; give --ids ",
        "in place of --split");
}

}  // namespace stymo
