#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "apps/bench/page.h"
#include "apps/bench/subject.h"
#include "apps/bench/table.h"
#include "apps/common/lpips_options.h"

namespace stymo {

/// A row to be measured: what is varied, and the measurement, which gives the other columns.
struct StudyRow {
    Row varied;
    std::function<Row()> measure;
};
/// Measures the rows in turn, with progress on stderr. Throws Error if the process is asked to
/// stop.
[[nodiscard]] Table run_study(Table table, const std::vector<StudyRow>& rows);

/// What a study starts from.
struct StudyInputs {
    BenchOptions bench;    ///< model and data may be empty
    BenchOptions fitting;  ///< the same for studies of many fitting steps: perhaps a smaller model
    LpipsOptions lpips{};  ///< files for models that name none
    std::uint64_t seed = 0;
    /// What the study may take on two cores. It measures less where it would take longer.
    /// Infinite: everything is measured as `bench` says.
    double seconds = 0.0;
};

/// One subject of the report, or of a command of stymo-bench.
struct Study {
    std::string name;  ///< in --parts
    std::string title;
    double seconds = 0.0;      ///< of StudyInputs
    bool needs_model = false;  ///< with its photos; a small one is trained where none is given
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
