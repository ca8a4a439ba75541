#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <limits>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "apps/bench/subject.h"
#include "apps/common/table.h"
#include "apps/common/tool_options.h"
#include "core/machine_limits.h"
#include "core/matmul_precision.h"
#include "train/data/dataset.h"
#include "train/train_config.h"
#include "train/trainer.h"

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

[[nodiscard]] Study rendering_study();  ///< error against frame time
[[nodiscard]] Study fitting_study();    ///< loss against time of fitting
[[nodiscard]] Study tuning_study();     ///< error against time of tuning
[[nodiscard]] Study training_study();   ///< loss against time of training
[[nodiscard]] Study step_study();       ///< what training in 16 bits and without samples does
[[nodiscard]] Study cores_study();      ///< what more processors would give

/// The studies of the report, in its order; those of one part follow each other.
[[nodiscard]] std::vector<Study> report_studies();

/// Steps of the first stage of an embedded configuration ("celeba-128"): its batch, encoder with
/// backbone, LPIPS, optimiser, EMA. The weights of backbone and LPIPS are random ones, which does
/// not change the time.
struct TrainingSteps {
    TrainingSteps(const std::string& configuration, std::uint64_t seed);

    TrainConfig config;
    Dataset faces;
    Trainer trainer;
};

/// The configuration demo-64, which the program contains, with these numbers of steps and samples
/// and without EMA.
[[nodiscard]] TrainConfig small_training(std::int64_t steps, std::int64_t samples_per_ray);
/// Writes synthetic heads and a model that is trained on them for less than a minute into an empty
/// folder, and makes them the data and the model of `bench`.
void train_small_subject(const std::filesystem::path& folder, BenchOptions& bench);

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
    /// Writes NAME.md, NAME.json and the tables, and returns the contents of the first two.
    [[nodiscard]] AppResult finish() const;

private:
    std::string name_;
    std::filesystem::path folder_;
    std::vector<std::pair<std::string, std::string>> files_;  ///< names and contents of tables
    AppResult result_;
};

/// Measures the rows of a study in turn, with progress on stderr, and adds its tables to the page.
/// Throws Error if the process is interrupted.
void run_study(Page& page, const Study& study, const StudyInputs& inputs);

// The table of speeds is a study, whose rows other programs can ask for one by one.

/// The peak performance with which a row is compared.
enum class Limit { none, float32, bfloat16 };
/// That of products of this precision.
[[nodiscard]] Limit limit_of(MatmulPrecision precision);

struct Measurement {
    Timing timing;      ///< of one frame, step, ...
    double work = 0.0;  ///< multiply-adds done in that time; 0: not counted
    Limit limit = Limit::float32;
    std::string remark{};
    /// MiB, of a process that does nothing else. Taken before errors are measured.
    double peak_memory = process_memory("VmHWM:") / 1048576.0;
    std::optional<ImageError> error{};  ///< against the exact frames
};

/// One row of the table of speeds.
struct SpeedRow {
    std::string name;
    std::string command;  ///< command of stymo-bench that measures it
    std::string what;
    std::function<Measurement(const BenchOptions&)> measure;
    std::string peer{};  ///< name of the peer's measurement; empty: the peer has none
    int threads = 0;     ///< 0: the number of the command line
};

/// `measure` with these arguments after the options.
[[nodiscard]] auto with(auto measure, auto... arguments) {
    return [=](const BenchOptions& options) { return measure(options, arguments...); };
}

/// The rows of a command ("all": of all commands), in the order of the table.
[[nodiscard]] std::vector<SpeedRow> speed_rows(const std::string& command = "all");
// Its parts.
[[nodiscard]] std::vector<SpeedRow> frame_rows();
[[nodiscard]] std::vector<SpeedRow> step_rows();
[[nodiscard]] std::vector<SpeedRow> training_rows();
[[nodiscard]] std::vector<SpeedRow> kernel_rows();

/// The program that does the same work in PyTorch.
struct PeerProgram {
    std::filesystem::path script;  ///< scripts/torch_peer.py; empty: none
    /// Python for which Debian's PyTorch is built.
    std::filesystem::path python = "/usr/bin/python3";
};
/// Why there is no peer: no script, or no PyTorch in that Python. Empty if there is one. Throws
/// FileError for a script that does not exist.
[[nodiscard]] std::string missing_peer(const PeerProgram& program);

/// The study of a command's rows ("all": of all commands). Each row is measured in a separate
/// process, so that its peak memory is known, and the peer directly after it, unless `program` has
/// no script. `decoder` is the configuration that the peer reproduces.
[[nodiscard]] Study speed_study(const std::string& command, const PeerProgram& program,
                                const DecoderConfig& decoder);
/// Measures the row with this name in this process, without the peer. Throws UsageError for an
/// unknown name.
[[nodiscard]] AppResult bench_row(const std::string& name, const BenchOptions& options);
/// Names of all rows with the command of each.
[[nodiscard]] AppResult bench_row_names();

}  // namespace stymo
