#pragma once

#include <functional>
#include <limits>
#include <memory>
#include <string>
#include <vector>

#include "apps/bench/subject.h"
#include "apps/bench/table.h"
#include "apps/common/tool_options.h"

/// A study is data: what it varies, what it measures, and with what the results are compared. One
/// harness measures the rows of every study and writes them.
namespace stymo {

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

[[nodiscard]] Study quadrature_study();  ///< rules of integration along a ray
[[nodiscard]] Study euler_study();       ///< what the exponential form is needed for
[[nodiscard]] Study rendering_study();   ///< error against frame time
[[nodiscard]] Study fitting_study();     ///< loss against time of fitting
[[nodiscard]] Study tuning_study();      ///< error against time of tuning
[[nodiscard]] Study training_study();    ///< loss against time of training
[[nodiscard]] Study step_study();        ///< what training in 16 bits and without samples does
[[nodiscard]] Study stability_study();   ///< float32 against float64 on extreme inputs
[[nodiscard]] Study scenes_study();      ///< what frames of scenes leave out
[[nodiscard]] Study jobs_study();        ///< what jobs leave out
[[nodiscard]] Study growth_study();      ///< time against work
[[nodiscard]] Study cores_study();       ///< what more processors would give
[[nodiscard]] Study bias_study();        ///< what leaving out samples does to a fit

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
