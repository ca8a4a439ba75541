#pragma once

#include <filesystem>
#include <optional>
#include <string>

#include "apps/common/command_line.h"
#include "fit/edit/color_edit.h"

namespace stymo {

struct ColorOptions {
    std::filesystem::path model;
    std::filesystem::path codes;
    std::filesystem::path parser;
    std::filesystem::path out;
    std::string part;
    std::string color;
    std::string term = "mean";
    std::optional<std::int64_t> samples;
    ColorEditOptions edit;
};

/// `stymo-edit color`; `options` outlives the line.
void declare_color(CommandLine& line, ColorOptions& options);

}  // namespace stymo
