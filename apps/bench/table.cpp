#include "apps/bench/table.h"

#include <algorithm>
#include <cmath>
#include <iomanip>
#include <limits>
#include <nlohmann/json.hpp>
#include <sstream>

#include "core/error.h"

namespace stymo {

namespace {

std::size_t index_of(const Table& table, const std::string& key) {
    const auto found = std::ranges::find(table.columns, key, &Column::key);
    if (found == table.columns.end())
        fail<ValueError>("table ", table.name, " has no column ", key);
    return static_cast<std::size_t>(found - table.columns.begin());
}

double number_in(const Value& value) {
    if (const auto* number = std::get_if<double>(&value)) return *number;
    if (const auto* count = std::get_if<std::int64_t>(&value)) return static_cast<double>(*count);
    return std::numeric_limits<double>::quiet_NaN();
}

/// `text` of the number; other values as they are.
template <class Text>
std::string number_text(const Value& value, const Text& text) {
    const double number = number_in(value);
    return std::isnan(number) ? plain(value) : text(number);
}

JsonValue json_of(const Value& value) {
    return std::visit(
        [](const auto& held) {
            if constexpr (std::is_same_v<std::decay_t<decltype(held)>, std::monostate>) {
                return JsonValue();
            } else {
                return JsonValue(held);
            }
        },
        value);
}

void require_rectangular(const Table& table) {
    for (const Row& row : table.rows)
        if (row.size() != table.columns.size())
            fail<ValueError>("table ", table.name, " has ", table.columns.size(),
                             " columns and a row of ", row.size());
}

std::string quoted(const std::string& cell) {
    if (cell.find_first_of(",\"\n") == std::string::npos) return cell;
    std::string text = "\"";
    for (const char c : cell) text += c == '"' ? "\"\"" : std::string(1, c);
    return text + "\"";
}

std::string escaped_cell(const std::string& cell) {
    std::string text;
    for (const char c : cell) text += c == '|' ? "\\|" : std::string(1, c);
    return text;
}

/// In characters: each byte of UTF-8 counts but those that continue one.
std::size_t text_width(const std::string& cell) {
    return static_cast<std::size_t>(
        std::ranges::count_if(cell, [](char c) { return (c & 0xC0) != 0x80; }));
}

}  // namespace

std::string plain(const Value& value) {
    if (const auto* words = std::get_if<std::string>(&value)) return *words;
    if (const auto* flag = std::get_if<bool>(&value)) return *flag ? "yes" : "no";
    if (std::holds_alternative<std::monostate>(value)) return {};
    if (std::holds_alternative<std::int64_t>(value)) return json_of(value).text();
    std::ostringstream text;
    text << std::setprecision(3) << std::get<double>(value);
    return text.str();
}

double Table::number(const Row& row, const std::string& key) const {
    return number_in(row.at(index_of(*this, key)));
}

std::string Table::words(const Row& row, const std::string& key) const {
    return plain(row.at(index_of(*this, key)));
}

std::string markdown(const Table& table) {
    require_rectangular(table);
    std::vector<std::vector<std::string>> columns;
    for (std::size_t i = 0; i < table.columns.size(); ++i) {
        const Column& column = table.columns[i];
        if (column.title.empty()) continue;
        std::vector<std::string> cells{escaped_cell(column.title)};
        for (const Row& row : table.rows) cells.push_back(escaped_cell(column.text(row[i])));
        const std::size_t widest =
            std::max<std::size_t>(3, text_width(*std::ranges::max_element(cells, {}, text_width)));
        for (std::string& cell : cells) cell += std::string(widest - text_width(cell), ' ');
        cells.insert(cells.begin() + 1, std::string(widest, '-'));
        columns.push_back(std::move(cells));
    }
    std::string text;
    if (columns.empty()) return text;
    for (std::size_t line = 0; line < table.rows.size() + 2; ++line) {
        const char space = line == 1 ? '-' : ' ';
        for (const auto& cells : columns) text += std::string("|") + space + cells[line] + space;
        text += "|\n";
    }
    return text;
}

std::string csv(const Table& table) {
    require_rectangular(table);
    std::string text;
    for (std::size_t i = 0; i < table.columns.size(); ++i)
        text += (i > 0 ? "," : "") + quoted(table.columns[i].key);
    for (const Row& row : table.rows) {
        text += "\n";
        for (std::size_t i = 0; i < row.size(); ++i) {
            const auto* words = std::get_if<std::string>(&row[i]);
            const bool empty = std::holds_alternative<std::monostate>(row[i]);
            text += i > 0 ? "," : "";
            text += empty ? "" : quoted(words != nullptr ? *words : json_of(row[i]).text());
        }
    }
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
        for (const Column& column : columns) {
            const nlohmann::json value = object.value(column.key, nlohmann::json());
            if (value.is_null()) row.emplace_back();
            if (value.is_boolean()) row.emplace_back(value.get<bool>());
            if (value.is_number_integer()) row.emplace_back(value.get<std::int64_t>());
            if (value.is_number_float()) row.emplace_back(value.get<double>());
            if (value.is_string()) row.emplace_back(value.get<std::string>());
        }
        return row;
    } catch (const nlohmann::json::exception& error) {
        fail<Error>("a row's result cannot be read: ", error.what());
    }
}

Plot plot_of(const Table& table, const PlotColumns& columns, Plot plot) {
    const auto shown = [](double value, PlotScale scale) {
        return std::isfinite(value) && (scale == PlotScale::linear || value > 0.0);
    };
    for (const Row& row : table.rows) {
        const double x = table.number(row, columns.x) / columns.x_unit,
                     y = table.number(row, columns.y);
        if (!shown(x, plot.x_scale) || !shown(y, plot.y_scale)) continue;
        const std::string name = table.words(row, columns.series);
        auto series = std::ranges::find(plot.series, name, &PlotSeries::name);
        if (series == plot.series.end()) series = plot.series.insert(series, {name, {}});
        series->points.push_back(
            {x, y, columns.label.empty() ? "" : table.words(row, columns.label)});
    }
    return plot;
}

std::string decimal(double value, int digits) {
    std::ostringstream text;
    text << std::fixed << std::setprecision(digits) << value;
    return text.str();
}

template <int digits>
std::string fixed(const Value& value) {
    return number_text(value, [](double number) { return decimal(number, digits); });
}
template std::string fixed<0>(const Value&);
template std::string fixed<1>(const Value&);
template std::string fixed<2>(const Value&);
template std::string fixed<3>(const Value&);
template std::string fixed<4>(const Value&);
template std::string fixed<5>(const Value&);
template std::string fixed<6>(const Value&);

std::string milliseconds(const Value& seconds) {
    return number_text(seconds, [](double number) {
        const double value = number * 1e3;
        return decimal(value, value < 100.0 ? 2 : value < 1000.0 ? 1 : 0);
    });
}

std::string mebibytes(const Value& bytes) {
    constexpr double mebibyte = 1048576.0;
    return number_text(bytes, [](double number) { return decimal(number / mebibyte, 0); });
}

std::string percent(const Value& share) {
    return number_text(share, [](double number) { return decimal(100.0 * number, 0) + " %"; });
}

std::string decibels(const Value& value) {
    return number_text(
        value, [](double number) { return std::isfinite(number) ? decimal(number, 1) : "equal"; });
}

}  // namespace stymo
