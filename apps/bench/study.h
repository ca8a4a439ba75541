#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "apps/bench/page.h"
#include "apps/bench/subject.h"
#include "apps/bench/table.h"
#include "apps/common/tool_options.h"

namespace stymo {

/// A row to be measured: the values that are varied, and a function that measures the other
/// columns.
struct StudyRow {
    Row varied;
    std::function<Row()> measure;
};
/// Measures the rows in turn, with progress on stderr. Throws Error if the process is interrupted.
[[nodiscard]] Table run_study(Table table, const std::vector<StudyRow>& rows);

/// The inputs of a study.
struct StudyInputs {
    BenchOptions bench;  ///< model and data may be empty
    /// The same for studies with many fitting steps, perhaps with a smaller model.
    BenchOptions fitting;
    LpipsOptions lpips{};  ///< files of LPIPS for models that name none
    std::uint64_t seed = 0;
    /// Time budget of the study on two cores. It measures less if it would take longer. Infinite:
    /// everything is measured as `bench` says.
    double seconds = 0.0;
};

/// One section of the report, or of the output of a command of stymo-bench.
struct Study {
    std::string name;  ///< name in --parts
    std::string title;
    double seconds = 0.0;  ///< default of StudyInputs::seconds
    /// Needs a model with its photos; if none is given, a small one is trained.
    bool needs_model = false;
    void (*write)(Page& page, const StudyInputs& inputs);
};

[[nodiscard]] Study quadrature_study();  ///< rules of integration along a ray
[[nodiscard]] Study rendering_study();   ///< error against frame time
[[nodiscard]] Study fitting_study();     ///< loss against time of fitting
[[nodiscard]] Study training_study();    ///< loss against time of training
[[nodiscard]] Study stability_study();   ///< float32 against float64 on extreme inputs
[[nodiscard]] Study omitted_study();     ///< what scenes and jobs leave out
[[nodiscard]] Study growth_study();      ///< time against work
[[nodiscard]] Study bias_study();        ///< what leaving out samples does to a fit

/// The studies of the report, in its order.
[[nodiscard]] std::vector<Study> report_studies();

}  // namespace stymo
