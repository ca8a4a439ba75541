#include "apps/common/table.h"

#include <algorithm>
#include <cmath>
#include <iomanip>
#include <limits>
#include <nlohmann/json.hpp>

#include "core/error.h"

namespace stymo {

namespace {

std::size_t index_of(const std::vector<Column>& columns, const std::string& key) {
    const auto found = std::ranges::find(columns, key, &Column::key);
    if (found == columns.end()) fail<ValueError>("there is no column ", key);
    return static_cast<std::size_t>(found - columns.begin());
}

JsonValue json_of(const Value& value) {
    return std::visit(
        []<class Held>(const Held& held) {
            if constexpr (std::is_same_v<Held, std::monostate>) {
                return JsonValue();
            } else {
                return JsonValue(held);
            }
        },
        value);
}

Value value_of(const nlohmann::json& json) {
    if (json.is_boolean()) return json.get<bool>();
    if (json.is_number_integer()) return json.get<std::int64_t>();
    if (json.is_number_float()) return json.get<double>();
    if (json.is_string()) return json.get<std::string>();
    return {};
}

double number_in(const Value& value) {
    if (const auto* number = std::get_if<double>(&value)) return *number;
    if (const auto* count = std::get_if<std::int64_t>(&value)) return static_cast<double>(*count);
    return std::numeric_limits<double>::quiet_NaN();
}

/// By the unit in the key; "" without one.
std::string unit_text(const std::string& key, double number) {
    if (key.ends_with("_db")) return std::isinf(number) ? "equal" : decimal(number, 2);
    if (key.ends_with("_mebibytes")) return decimal(number, 1) + " MiB";
    if (key.ends_with("_bytes")) return decimal(number / 1048576.0, 1) + " MiB";
    if (key.starts_with("share")) return percent(number);
    if (key.find("seconds") == std::string::npos) return {};
    return number < 1.0 ? significant(number * 1e3, 4) + " ms" : significant(number, 4) + " s";
}

std::string text_of(const std::string& key, const Value& value) {
    if (const auto* text = std::get_if<std::string>(&value)) return *text;
    if (const auto* flag = std::get_if<bool>(&value)) return *flag ? "yes" : "no";
    if (std::holds_alternative<std::monostate>(value)) return {};
    const double number = number_in(value);
    const std::string text = unit_text(key, number);
    if (!text.empty()) return text;
    return std::holds_alternative<double>(value) ? significant(number, 4) : json_of(value).text();
}

void require_rectangular(const Table& table) {
    for (const Row& row : table.rows)
        if (row.size() != table.columns.size())
            fail<ValueError>("table ", table.name, " has ", table.columns.size(),
                             " columns and a row of ", row.size());
}

std::string replaced(const std::string& text, char from, const char* to) {
    std::string result;
    for (const char c : text) result += c == from ? to : std::string(1, c);
    return result;
}

/// The key without a unit that the cells name.
std::string heading(std::string key) {
    for (const std::string unit : {"_seconds", "_mebibytes", "_bytes"})
        if (key.ends_with(unit)) key.resize(key.size() - unit.size());
    return replaced(replaced(key, '_', " "), '|', "\\|");
}

std::string csv_cell(const Value& value) {
    if (std::holds_alternative<std::monostate>(value)) return {};
    const auto* held = std::get_if<std::string>(&value);
    const std::string text = held != nullptr ? *held : json_of(value).text();
    if (text.find_first_of(",\"\n") == std::string::npos) return text;
    return "\"" + replaced(text, '"', "\"\"") + "\"";
}

/// In characters: each byte of UTF-8 counts but those that continue one.
std::size_t text_width(const std::string& text) {
    return static_cast<std::size_t>(
        std::ranges::count_if(text, [](char c) { return (c & 0xC0) != 0x80; }));
}

}  // namespace

Value& cell(const std::vector<Column>& columns, Row& row, const std::string& key) {
    return row.at(index_of(columns, key));
}

double number(const Table& table, const Row& row, const std::string& key) {
    return number_in(row.at(index_of(table.columns, key)));
}

std::string words(const Table& table, const Row& row, const std::string& key) {
    return text_of(key, row.at(index_of(table.columns, key)));
}

std::string markdown(const Table& table) {
    require_rectangular(table);
    if (table.hidden) return {};
    std::vector<std::string> lines(table.rows.size() + 2);
    for (std::size_t i = 0; i < table.columns.size(); ++i) {
        const Column& column = table.columns[i];
        if (column.hidden) continue;
        std::vector<std::string> cells{heading(column.key)};
        for (const Row& row : table.rows)
            cells.push_back(replaced(text_of(column.key, row[i]), '|', "\\|"));
        const std::size_t widest =
            std::max<std::size_t>(3, text_width(*std::ranges::max_element(cells, {}, text_width)));
        for (std::string& text : cells)
            text = "| " + text + std::string(widest - text_width(text) + 1, ' ');
        cells.insert(cells.begin() + 1, "|" + std::string(widest + 2, '-'));
        for (std::size_t line = 0; line < lines.size(); ++line) lines[line] += cells[line];
    }
    std::string text;
    for (const std::string& line : lines) text += line + "|\n";
    return text;
}

std::string csv(const Table& table) {
    require_rectangular(table);
    std::string text;
    for (const Column& column : table.columns)
        text += (text.empty() ? "" : ",") + csv_cell(column.key);
    for (const Row& row : table.rows)
        for (std::size_t i = 0; i < row.size(); ++i)
            text += (i > 0 ? "," : "\n") + csv_cell(row[i]);
    return text + "\n";
}

JsonValue to_json(const std::vector<Column>& columns, const Row& row) {
    JsonValue object = JsonValue::object();
    for (std::size_t i = 0; i < columns.size(); ++i) object.add(columns[i].key, json_of(row.at(i)));
    return object;
}

JsonValue to_json(const Table& table) {
    require_rectangular(table);
    std::vector<JsonValue> rows;
    for (const Row& row : table.rows) rows.push_back(to_json(table.columns, row));
    return rows;
}

Row row_from_json(const std::vector<Column>& columns, const std::string& text) {
    try {
        const nlohmann::json object = nlohmann::json::parse(text);
        Row row;
        for (const Column& column : columns)
            row.push_back(value_of(object.value(column.key, nlohmann::json())));
        return row;
    } catch (const nlohmann::json::exception& error) {
        fail<Error>("a row's result cannot be read: ", error.what());
    }
}

std::string decimal(double value, int digits) {
    std::ostringstream text;
    text << std::fixed << std::setprecision(digits) << value;
    return text.str();
}

std::string significant(double value, int digits) {
    std::ostringstream text;
    text << std::setprecision(digits) << value;
    return text.str();
}

std::string percent(double share) {
    return decimal(100.0 * share, 0) + " %";
}

}  // namespace stymo
