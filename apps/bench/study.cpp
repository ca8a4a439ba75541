#include "apps/bench/study.h"

#include "core/error.h"
#include "core/interrupt.h"
#include "core/io/file.h"
#include "core/progress.h"

namespace stymo {

namespace {

Table measured(const Study& study, const StudyPlan& plan) {
    const InterruptGuard guard;
    Table table{study.name, study.columns};
    Progress progress({.title = study.name, .total = std::ssize(plan.rows), .unit = "rows"});
    for (const StudyRow& row : plan.rows) {
        if (interrupted()) fail<Error>("interrupted; nothing was written");
        progress.update(std::ssize(table.rows),
                        words(table, row.varied, table.columns.front().key));
        Row cells = row.varied;
        for (Value& value : row.measure()) cells.push_back(std::move(value));
        table.rows.push_back(std::move(cells));
    }
    if (interrupted()) fail<Error>("interrupted; nothing was written");
    progress.update(std::ssize(table.rows));
    return table;
}

}  // namespace

std::vector<Study> report_studies() {
    return {rendering_study(), fitting_study(), tuning_study(), training_study(), step_study()};
}

void run_study(Page& page, const Study& study, const StudyInputs& inputs) {
    page.text("## " + study.title);
    page.text("Varied: " + study.varied + ". Measured: " + study.measured +
              ". Reference: " + study.reference + ".");
    const StudyPlan plan = study.plan(inputs);
    const Table table = measured(study, plan);
    if (!plan.setting.empty()) page.text(plan.setting);
    page.add(table);
    if (study.summary != nullptr) page.add(study.summary(table));
    if (!plan.curves) return;
    plan.curves->hidden = true;
    page.add(*plan.curves);
}

void Page::text(const std::string& words) {
    result_.text += (result_.text.empty() ? "" : "\n") + words + "\n";
}

void Page::add(const Table& table) {
    const std::string words = markdown(table);
    if (!words.empty()) result_.text += (result_.text.empty() ? "" : "\n") + words;
    fact(table.name, to_json(table));
    if (folder_.empty()) return;
    const std::string file = name_ + "_" + table.name + ".csv";
    files_.emplace_back(file, csv(table));
    text("Numbers: [" + file + "](" + file + ")");
}

AppResult Page::finish() const {
    if (!folder_.empty()) {
        for (const auto& [name, bytes] : files_)
            write_file(folder_ / name, bytes, Durability::none);
        write_file(folder_ / (name_ + ".md"), result_.text, Durability::none);
        write_file(folder_ / (name_ + ".json"), result_.json.text() + "\n", Durability::none);
    }
    return result_;
}

}  // namespace stymo
