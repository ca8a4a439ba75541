#include <catch2/catch.hpp>
#include <filesystem>
#include <fstream>
#include <regex>
#include <set>
#include <sstream>

#include "core/op_cases.h"

using namespace stymo::test;

namespace {

/// Names of the functions that a header text declares as `[[nodiscard]] Variable name(`.
std::set<std::string> declared_ops(const std::string& header) {
    static const std::regex declaration(
        R"((?:^|\n)\[\[nodiscard\]\]\s+(?:inline\s+)?Variable\s+(\w+)\s*\()");
    std::set<std::string> names;
    for (std::sregex_iterator match(header.begin(), header.end(), declaration), end; match != end;
         ++match) {
        names.insert((*match)[1]);
    }
    return names;
}

std::set<std::string> ops_without_row(const std::set<std::string>& declared) {
    std::set<std::string> missing = declared;
    for (const OpCase& row : op_cases()) missing.erase(row.op);
    return missing;
}

std::string listed(const std::set<std::string>& names) {
    std::string text;
    for (const std::string& name : names) text += " " + name;
    return text;
}

std::set<std::string> ops_of_the_library() {
    std::set<std::string> declared;
    for (const char* folder : {STYMO_SOURCE_DIR "/core/ops", STYMO_SOURCE_DIR "/nn/engine",
                               STYMO_SOURCE_DIR "/nn/pretrained/perceptual"}) {
        for (const auto& entry : std::filesystem::directory_iterator(folder)) {
            if (entry.path().extension() != ".h") continue;
            std::ifstream file(entry.path());
            std::ostringstream text;
            text << file.rdbuf();
            declared.merge(declared_ops(text.str()));
        }
    }
    return declared;
}

}  // namespace

TEST_CASE("Every op has a row in the table", "[ops]") {
    const std::set<std::string> declared = ops_of_the_library();
    REQUIRE(declared.size() > 40);
    INFO("without a row in tests/{core,nn}/op_cases*.cpp:" << listed(ops_without_row(declared)));
    CHECK(ops_without_row(declared).empty());
}

TEST_CASE("Every row of the table is a declared op with a name of its own", "[ops]") {
    const std::set<std::string> declared = ops_of_the_library();
    std::set<std::string> names;
    for (const OpCase& row : op_cases()) {
        INFO(row.name());
        CHECK(declared.contains(row.op));
        CHECK(names.insert(row.name()).second);
    }
}

TEST_CASE("Every op has a benchmark", "[ops]") {
    std::set<std::string> missing = ops_of_the_library();
    for (const OpCase& row : op_cases()) {
        if (!row.speed_shapes.empty()) missing.erase(row.op);
    }
    INFO("without shapes for the benchmark:" << listed(missing));
    CHECK(missing.empty());
}

TEST_CASE("An op without a row is noticed and named", "[ops]") {
    const std::string header = R"(
/// Something new.
[[nodiscard]] Variable hypotenuse(const Variable& a, const Variable& b);
[[nodiscard]] inline Variable twice(const Variable& x) { return x * 2.0; }
[[nodiscard]]
Variable on_two_lines(const Variable& x);
[[nodiscard]] Variable exp(const Variable& x);
[[nodiscard]] inline Variable operator+(const Variable& a, const Variable& b);
[[nodiscard]] Tensor not_an_op(const Tensor& x);
struct Layer {
    [[nodiscard]] Variable operator()(const Variable& x) const;
    [[nodiscard]] Variable member(const Variable& x) const;
};
    )";
    CHECK(ops_without_row(declared_ops(header)) ==
          std::set<std::string>{"hypotenuse", "twice", "on_two_lines"});
}
