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
    write_file(folder_ / file, csv(table), Durability::none);
    text("Numbers: [" + file + "](" + file + ")");
}

void Page::plot(const std::string& name, const Plot& plot) {
    claim(name);
    if (folder_.empty() || plot.series.empty()) return;
    write_file(folder_ / (name + ".svg"), to_svg(plot), Durability::none);
    text("![" + plot.title + "](" + name + ".svg)");
}

AppResult Page::finish() const {
    if (!folder_.empty()) {
        write_file(folder_ / (name_ + ".md"), result_.text, Durability::none);
        write_file(folder_ / (name_ + ".json"), result_.json.text() + "\n", Durability::none);
    }
    return result_;
}

}  // namespace stymo
