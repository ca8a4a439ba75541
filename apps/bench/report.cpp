#include "apps/bench/report.h"

#include <algorithm>
#include <cmath>
#include <iomanip>
#include <nlohmann/json.hpp>
#include <sstream>

#include "core/error.h"
#include "core/parallel.h"

namespace stymo {

namespace {

JsonValue json_of(const std::optional<double>& value) {
    return value ? JsonValue(*value) : JsonValue();
}

std::string full(double value) {
    return JsonValue(value).text();
}
std::string full(const std::optional<double>& value) {
    return value ? full(*value) : "";
}

/// Infinite where the pictures are equal.
std::string decibels(const std::optional<double>& value) {
    if (!value) return "";
    return std::isfinite(*value) ? decimal(*value, 1) : "equal";
}

std::optional<double> number_or_none(const nlohmann::json& object, const char* key) {
    const nlohmann::json& value = object.at(key);
    return value.is_null() ? std::nullopt : std::optional(value.get<double>());
}

std::string milliseconds(double seconds) {
    const double value = seconds * 1e3;
    return decimal(value, value < 100.0 ? 2 : value < 1000.0 ? 1 : 0);
}

std::optional<double> share_of_peak(const Measurement& measurement) {
    if (measurement.limit == Limit::none || measurement.work <= 0.0) return std::nullopt;
    double flops = measurement.timing.median_multiply_adds();
    if (measurement.limit == Limit::sixteen_bits) {
        const kernels::MachinePeak peak = kernels::measure_machine_peak();
        flops *= std::max(peak.bfloat16_multiply_adds, peak.float16_multiply_adds) / peak.multiply_adds;
    }
    if (flops <= 0.0) return std::nullopt;
    return 2.0 * measurement.work / measurement.timing.median() / flops;
}

}  // namespace

std::string decimal(double value, int digits) {
    std::ostringstream text;
    text << std::fixed << std::setprecision(digits) << value;
    return text.str();
}

JsonValue to_json(const BenchRow& row) {
    JsonValue json = JsonValue::object({{"name", row.name},
                                        {"what", row.what},
                                        {"threads", row.threads},
                                        {"median_seconds", row.median_seconds},
                                        {"minimum_seconds", row.minimum_seconds},
                                        {"share_of_peak", json_of(row.share_of_peak)},
                                        // null: no errors were measured, or there are none
                                        {"psnr_mean_db", json_of(row.psnr_mean)},
                                        {"psnr_worst_db", json_of(row.psnr_worst)},
                                        {"equal_pictures", row.psnr_worst && std::isinf(*row.psnr_worst)},
                                        {"peak_memory_mebibytes", row.peak_memory},
                                        {"remark", row.remark}});
    if (row.peer) {
        json.add("peer_median_seconds", row.peer->seconds);
        json.add("peer_peak_memory_mebibytes", row.peer->peak_memory);
        json.add("times_peer", row.peer->seconds / row.median_seconds);
    }
    return json;
}

BenchRow row_from_json(const std::string& text) {
    try {
        const nlohmann::json json = nlohmann::json::parse(text);
        BenchRow row{.name = json.at("name").get<std::string>(), .what = json.at("what").get<std::string>()};
        row.threads = json.at("threads").get<int>();
        row.median_seconds = json.at("median_seconds").get<double>();
        row.minimum_seconds = json.at("minimum_seconds").get<double>();
        row.share_of_peak = number_or_none(json, "share_of_peak");
        row.psnr_mean = number_or_none(json, "psnr_mean_db");
        row.psnr_worst = number_or_none(json, "psnr_worst_db");
        if (json.at("equal_pictures").get<bool>()) row.psnr_mean = row.psnr_worst = INFINITY;
        row.peak_memory = json.at("peak_memory_mebibytes").get<double>();
        row.remark = json.at("remark").get<std::string>();
        return row;
    } catch (const nlohmann::json::exception& error) {
        fail<Error>("a row's result cannot be read: ", error.what());
    }
}

BenchRow measure_row(const BenchCase& bench_case, const BenchRun& run) {
    const Measurement measurement = bench_case.measure(run);
    return {.name = bench_case.name,
            .what = bench_case.what,
            .threads = thread_count(),
            .median_seconds = measurement.timing.median(),
            .minimum_seconds = measurement.timing.minimum(),
            .share_of_peak = share_of_peak(measurement),
            .psnr_mean = measurement.psnr_mean,
            .psnr_worst = measurement.psnr_worst,
            .peak_memory = measurement.peak_memory,
            .remark = measurement.remark};
}

Cells cells(const std::vector<BenchRow>& rows) {
    Cells result{{"row", "what", "ms", "a second", "of the peak", "peer ms", "times peer", "PSNR dB", "worst", "MiB", "remark"}};
    for (const BenchRow& row : rows) {
        result.push_back({"`" + row.name + "`", row.what, milliseconds(row.median_seconds),
                          decimal(1.0 / row.median_seconds, row.median_seconds < 0.1 ? 1 : 2),
                          row.share_of_peak ? decimal(100.0 * *row.share_of_peak, 0) + " %" : "",
                          row.peer ? milliseconds(row.peer->seconds) : "",
                          row.peer ? decimal(row.peer->seconds / row.median_seconds, 1) : "", decibels(row.psnr_mean),
                          decibels(row.psnr_worst), decimal(row.peak_memory, 0), row.remark});
    }
    return result;
}

Cells full_cells(const std::vector<BenchRow>& rows) {
    Cells result{{"name", "threads", "median_seconds", "minimum_seconds", "share_of_peak", "peer_median_seconds", "psnr_mean_db",
                  "psnr_worst_db", "peak_memory_mebibytes", "peer_peak_memory_mebibytes"}};
    for (const BenchRow& row : rows) {
        result.push_back({row.name, std::to_string(row.threads), full(row.median_seconds), full(row.minimum_seconds),
                          full(row.share_of_peak), row.peer ? full(row.peer->seconds) : "", full(row.psnr_mean),
                          full(row.psnr_worst), full(row.peak_memory), row.peer ? full(row.peer->peak_memory) : ""});
    }
    return result;
}

std::string markdown(const Cells& cells) {
    std::vector<std::size_t> widths(cells.front().size(), 3);
    for (const auto& row : cells)
        for (std::size_t i = 0; i < row.size(); ++i) widths[i] = std::max(widths[i], row[i].size());
    std::ostringstream table;
    const auto write = [&](const std::vector<std::string>& row) {
        table << "|";
        for (std::size_t i = 0; i < row.size(); ++i)
            table << " " << std::left << std::setw(static_cast<int>(widths[i])) << row[i] << " |";
        table << "\n";
    };
    write(cells.front());
    table << "|";
    for (const std::size_t width : widths) table << std::string(width + 2, '-') << "|";
    table << "\n";
    for (std::size_t i = 1; i < cells.size(); ++i) write(cells[i]);
    return table.str();
}

std::string csv(const Cells& cells) {
    std::string result;
    for (const auto& row : cells) {
        for (std::size_t i = 0; i < row.size(); ++i) result += (i > 0 ? "," : "") + row[i];
        result += "\n";
    }
    return result;
}

JsonValue to_json(const kernels::MachinePeak& peak) {
    return JsonValue::object({{"float32_flops", peak.multiply_adds},
                              {"bfloat16_flops", peak.bfloat16_multiply_adds},
                              {"float16_flops", peak.float16_multiply_adds},
                              {"triad_bytes_per_second", peak.triad_bytes}});
}

std::string text(const kernels::MachinePeak& peak) {
    return "peak: " + decimal(peak.multiply_adds / 1e9, 0) + " GFLOP/s float32, " +
           (peak.bfloat16_multiply_adds > 0.0 ? decimal(peak.bfloat16_multiply_adds / 1e9, 0) + " GFLOP/s bfloat16, " : "") +
           (peak.float16_multiply_adds > 0.0 ? decimal(peak.float16_multiply_adds / 1e9, 0) + " GFLOP/s float16, " : "") +
           decimal(peak.triad_bytes / 1e9, 1) + " GB/s\n";
}

}  // namespace stymo
