#pragma once

#include <cstdint>
#include <functional>
#include <limits>
#include <memory>
#include <string>
#include <variant>
#include <vector>

#include "apps/bench/subject.h"
#include "apps/common/tool_options.h"
#include "core/io/json_writer.h"

/// A study is data: what it varies, what it measures, and with what the results are compared. One
/// harness measures the rows of every study and writes them.
namespace stymo {

/// A cell of a table: nothing, a flag, a number or text.
using Value = std::variant<std::monostate, bool, std::int64_t, double, std::string>;
using Row = std::vector<Value>;

/// A column. Its key names its unit: "median_seconds", "psnr_db", "peak_bytes", "share_of_peak".
struct Column {
    // NOLINTNEXTLINE(google-explicit-constructor): lists of columns are lists of keys
    Column(const char* name) : key(name) {}

    std::string key;
    bool hidden = false;  ///< only in CSV and JSON
};
[[nodiscard]] Column hidden(const char* key);

struct Table {
    std::string name;
    std::vector<Column> columns;
    std::vector<Row> rows{};
    bool hidden = false;  ///< only in CSV and JSON
};

/// The cell in the column `key`. Throws ValueError for a column that does not exist.
[[nodiscard]] Value& cell(const std::vector<Column>& columns, Row& row, const std::string& key);
/// Its number; NaN if it has none.
[[nodiscard]] double number(const Table& table, const Row& row, const std::string& key);
/// The cell for people: times in s or ms, shares in percent, "equal" for an infinite PSNR, other
/// numbers with four significant digits, flags as "yes" and "no", nothing as "".
[[nodiscard]] std::string words(const Table& table, const Row& row, const std::string& key);

/// An aligned Markdown table with escaped vertical bars; empty if the table is hidden. This and the
/// next two throw ValueError for a row of another length than the columns.
[[nodiscard]] std::string markdown(const Table& table);
/// All columns as CSV (RFC 4180): cells with commas, quotes or line ends are quoted.
[[nodiscard]] std::string csv(const Table& table);
/// A list of objects, one for each row.
[[nodiscard]] JsonValue to_json(const Table& table);
[[nodiscard]] JsonValue to_json(const std::vector<Column>& columns, const Row& row);
/// Reads a row that `to_json` wrote; missing columns stay empty. Throws Error for anything but an
/// object.
[[nodiscard]] Row row_from_json(const std::vector<Column>& columns, const std::string& text);

/// "12.3", with this number of digits after the decimal point.
[[nodiscard]] std::string decimal(double value, int digits);
/// "0.02", with at most this number of significant digits.
[[nodiscard]] std::string significant(double value, int digits);
/// "45 %"
[[nodiscard]] std::string percent(double share);

/// The inputs of a study.
struct StudyInputs {
    BenchOptions bench;  ///< model and data may be empty
    /// The same for studies with many fitting steps, perhaps with a smaller model.
    BenchOptions fitting{};
    LpipsOptions lpips{};  ///< files of LPIPS for models that name none
    /// Time budget of the study on two cores. It measures less if it would take longer. Infinite:
    /// everything is measured as `bench` says.
    double seconds = std::numeric_limits<double>::infinity();
};

/// A row to be measured: the values that are varied, and a function that measures the other
/// columns.
struct StudyRow {
    Row varied;
    std::function<Row()> measure;
};

/// The rows of a study with these inputs. They own what they share.
struct StudyPlan {
    void add(Row varied, std::function<Row()> measure) {
        rows.push_back({std::move(varied), std::move(measure)});
    }

    std::vector<StudyRow> rows{};
    std::shared_ptr<Table> curves{};  ///< filled by the rows, for plots; may be null
    std::string setting{};            ///< a sentence on what was measured, for the page
};

struct Study {
    std::string part;  ///< the part of the report to which it belongs, a name in --parts
    std::string name;  ///< name of its table
    std::string title;
    std::string varied;     ///< what differs between the rows
    std::string measured;   ///< what is measured of each row
    std::string reference;  ///< with what it is compared
    std::vector<Column> columns;
    std::function<StudyPlan(const StudyInputs&)> plan;
    /// Another table, made of the study's; may be null.
    Table (*summary)(const Table&) = nullptr;
    double seconds = 0.0;  ///< StudyInputs::seconds in the report
    /// Needs a model with its photos; if none is given, a small one is trained.
    bool needs_model = false;
};

[[nodiscard]] Study rendering_study();  ///< error against frame time
[[nodiscard]] Study fitting_study();    ///< loss against time of fitting
[[nodiscard]] Study tuning_study();     ///< error against time of tuning
[[nodiscard]] Study training_study();   ///< loss against time of training
[[nodiscard]] Study step_study();       ///< what training in 16 bits and without samples does
[[nodiscard]] Study stability_study();  ///< float32 against float64 on extreme inputs
[[nodiscard]] Study cores_study();      ///< what more processors would give

/// The studies of the report, in its order; those of one part follow each other.
[[nodiscard]] std::vector<Study> report_studies();

/// A page in Markdown with its tables. Files: NAME.md, NAME.json (one object with all facts and
/// tables) and NAME_TABLE.csv for each table, from which scripts/plot_reports.py draws.
class Page {
public:
    /// `folder` must exist; if it is empty, no files are written.
    Page(std::string name, std::filesystem::path folder)
        : name_(std::move(name)), folder_(std::move(folder)) {}

    /// A paragraph.
    void text(const std::string& words);
    /// Throws ValueError for a row of another length than the columns.
    void add(const Table& table);
    /// Adds a member to NAME.json only.
    void fact(const std::string& key, const JsonValue& value) { result_.json.add(key, value); }
    /// Writes NAME.md and NAME.json and returns their contents.
    [[nodiscard]] AppResult finish() const;

private:
    std::string name_;
    std::filesystem::path folder_;
    AppResult result_;
};

/// Measures the rows of a study in turn, with progress on stderr, and adds its tables to the page.
/// Throws Error if the process is interrupted.
void run_study(Page& page, const Study& study, const StudyInputs& inputs);

}  // namespace stymo
