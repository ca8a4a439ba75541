#include "apps/common/coefficient_files.h"

#include <algorithm>
#include <cctype>
#include <charconv>
#include <nlohmann/json.hpp>
#include <numbers>
#include <sstream>

#include "core/error.h"
#include "core/exact_text.h"
#include "core/io/file.h"
#include "core/io/json_check.h"
#include "render/camera.h"
#include "render/morphable/head_source.h"

namespace stymo {

namespace {

constexpr std::array<const char*, 9> rotations{"HeadYaw",     "HeadPitch",     "HeadRoll",
                                               "LeftEyeYaw",  "LeftEyePitch",  "LeftEyeRoll",
                                               "RightEyeYaw", "RightEyePitch", "RightEyeRoll"};

std::string column_name(std::string name) {
    name[0] = static_cast<char>(std::toupper(static_cast<unsigned char>(name[0])));
    return name;
}

std::vector<std::string> cells_of(std::string line) {
    if (line.ends_with('\r')) line.pop_back();
    std::vector<std::string> cells;
    std::istringstream stream(line);
    for (std::string cell; std::getline(stream, cell, ',');) cells.push_back(cell);
    if (line.ends_with(',')) cells.emplace_back();
    return cells;
}

double number(const std::string& text, double low, double high, const std::string& cell_name) {
    double value = 0.0;
    const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
    if (error != std::errc() || end != text.data() + text.size() || !(value >= low) ||
        !(value <= high))
        fail<FileError>(cell_name, " is \"", text, "\", expected a number from ", low, " to ",
                        high);
    return value;
}

double coefficient(const std::string& text, const std::string& cell_name) {
    // Calibrated recordings go a little below 0.
    return std::max(number(text, -1.0, 100.0, cell_name), 0.0);
}

/// From the angles of a head to those of the camera that sees it so, and back. ARKit's pitch is
/// upwards.
Eigen::Vector3d seen_from(const Eigen::Vector3d& angles) {
    return angles_from_rotation(rotation_from_angles(angles[0], angles[1], angles[2]).transpose());
}
Eigen::Vector3d upward(const Eigen::Vector3d& angles) {
    return {angles[0], -angles[1], angles[2]};
}

std::vector<ArkitMoment> read_csv(const std::string& path, const std::string& text) {
    std::istringstream lines(text);
    std::string line;
    std::getline(lines, line);
    const std::vector<std::string> header = cells_of(line);
    for (auto name = header.begin(); name != header.end(); ++name)
        if (std::find(header.begin(), name, *name) != name)
            fail<FileError>(path, ": has two columns ", *name);
    const auto column = [&](const std::string& name) {
        return static_cast<std::size_t>(std::ranges::find(header, name) - header.begin());
    };
    std::array<std::size_t, arkit_names.size()> columns{};
    for (std::size_t k = 0; k < columns.size(); ++k) {
        columns[k] = column(column_name(arkit_names[k]));
        if (columns[k] == header.size())
            fail<FileError>(path, ": has no column ", column_name(arkit_names[k]),
                            "; is it a CSV file of Live Link Face?");
    }
    const std::size_t count = column("BlendShapeCount");
    std::vector<ArkitMoment> rows;
    for (std::size_t index = 2; std::getline(lines, line); ++index) {
        if (line.empty() || line == "\r") continue;
        const std::vector<std::string> cells = cells_of(line);
        if (cells.size() == 2 && count == 1 && cells[count] == "0") {
            rows.push_back(rows.empty() ? ArkitMoment{std::vector<double>(columns.size())}
                                        : rows.back());
            continue;
        }
        if (cells.size() != header.size())
            fail<FileError>(path, ": line ", index, " has ", cells.size(), " cells, the first ",
                            header.size());
        const auto cell_name = [&](std::size_t at) {
            return path + ": line " + std::to_string(index) + ": " + header[at];
        };
        ArkitMoment& row = rows.emplace_back();
        for (const std::size_t at : columns)
            row.coefficients.push_back(coefficient(cells[at], cell_name(at)));
        Eigen::Vector3d head = Eigen::Vector3d::Zero();
        for (std::size_t k = 0; k < 3; ++k) {
            constexpr double half_turn = std::numbers::pi;
            const std::size_t at = column(rotations[k]);
            if (at < header.size())
                head[static_cast<Eigen::Index>(k)] =
                    number(cells[at], -half_turn, half_turn, cell_name(at));
        }
        row.view = seen_from(upward(head));
    }
    if (rows.empty()) fail<FileError>(path, ": holds no coefficients");
    return rows;
}

ArkitMoment read_json(const std::string& path, const std::string& text) {
    if (const auto fault = json_fault(text)) fail<FileError>(path, ": ", *fault);
    const nlohmann::json json = nlohmann::json::parse(text, nullptr, false);
    if (!json.is_object() || !json.contains("coefficients") || !json["coefficients"].is_object())
        fail<FileError>(path, ": has no \"coefficients\" of ARKit's shapes");
    ArkitMoment moment{std::vector<double>(arkit_names.size())};
    for (const auto& [name, value] : json["coefficients"].items()) {
        const auto found = std::ranges::find(arkit_names, name);
        if (found == arkit_names.end())
            fail<FileError>(path, ": \"", name, "\" is none of ARKit's shapes");
        moment.coefficients[static_cast<std::size_t>(found - arkit_names.begin())] =
            coefficient(value.dump(), path + ": \"" + name + "\"");
    }
    return moment;
}

}  // namespace

ArkitConversion arkit_conversion(const std::filesystem::path& morphable) {
    const MorphableHead head = morphable_head_from(morphable);
    if (head.expression_names.empty())
        fail<Error>(morphable.string(),
                    ": does not name its expressions, so ARKit's shapes are not known; add the "
                    "metadata \"expr_names\"");
    return ArkitConversion(head);
}

std::vector<ArkitMoment> read_coefficients(const std::filesystem::path& path) {
    const std::string text = read_file(path);
    if (path.extension() == ".json") return {read_json(path.string(), text)};
    return read_csv(path.string(), text);
}

std::string live_link_csv(const ArkitMoment& moment) {
    std::string text = "Timecode,BlendShapeCount";
    for (const char* name : arkit_names) text += "," + column_name(name);
    for (const char* name : rotations) text += std::string(",") + name;
    text += "\n00:00:00:00.000," + exact_text(arkit_names.size() + rotations.size());
    for (const double value : moment.coefficients) text += "," + exact_text(value);
    for (const double angle : upward(seen_from(moment.view))) text += "," + exact_text(angle + 0.0);
    for (std::size_t i = 3; i < rotations.size(); ++i) text += ",0";
    return text + "\n";
}

}  // namespace stymo
