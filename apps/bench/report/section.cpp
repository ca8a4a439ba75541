#include "apps/bench/report/section.h"

#include <functional>
#include <iomanip>
#include <sstream>

#include "apps/bench/report.h"
#include "core/error.h"
#include "core/io/file.h"

namespace stymo {

namespace {

std::string three_digits(double number) {
    std::ostringstream text;
    text << std::setprecision(3) << number;
    return text.str();
}

/// Strings as they are, other values as in JSON.
std::string full(const ReportCell& cell) {
    return cell.value.text().starts_with('"') ? cell.text : cell.value.text();
}

void require_rectangular(const std::string& name, const std::vector<std::string>& columns,
                         const std::vector<std::vector<ReportCell>>& rows) {
    for (const auto& row : rows)
        if (row.size() != columns.size())
            fail<ValueError>("table ", name, " has ", columns.size(), " columns and a row of ", row.size());
}

Cells cells_of(const std::vector<std::string>& columns, const std::vector<std::vector<ReportCell>>& rows,
               const std::function<std::string(const ReportCell&)>& text) {
    Cells cells{columns};
    for (const auto& row : rows) {
        cells.emplace_back();
        for (const ReportCell& cell : row) cells.back().push_back(text(cell));
    }
    return cells;
}

}  // namespace

ReportCell::ReportCell(double number) : text(three_digits(number)), value(number) {}

void ReportWriter::claim(const std::string& name) {
    if (!names_.insert(name).second) fail<ValueError>("the report has two files called ", name);
}

void ReportWriter::title(int level, const std::string& words) {
    page_ += std::string(page_.empty() ? "" : "\n") + std::string(static_cast<std::size_t>(level), '#') + " " + words + "\n";
}

void ReportWriter::heading(const std::string& words) {
    constexpr int within_a_section = 3;
    title(within_a_section, words);
}

void ReportWriter::text(const std::string& words) {
    page_ += "\n" + words + "\n";
}

void ReportWriter::table(const std::string& name, const std::vector<std::string>& columns,
                         const std::vector<std::vector<ReportCell>>& rows) {
    require_rectangular(name, columns, rows);
    page_ += "\n" + markdown(cells_of(columns, rows, [](const ReportCell& cell) { return cell.text; }));
    data(name, columns, rows);
}

void ReportWriter::data(const std::string& name, const std::vector<std::string>& columns,
                        const std::vector<std::vector<ReportCell>>& rows) {
    require_rectangular(name, columns, rows);
    claim(name);
    std::vector<JsonValue> objects;
    for (const auto& row : rows) {
        objects.push_back(JsonValue::object());
        for (std::size_t i = 0; i < columns.size(); ++i) objects.back().add(columns[i], row[i].value);
    }
    write_text_file(folder_ / (name + ".csv"), csv(cells_of(columns, rows, full)));
    write_text_file(folder_ / (name + ".json"), JsonValue(objects).text() + "\n");
    text("Numbers: [" + name + ".csv](" + name + ".csv), [" + name + ".json](" + name + ".json)");
}

void ReportWriter::plot(const std::string& name, const Plot& plot) {
    claim(name);
    write_text_file(folder_ / (name + ".svg"), to_svg(plot));
    text("![" + plot.title + "](" + name + ".svg)");
}

void ReportWriter::finish() const {
    write_text_file(folder_ / "report.md", page_);
}

}  // namespace stymo
