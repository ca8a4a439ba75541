#pragma once

#include <cstdint>
#include <string>
#include <variant>
#include <vector>

#include "apps/bench/svg_plot.h"
#include "core/io/json_writer.h"

namespace stymo {

/// A cell of a table: nothing, a flag, a number or text.
using Value = std::variant<std::monostate, bool, std::int64_t, double, std::string>;
using Row = std::vector<Value>;

/// Numbers with three significant digits, flags as "yes" and "no", nothing as "".
[[nodiscard]] std::string plain(const Value& value);

/// A column. `key` and full-precision values are for programs, `title` and `text` for people.
struct Column {
    std::string key;
    std::string title{};  ///< empty: the column appears only in CSV and JSON
    std::string (*text)(const Value&) = plain;
};

/// The results of a study, one row for each variant.
struct Table {
    std::string name;
    std::vector<Column> columns;
    std::vector<Row> rows{};

    /// The number in the column `key`; NaN if the cell has none. Throws ValueError for a column
    /// that does not exist.
    [[nodiscard]] double number(const Row& row, const std::string& key) const;
    [[nodiscard]] std::string words(const Row& row, const std::string& key) const;
};

/// The columns that have titles, as an aligned Markdown table with escaped vertical bars.
[[nodiscard]] std::string markdown(const Table& table);
/// All columns as CSV (RFC 4180): cells with commas, quotes or line ends are quoted.
[[nodiscard]] std::string csv(const Table& table);
/// A list of objects, one for each row.
[[nodiscard]] JsonValue to_json(const Table& table);
[[nodiscard]] JsonValue to_json(const std::vector<Column>& columns, const Row& row);
/// Reads a row that `to_json` wrote; missing columns stay empty. Throws Error for anything but an
/// object.
[[nodiscard]] Row row_from_json(const std::vector<Column>& columns, const std::string& text);

/// The columns that a plot shows; `label` may be empty.
struct PlotColumns {
    std::string series;
    std::string x;
    std::string y;
    std::string label{};
    double x_unit = 1.0;  ///< value of one unit of the x axis
};
/// `plot` with a series for each value of the column `series`. Rows that cannot be shown on the
/// scales are left out.
[[nodiscard]] Plot plot_of(const Table& table, const PlotColumns& columns, Plot plot);

/// "12.3", with this number of digits after the decimal point.
[[nodiscard]] std::string decimal(double value, int digits);
/// A Column::text for numbers with this number of digits after the decimal point.
template <int digits>
[[nodiscard]] std::string fixed(const Value& value);
[[nodiscard]] std::string milliseconds(const Value& seconds);
[[nodiscard]] std::string mebibytes(const Value& bytes);
[[nodiscard]] std::string percent(const Value& share);
/// "equal" for infinity, the value for equal images.
[[nodiscard]] std::string decibels(const Value& value);

}  // namespace stymo
