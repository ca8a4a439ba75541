#include <catch2/catch.hpp>
#include <string>

#include "core/error.h"
#include "core/io/json_check.h"

using namespace stymo;

TEST_CASE("JSON that a parser would misread is told apart") {
    for (const char* sound :
         {"", "{}", "7", "\"a\"", R"({"a": 1, "b": [1, {"a": 2}]})", R"([{"a": 1}, {"a": 1}])",
          R"({"a": "a", "b": "a"})", R"({"a\"": 1, "a": 2})", R"({"a": "[[[[\"{{"})",
          "{\"a\": 1}\n{\"a\": 2}\n", "]]}}", "{\"a", "\"", "{\"a\\"}) {
        INFO(sound);
        CHECK_FALSE(json_fault(sound).has_value());
    }
    for (const char* twice :
         {R"({"a": 1, "a": 1})", R"({"a": 1, "b": {}, "a" : 1})",
          R"([{"b": {"a": 1, "c": [], "a": 1}}])", R"({"\u0061": 1, "a": 2})"}) {
        INFO(twice);
        CHECK(json_fault(twice) == "the key \"a\" is given twice in one object");
    }
    CHECK(json_fault(std::string("{}\0{}", 5)) == "holds a zero byte");
}

TEST_CASE("JSON nested too deeply is refused, however deep") {
    const auto nested = [](std::size_t depth) {
        return std::string(depth, '[') + std::string(depth, ']');
    };
    CHECK_FALSE(json_fault(nested(deepest_json)).has_value());
    CHECK(json_fault(nested(deepest_json + 1)) == "nested deeper than 32 levels");
    CHECK_THROWS_AS(require_sound_json(nested(1000000)), FileError);
    CHECK_THROWS_AS(require_sound_json(std::string(1000000, '{')), FileError);
}
