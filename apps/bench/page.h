#pragma once

#include <filesystem>
#include <set>
#include <string>

#include "apps/bench/svg_plot.h"
#include "apps/bench/table.h"
#include "apps/common/command_line.h"

namespace stymo {

/// A page in Markdown with its tables and plots. Files: NAME.md, NAME.json (one object with all
/// facts and tables), NAME_TABLE.csv for each table and PLOT.svg for each plot.
class Page {
public:
    /// `folder` exists, or is empty: then no files are written.
    Page(std::string name, std::filesystem::path folder)
        : name_(std::move(name)), folder_(std::move(folder)) {}

    /// `level` 1: the page; 2: a study; 3: a part of it.
    void title(int level, const std::string& words);
    /// A paragraph.
    void text(const std::string& words);
    /// A table without any titled column goes only to the files. Throws ValueError for a name that
    /// is taken, and for a row of another length than the columns.
    void add(const Table& table);
    /// Nothing for a plot without points. Throws ValueError for a name that is taken.
    void plot(const std::string& name, const Plot& plot);
    /// A member of NAME.json only.
    void fact(const std::string& key, const JsonValue& value) { result_.json.add(key, value); }
    /// Writes NAME.md and NAME.json and returns what they hold.
    [[nodiscard]] AppResult finish() const;

private:
    void claim(const std::string& name);

    std::string name_;
    std::filesystem::path folder_;
    AppResult result_;
    std::set<std::string> names_;
};

}  // namespace stymo
