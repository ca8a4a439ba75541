#include <catch2/catch.hpp>
#include <limits>
#include <nlohmann/json.hpp>

#include "core/error.h"
#include "core/io/json_writer.h"

using stymo::JsonValue;

TEST_CASE("Values of every kind are written as JSON") {
    CHECK(JsonValue().text() == "null");
    CHECK(JsonValue(true).text() == "true");
    CHECK(JsonValue(-7).text() == "-7");
    CHECK(JsonValue(18446744073709551615ULL).text() == "18446744073709551615");
    CHECK(JsonValue("face").text() == "\"face\"");
    CHECK(JsonValue(std::vector<int>{1, 2, 3}).text() == "[1,2,3]");
    CHECK(JsonValue(std::vector<double>{}).text() == "[]");
    CHECK(JsonValue(std::vector<std::string>{"a", "b"}).text() == R"(["a","b"])");
    CHECK(JsonValue::object().text() == "{}");
}

TEST_CASE("Members of an object keep their order and may be objects themselves") {
    JsonValue report =
        JsonValue::object({{"steps", 200}, {"initial", JsonValue::object({{"l1", 0.25}})}});
    report.add("loss", std::vector<double>{0.5, 0.125}).add("ok", true);
    CHECK(report.text() == R"({"steps":200,"initial":{"l1":0.25},"loss":[0.5,0.125],"ok":true})");
    CHECK(JsonValue(std::vector<JsonValue>{report, 1}).text() == "[" + report.text() + ",1]");
    CHECK_THROWS_AS(JsonValue(3).add("key", 1), stymo::ValueError);
}

TEST_CASE("Numbers read back to the very same value") {
    const double value =
        GENERATE(0.1, 1.0 / 3.0, -2.5e-308, 1.7976931348623157e308, 123456789.123456789, 5e-324);
    const double back = nlohmann::json::parse(JsonValue(value).text()).get<double>();
    CHECK(back == value);
    CHECK(JsonValue(0.1F).text() == "0.1");
}

TEST_CASE("Numbers that JSON does not know are null") {
    CHECK(JsonValue(std::numeric_limits<double>::quiet_NaN()).text() == "null");
    CHECK(JsonValue(-std::numeric_limits<float>::infinity()).text() == "null");
}

TEST_CASE("Strings and keys are escaped and always valid UTF-8") {
    const std::string awkward = "quote \" backslash \\ newline \n tab \t bell \a umlaut \xc3\xbc";
    CHECK(nlohmann::json::parse(JsonValue(awkward).text()).get<std::string>() == awkward);
    CHECK(nlohmann::json::parse(JsonValue::object({{awkward, 1}}).text()).at(awkward) == 1);
    CHECK(nlohmann::json::parse(JsonValue("broken \xff byte").text()).get<std::string>() ==
          "broken \xef\xbf\xbd byte");
}
