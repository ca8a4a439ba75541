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
    /// `folder` must exist; if it is empty, no files are written.
    Page(std::string name, std::filesystem::path folder)
        : name_(std::move(name)), folder_(std::move(folder)) {}

    /// `level` 1: the page; 2: a study; 3: a part of it.
    void title(int level, const std::string& words);
    /// A paragraph.
    void text(const std::string& words);
    /// Adds a table. If no column has a title, it is written only to files. Throws ValueError for a
    /// name that is taken, and for a row of another length than the columns.
    void add(const Table& table);
    /// Adds a plot, unless it has no points. Throws ValueError for a name that is taken.
    void plot(const std::string& name, const Plot& plot);
    /// Adds a member to NAME.json only.
    void fact(const std::string& key, const JsonValue& value) { result_.json.add(key, value); }
    /// Writes NAME.md and NAME.json and returns their contents.
    [[nodiscard]] AppResult finish() const;

private:
    void claim(const std::string& name);

    std::string name_;
    std::filesystem::path folder_;
    AppResult result_;
    std::set<std::string> names_;
};

}  // namespace stymo
