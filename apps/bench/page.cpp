#include "apps/bench/page.h"

#include "core/error.h"
#include "core/io/file.h"

namespace stymo {

void Page::claim(const std::string& name) {
    if (!names_.insert(name).second)
        fail<ValueError>("the page has two tables or plots called ", name);
}

void Page::title(int level, const std::string& words) {
    text(std::string(static_cast<std::size_t>(level), '#') + " " + words);
}

void Page::text(const std::string& words) {
    result_.text += (result_.text.empty() ? "" : "\n") + words + "\n";
}

void Page::add(const Table& table) {
    claim(table.name);
    std::string words = markdown(table);
    if (!words.empty()) result_.text += (result_.text.empty() ? "" : "\n") + words;
    fact(table.name, to_json(table));
    if (folder_.empty()) return;
    const std::string file = name_ + "_" + table.name + ".csv";
    write_text_file(folder_ / file, csv(table), Survives::nothing);
    text("Numbers: [" + file + "](" + file + ")");
}

void Page::plot(const std::string& name, const Plot& plot) {
    claim(name);
    if (folder_.empty() || plot.series.empty()) return;
    write_text_file(folder_ / (name + ".svg"), to_svg(plot), Survives::nothing);
    text("![" + plot.title + "](" + name + ".svg)");
}

AppResult Page::finish() const {
    if (!folder_.empty()) {
        write_text_file(folder_ / (name_ + ".md"), result_.text, Survives::nothing);
        write_text_file(folder_ / (name_ + ".json"), result_.json.text() + "\n", Survives::nothing);
    }
    return result_;
}

}  // namespace stymo
