#include "apps/eval/score.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <iomanip>
#include <nlohmann/json.hpp>
#include <sstream>

#include "core/error.h"
#include "core/io/file.h"
#include "core/io/json_check.h"
#include "nn/models/code_file.h"
#include "nn/realtime/view.h"

namespace stymo {

namespace {

using Json = nlohmann::json;

double number_or_infinity(const Json& value) {
    return value.is_null() ? std::numeric_limits<double>::infinity() : value.get<double>();
}

ImageMetrics parse_metrics(const Json& value) {
    ImageMetrics metrics{value.at("l1").get<double>(), value.at("l1_mean").get<double>(),
                         value.at("ssim").get<double>(), number_or_infinity(value.at("psnr"))};
    if (value.contains("lpips")) metrics.lpips = value["lpips"].get<double>();
    return metrics;
}

constexpr std::array fit_stages{FitStage::initial, FitStage::fitted, FitStage::tuned};

/// What is measured of a face as a whole: its members of FaceScore with their names, and its
/// numbers with theirs.
template <class Score>
struct Measured;

template <>
struct Measured<IdentityScore> {
    static constexpr std::array members{std::pair{"identity", &FaceScore::identity},
                                        std::pair{"tuned_identity", &FaceScore::tuned_identity}};
    static constexpr std::array numbers{std::pair{"photo", &IdentityScore::photo},
                                        std::pair{"turned_15", &IdentityScore::turned_15},
                                        std::pair{"turned_30", &IdentityScore::turned_30},
                                        std::pair{"other", &IdentityScore::other}};
};

template <>
struct Measured<ShapeScore> {
    static constexpr std::array members{std::pair{"shape", &FaceScore::shape},
                                        std::pair{"tuned_shape", &FaceScore::tuned_shape}};
    static constexpr std::array numbers{std::pair{"landmarks_30", &ShapeScore::landmarks_30},
                                        std::pair{"found_30", &ShapeScore::found_30},
                                        std::pair{"depth", &ShapeScore::depth}};
};

template <class Score>
JsonValue json_of(const Score& score) {
    JsonValue json = JsonValue::object();
    for (const auto& [name, number] : Measured<Score>::numbers) json.add(name, score.*number);
    return json;
}

template <class Score>
void add_json(const FaceScore& score, JsonValue& json) {
    for (const auto& [name, member] : Measured<Score>::members)
        if (score.*member) json.add(name, json_of(*(score.*member)));
}

template <class Score>
void parse_measured(const Json& value, FaceScore& score) {
    for (const auto& [name, member] : Measured<Score>::members) {
        if (!value.contains(name)) continue;
        Score& read = (score.*member).emplace();
        for (const auto& [number_name, number] : Measured<Score>::numbers)
            read.*number = number_or_infinity(value[name].at(number_name));
    }
}

/// Each number over the faces where it was measured; nothing if there are none.
template <class Score>
std::optional<Score> mean_of(const std::vector<FaceScore>& scores,
                             std::optional<Score> FaceScore::*member) {
    if (std::ranges::none_of(scores, [&](const FaceScore& score) { return !!(score.*member); }))
        return std::nullopt;
    Score mean;
    for (const auto& [name, number] : Measured<Score>::numbers) {
        double sum = 0.0, count = 0.0;
        for (const FaceScore& score : scores) {
            if (!(score.*member) || !std::isfinite(*(score.*member).*number)) continue;
            sum += *(score.*member).*number;
            ++count;
        }
        mean.*number = count > 0.0 ? sum / count : std::numeric_limits<double>::infinity();
    }
    return mean;
}

template <class Score>
void add_means(const std::vector<FaceScore>& scores, JsonValue& json) {
    for (const auto& [name, member] : Measured<Score>::members)
        if (const std::optional<Score> mean = mean_of(scores, member))
            json.add(name, json_of(*mean));
}

/// {"head": {"initial": ..., "fitted": ...}, ...} of the rows that are means or of those that are
/// medians.
JsonValue rows_json(const std::vector<SummaryRow>& rows, bool median) {
    JsonValue regions = JsonValue::object();
    for (const Region region : {Region::head, Region::face}) {
        JsonValue stages = JsonValue::object();
        bool any = false;
        for (const SummaryRow& row : rows) {
            if (row.region != region || row.median != median) continue;
            stages.add(name_of(row.stage), to_json(row.metrics));
            any = true;
        }
        if (any) regions.add(name_of(region), stages);
    }
    return regions;
}

}  // namespace

const char* name_of(Region region) {
    return region == Region::head ? "head" : "face";
}

const char* name_of(FitStage stage) {
    switch (stage) {
        case FitStage::initial: return "initial";
        case FitStage::fitted: return "fitted";
        case FitStage::tuned: return "tuned";
    }
    return "";
}

const ImageMetrics* RegionScore::of(FitStage stage) const {
    if (stage == FitStage::initial) return &initial;
    const std::optional<ImageMetrics>& metrics = stage == FitStage::fitted ? fitted : tuned;
    return metrics ? &*metrics : nullptr;
}

std::vector<Region> regions_called(std::string_view text) {
    if (text == "both") return {Region::head, Region::face};
    for (const Region region : {Region::head, Region::face})
        if (text == name_of(region)) return {region};
    fail<ValueError>("no region is called ", text, "; give head, face or both");
}

JsonValue to_json(const FaceScore& score) {
    JsonValue json = JsonValue::object({{"id", score.id}});
    for (const RegionScore& region : score.regions) {
        JsonValue stages = JsonValue::object();
        for (const FitStage stage : fit_stages)
            if (const ImageMetrics* metrics = region.of(stage))
                stages.add(name_of(stage), to_json(*metrics));
        json.add(name_of(region.region), stages);
    }
    json.add("counting_samples", score.counting_samples);
    add_json<IdentityScore>(score, json);
    add_json<ShapeScore>(score, json);
    return json;
}

FaceScore parse_face_score(std::string_view line) {
    try {
        require_sound_json(line);
        const Json value = Json::parse(line);
        FaceScore score{
            value.at("id").get<std::string>(), {}, value.at("counting_samples").get<double>()};
        for (const Region region : {Region::head, Region::face}) {
            if (!value.contains(name_of(region))) continue;
            const Json& stages = value[name_of(region)];
            RegionScore& added = score.regions.emplace_back(
                RegionScore{region, parse_metrics(stages.at("initial"))});
            if (stages.contains("fitted")) added.fitted = parse_metrics(stages["fitted"]);
            if (stages.contains("tuned")) added.tuned = parse_metrics(stages["tuned"]);
        }
        parse_measured<IdentityScore>(value, score);
        parse_measured<ShapeScore>(value, score);
        if (score.regions.empty()) fail<FileError>("no region");
        return score;
    } catch (const Json::exception&) {
        fail<FileError>("not the score of a face");
    }
}

std::vector<SummaryRow> summary(const std::vector<FaceScore>& scores) {
    std::vector<SummaryRow> rows;
    const std::size_t regions = scores.empty() ? 0 : scores.front().regions.size();
    for (std::size_t k = 0; k < regions; ++k) {
        const Region region = scores.front().regions[k].region;
        for (const FitStage stage : fit_stages) {
            std::vector<ImageMetrics> all;
            for (const FaceScore& score : scores)
                if (const ImageMetrics* metrics = score.regions.at(k).of(stage))
                    all.push_back(*metrics);
            if (all.empty()) continue;
            rows.push_back({region, stage, false, mean(all)});
            rows.push_back({region, stage, true, median(all)});
        }
    }
    return rows;
}

double mean_counting_samples(const std::vector<FaceScore>& scores) {
    double sum = 0.0;
    for (const FaceScore& score : scores) sum += score.counting_samples;
    return scores.empty() ? 0.0 : sum / static_cast<double>(scores.size());
}

Table summary_table(const std::vector<FaceScore>& scores) {
    const std::vector<SummaryRow> rows = summary(scores);
    const bool lpips = std::ranges::any_of(
        rows, [](const SummaryRow& row) { return row.metrics.lpips.has_value(); });
    Table table{"scores",
                {"region", "codes", "of all", "L1 (sum over RGB)", "L1 (mean)",
                 lpips ? "LPIPS" : "~LPIPS", "SSIM", "PSNR dB"}};
    for (const auto& [region, stage, is_median, metrics] : rows)
        table.rows.push_back({name_of(region), name_of(stage), is_median ? "median" : "mean",
                              decimal(metrics.l1, 4), decimal(metrics.l1_mean, 4),
                              decimal(metrics.lpips.value_or(0.0), 4), decimal(metrics.ssim, 4),
                              decimal(metrics.psnr, 2)});
    return table;
}

std::string summary_text(const std::vector<FaceScore>& scores) {
    std::ostringstream text;
    text << scores.size() << (scores.size() == 1 ? " face\n" : " faces\n")
         << markdown(summary_table(scores)) << std::fixed << std::setprecision(1)
         << 100.0 * mean_counting_samples(scores)
         << " % of the samples are significant (weight above " << std::defaultfloat
         << significant_weight << ")\n";
    for (const auto& [name, member] : Measured<IdentityScore>::members) {
        const std::optional<IdentityScore> identity = mean_of(scores, member);
        if (!identity) continue;
        text << std::fixed << std::setprecision(3) << "cosine of embeddings"
             << (member == &FaceScore::tuned_identity ? ", tuned" : "") << ": photo and face "
             << identity->photo << ", face turned by 15 degrees " << identity->turned_15
             << ", by 30 degrees " << identity->turned_30;
        if (std::isfinite(identity->other)) text << ", photos of two people " << identity->other;
        text << '\n';
    }
    for (const auto& [name, member] : Measured<ShapeScore>::members) {
        const std::optional<ShapeScore> shape = mean_of(scores, member);
        if (!shape) continue;
        text << std::fixed << std::setprecision(3) << "in distances of the eyes"
             << (member == &FaceScore::tuned_shape ? ", tuned" : "")
             << ": landmarks at 30 degrees off by " << shape->landmarks_30 << " (found in "
             << std::setprecision(0) << 100.0 * shape->found_30 << " % of the views), depth off by "
             << std::setprecision(3) << shape->depth << '\n';
    }
    return text.str();
}

JsonValue summary_json(const std::vector<FaceScore>& scores,
                       const std::vector<FailedFace>& failed) {
    const std::vector<SummaryRow> rows = summary(scores);
    std::vector<JsonValue> failures;
    for (const FailedFace& face : failed)
        failures.push_back(JsonValue::object({{"id", face.id}, {"reason", face.reason}}));
    JsonValue json = JsonValue::object({{"count", scores.size()},
                                        {"mean", rows_json(rows, false)},
                                        {"median", rows_json(rows, true)},
                                        {"counting_samples", mean_counting_samples(scores)}});
    add_means<IdentityScore>(scores, json);
    add_means<ShapeScore>(scores, json);
    return json.add("failed", failures);
}

std::filesystem::path ScoreFolder::tuned_of(const std::string& id) const {
    const std::filesystem::path file = results_.path() / "tuned" / (id + ".safetensors");
    require_writable_folder(file.parent_path());
    return file;
}

void ScoreFolder::add(const FaceScore& score, const FitResult& fit) {
    if (score.regions.front().fitted) {
        require_writable_folder(codes_of(score.id).parent_path());
        write_code_file(codes_of(score.id), fit.fitted, 0, pose_from_camera(fit.cameras.front()),
                        mark_);
    }
    // Written after the codes, so that the codes of every line exist.
    results_.append(to_json(score));
}

}  // namespace stymo
