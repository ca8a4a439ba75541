#pragma once

#include <cstdint>
#include <sstream>
#include <string>
#include <variant>
#include <vector>

#include "core/io/json_writer.h"

/// Tables of results: Markdown for people, CSV and JSON for programs.
namespace stymo {

/// A cell of a table: nothing, a flag, a number or text.
using Value = std::variant<std::monostate, bool, std::int64_t, double, std::string>;
using Row = std::vector<Value>;

/// A column, for "key" or "~key", which only CSV and JSON show. The key names its unit:
/// "median_seconds", "psnr_db", "peak_bytes", "share_of_peak".
struct Column {
    // NOLINTNEXTLINE(google-explicit-constructor): lists of columns are lists of keys
    Column(const char* name) : key(name + (*name == '~')), hidden(*name == '~') {}

    std::string key;
    bool hidden;
};

struct Table {
    std::string name;
    std::vector<Column> columns;
    std::vector<Row> rows{};
    bool hidden = false;  ///< only in CSV and JSON
};

/// The cell in the column `key`. Throws ValueError for a column that does not exist.
[[nodiscard]] Value& cell(const std::vector<Column>& columns, Row& row, const std::string& key);
/// Its number; NaN if it has none.
[[nodiscard]] double number(const Table& table, const Row& row, const std::string& key);
/// The cell for people: times in s or ms, shares in percent, "equal" for an infinite PSNR, other
/// numbers with four significant digits, flags as "yes" and "no", nothing as "".
[[nodiscard]] std::string words(const Table& table, const Row& row, const std::string& key);

/// An aligned Markdown table with escaped vertical bars; empty if the table is hidden. This and the
/// next two throw ValueError for a row of another length than the columns.
[[nodiscard]] std::string markdown(const Table& table);
/// All columns as CSV (RFC 4180): cells with commas, quotes or line ends are quoted.
[[nodiscard]] std::string csv(const Table& table);
/// A list of objects, one for each row.
[[nodiscard]] JsonValue to_json(const Table& table);
[[nodiscard]] JsonValue to_json(const std::vector<Column>& columns, const Row& row);
/// Reads a row that `to_json` wrote; missing columns stay empty. Throws Error for anything but an
/// object.
[[nodiscard]] Row row_from_json(const std::vector<Column>& columns, const std::string& text);

/// The concatenation of `parts`, each written with operator<<.
template <class... Parts>
[[nodiscard]] std::string text_from(const Parts&... parts) {
    std::ostringstream text;
    (text << ... << parts);
    return text.str();
}
/// "12.3", with this number of digits after the decimal point.
[[nodiscard]] std::string decimal(double value, int digits);
/// "0.02", with at most this number of significant digits.
[[nodiscard]] std::string significant(double value, int digits);
/// "45 %"
[[nodiscard]] std::string percent(double share);

}  // namespace stymo
