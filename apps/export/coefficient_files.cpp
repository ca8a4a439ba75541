#include "apps/export/coefficient_files.h"

#include <algorithm>
#include <cctype>
#include <charconv>
#include <cmath>
#include <nlohmann/json.hpp>
#include <sstream>

#include "core/error.h"
#include "core/io/file.h"
#include "core/io/json_check.h"

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
    return cells;
}

double coefficient(const std::string& text, const std::string& place) {
    double value = 0.0;
    const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
    constexpr double largest = 100.0;
    if (error != std::errc() || end != text.data() + text.size() || !(value >= 0.0) ||
        !(value <= largest))
        fail<FileError>(place, " is \"", text, "\", expected a number from 0 to ", largest);
    return value;
}

std::vector<ArkitCoefficients> read_csv(const std::string& path, const std::string& text) {
    std::istringstream lines(text);
    std::string line;
    std::getline(lines, line);
    const std::vector<std::string> header = cells_of(line);
    std::array<std::size_t, arkit_names.size()> columns{};
    for (std::size_t k = 0; k < columns.size(); ++k) {
        const std::string name = column_name(arkit_names[k]);
        const auto found = std::ranges::find(header, name);
        if (found == header.end())
            fail<FileError>(path, ": has no column ", name,
                            "; is it a CSV file of Live Link Face?");
        columns[k] = static_cast<std::size_t>(found - header.begin());
    }
    std::vector<ArkitCoefficients> rows;
    for (std::size_t number = 2; std::getline(lines, line); ++number) {
        if (line.empty() || line == "\r") continue;
        const std::vector<std::string> cells = cells_of(line);
        if (cells.size() != header.size())
            fail<FileError>(path, ": line ", number, " has ", cells.size(), " cells, the first ",
                            header.size());
        ArkitCoefficients& row = rows.emplace_back();
        for (std::size_t k = 0; k < columns.size(); ++k)
            row.push_back(coefficient(cells[columns[k]], path + ": line " + std::to_string(number) +
                                                             ": " + header[columns[k]]));
    }
    if (rows.empty()) fail<FileError>(path, ": holds no coefficients");
    return rows;
}

ArkitCoefficients read_json(const std::string& path, const std::string& text) {
    if (const auto fault = json_fault(text)) fail<FileError>(path, ": ", *fault);
    const nlohmann::json json = nlohmann::json::parse(text, nullptr, false);
    if (!json.is_object() || !json.contains("coefficients") || !json["coefficients"].is_object())
        fail<FileError>(path, ": has no \"coefficients\" of ARKit's shapes");
    ArkitCoefficients row(arkit_names.size(), 0.0);
    for (const auto& [name, value] : json["coefficients"].items()) {
        const auto found = std::ranges::find(arkit_names, name);
        if (found == arkit_names.end())
            fail<FileError>(path, ": \"", name, "\" is none of ARKit's shapes");
        row[static_cast<std::size_t>(found - arkit_names.begin())] =
            coefficient(value.dump(), path + ": \"" + name + "\"");
    }
    return row;
}

}  // namespace

std::vector<ArkitCoefficients> read_coefficients(const std::filesystem::path& path) {
    const std::string text = read_file(path);
    if (path.extension() == ".json") return {read_json(path.string(), text)};
    return read_csv(path.string(), text);
}

std::string live_link_csv(std::span<const ArkitCoefficients> rows) {
    std::ostringstream text;
    text << "Timecode,BlendShapeCount";
    for (const char* name : arkit_names) text << ',' << column_name(name);
    for (const char* name : rotations) text << ',' << name;
    text << '\n';
    for (std::size_t row = 0; row < rows.size(); ++row) {
        std::array<char, 32> time{};
        std::snprintf(time.data(), time.size(), "%02zu:%02zu:%02zu:%02zu.000", row / 216000 % 24,
                      row / 3600 % 60, row / 60 % 60, row % 60);
        text << time.data() << ',' << arkit_names.size() + rotations.size();
        for (const double value : rows[row]) text << ',' << value;
        for (std::size_t i = 0; i < rotations.size(); ++i) text << ",0";
        text << '\n';
    }
    return text.str();
}

}  // namespace stymo
