#pragma once

#include <concepts>
#include <cstdint>
#include <filesystem>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "apps/bench/subject.h"
#include "apps/common/lpips_options.h"
#include "core/io/json_writer.h"
#include "core/io/svg_plot.h"

namespace stymo {

/// A cell of a table: text for people, and the value at full precision for programs.
struct ReportCell {
    // NOLINTBEGIN(google-explicit-constructor): a row is a list of numbers and words.
    ReportCell(std::string words) : text(std::move(words)), value(text) {}
    ReportCell(const char* words) : ReportCell(std::string(words)) {}
    ReportCell(double number);  ///< three significant digits
    ReportCell(std::integral auto number) : text(JsonValue(number).text()), value(number) {}
    // NOLINTEND(google-explicit-constructor)
    ReportCell(std::string words, JsonValue number) : text(std::move(words)), value(std::move(number)) {}

    std::string text;
    JsonValue value;
};

/// The page report.md, in Markdown, and the files beside it. Names of tables and plots are those of their files, without
/// extension; each may come once in the whole report, else ValueError.
class ReportWriter {
public:
    /// `folder` exists.
    explicit ReportWriter(std::filesystem::path folder) : folder_(std::move(folder)) {}

    /// Within a section; the section's own title is written by who calls it.
    void heading(const std::string& words);
    /// A paragraph.
    void text(const std::string& words);
    /// Also as NAME.csv and as NAME.json, a list of objects with the columns as keys. Throws ValueError for a row of another
    /// length than `columns`.
    void table(const std::string& name, const std::vector<std::string>& columns,
               const std::vector<std::vector<ReportCell>>& rows);
    /// Only NAME.csv and NAME.json with a link to them: for what is too long to read.
    void data(const std::string& name, const std::vector<std::string>& columns, const std::vector<std::vector<ReportCell>>& rows);
    /// NAME.svg. Throws what `to_svg` throws.
    void plot(const std::string& name, const Plot& plot);
    /// A title of the page (level 1) or of a section (level 2).
    void title(int level, const std::string& words);
    /// Writes report.md.
    void finish() const;

private:
    void claim(const std::string& name);

    std::filesystem::path folder_;
    std::string page_;
    std::set<std::string> names_;
};

/// What a section starts from.
struct ReportInputs {
    BenchOptions bench;    ///< model and data may be empty, except in sections that need a model
    BenchOptions fitting;  ///< the same for what takes many steps: another model, perhaps a smaller one
    LpipsOptions lpips;    ///< files for models that name none
    std::uint64_t seed = 0;
    double seconds = 0.0;  ///< what the section may take, on two cores; to be kept by doing less, not by breaking off
};

/// One part of the report. `apps/bench/report/NAME.h` declares `ReportSection NAME_section()`, which sections.cpp lists.
struct ReportSection {
    std::string name;  ///< of --parts
    std::string title;
    double seconds = 0.0;      ///< what it may take
    bool needs_model = false;  ///< with its photos; a small one is trained where none is given
    void (*write)(ReportWriter& report, const ReportInputs& inputs);
};

/// Every section, in the order of the report.
[[nodiscard]] std::vector<ReportSection> report_sections();

}  // namespace stymo
