#include "apps/bench/study.h"

#include <iterator>

#include "core/error.h"
#include "core/interrupt.h"
#include "core/progress.h"

namespace stymo {

Table run_study(Table table, const std::vector<StudyRow>& rows) {
    const InterruptGuard guard;
    Progress progress({.title = table.name, .total = std::ssize(rows), .unit = "rows"});
    for (const StudyRow& row : rows) {
        if (interrupted()) fail<Error>("interrupted; nothing was written");
        progress.update(std::ssize(table.rows), plain(row.varied.front()));
        Row cells = row.varied;
        for (Value& value : row.measure()) cells.push_back(std::move(value));
        table.rows.push_back(std::move(cells));
    }
    progress.update(std::ssize(table.rows));
    progress.finish();
    return table;
}

std::vector<Study> report_studies() {
    return {quadrature_study(), rendering_study(), fitting_study(),
            training_study(),   stability_study(), omitted_study()};
}

}  // namespace stymo
