#include <catch2/catch.hpp>
#include <cstdint>
#include <limits>
#include <string>
#include <vector>

#include "core/config.h"
#include "core/error.h"
#include "core/io/file.h"
#include "core/io/scratch_folder.h"

using namespace stymo;
using Catch::Matchers::Contains;
using Catch::Matchers::EndsWith;
using Catch::Matchers::Equals;

namespace {

struct Example {
    std::int64_t seed = 1;
    std::int64_t steps = 100;
    double learning_rate = 1e-4;
    bool mirror = true;
    std::string folder = "data";
    std::string schedule = "epoch";
    std::vector<std::int64_t> widths = {64, 32};
    std::vector<double> weights = {0.5, 1.0};
};

ConfigSchema schema_of(Example& example) {
    using Limits = std::numeric_limits<std::int64_t>;
    ConfigSchema schema;
    schema.integer("seed", example.seed, Limits::min(), Limits::max(), "of everything random");
    schema.integer("optimizer.steps", example.steps, 1, 1000, "optimiser steps");
    schema.number("optimizer.learning_rate", example.learning_rate, 0.0, 1.0,
                  "Adam's learning rate (paper: 1e-4)");
    schema.boolean("data.mirror", example.mirror, "also the mirror images");
    schema.text("data.folder", example.folder, "where the images are");
    schema.choice("optimizer.schedule", example.schedule, {"epoch", "cosine"},
                  "of the learning rate");
    schema.integers("model.widths", example.widths, 1, 512, "of the layers");
    schema.numbers("model.loss.weights", example.weights, 0.0, 10.0, "of the terms");
    return schema;
}

std::string message_of_text(const std::string& json) {
    Example example;
    ConfigSchema schema = schema_of(example);
    try {
        schema.read_text(json, "a.json");
    } catch (const ConfigError& error) {
        return error.what();
    }
    return "no error";
}

std::string message_of_set(const std::string& assignment) {
    Example example;
    ConfigSchema schema = schema_of(example);
    try {
        schema.set(assignment);
    } catch (const ConfigError& error) {
        return error.what();
    }
    return "no error";
}

}  // namespace

TEST_CASE("a configuration sets what it names and leaves the rest") {
    Example example;
    ConfigSchema schema = schema_of(example);
    schema.read_text(
        R"({"$note": {"any": ["thing"]}, "seed": 7,
            "optimizer": {"$why": 1, "steps": 2e2, "schedule": "cosine"},
            "data": {"mirror": false, "folder": "x"},
            "model": {"widths": [8], "loss": {"weights": [1, 2.5, 0]}}})",
        "a.json");
    CHECK(example.seed == 7);
    CHECK(example.steps == 200);
    CHECK(example.learning_rate == 1e-4);
    CHECK(example.schedule == "cosine");
    CHECK_FALSE(example.mirror);
    CHECK(example.folder == "x");
    CHECK(example.widths == std::vector<std::int64_t>{8});
    CHECK(example.weights == std::vector<double>{1.0, 2.5, 0.0});
}

TEST_CASE("an unknown key is refused with the nearest known one") {
    CHECK_THAT(
        message_of_text(R"({"optimizer": {"learning_rat": 1}})"),
        Equals(
            "a.json: optimizer.learning_rat: unknown key; did you mean optimizer.learning_rate?"));
    CHECK_THAT(message_of_text(R"({"learning_rate": 1})"),
               Contains("did you mean optimizer.learning_rate?"));
    CHECK_THAT(message_of_text(R"({"data": {"schedule": "cosine"}})"),
               Contains("did you mean optimizer.schedule?"));
    CHECK_THAT(message_of_text(R"({"optimiser": {"steps": 1}})"),
               Contains("optimiser: unknown key"));
    CHECK_THAT(message_of_set("optimizer.stesp=3"),
               Contains("optimizer.stesp: unknown key; did you mean optimizer.steps?"));
    CHECK_THAT(message_of_set("optimizer={}"), Contains("unknown key"));
}

TEST_CASE("a value out of range or of another type is refused with what is allowed") {
    const auto refused = [](const std::string& json, const std::string& line) {
        CHECK_THAT(message_of_text(json), Equals("a.json: " + line));
    };
    refused(R"({"optimizer": {"learning_rate": 5}})",
            "optimizer.learning_rate = 5: must be a number in [0.0, 1.0]");
    refused(R"({"optimizer": {"learning_rate": "1"}})",
            "optimizer.learning_rate = \"1\": must be a number in [0.0, 1.0]");
    refused(R"({"optimizer": {"learning_rate": null}})",
            "optimizer.learning_rate = null: must be a number in [0.0, 1.0]");
    refused(R"({"optimizer": {"steps": 0}})",
            "optimizer.steps = 0: must be an integer in [1, 1000]");
    refused(R"({"optimizer": {"steps": 1.5}})",
            "optimizer.steps = 1.5: must be an integer in [1, 1000]");
    refused(R"({"optimizer": {"steps": true}})",
            "optimizer.steps = true: must be an integer in [1, 1000]");
    refused(R"({"optimizer": {"steps": 1e300}})",
            "optimizer.steps = 1e+300: must be an integer in [1, 1000]");
    refused(R"({"optimizer": {"schedule": "step"}})",
            "optimizer.schedule = \"step\": must be one of epoch, cosine");
    refused(R"({"data": {"mirror": 1}})", "data.mirror = 1: must be true or false");
    refused(R"({"data": {"folder": 1}})", "data.folder = 1: must be a string");
    refused(R"({"model": {"widths": 8}})",
            "model.widths = 8: must be an array of integers in [1, 512]");
    refused(R"({"model": {"widths": [8, 513]}})",
            "model.widths = [8,513]: must be an array of integers in [1, 512]");
    refused(R"({"model": {"loss": {"weights": [1, "a"]}}})",
            "model.loss.weights = [1,\"a\"]: must be an array of numbers in [0.0, 10.0]");
    refused(R"({"optimizer": 3})", "optimizer = 3: must be an object");
}

TEST_CASE("whole numbers are exact up to the ends of 64 bits and refused beyond") {
    Example example;
    ConfigSchema schema = schema_of(example);
    schema.read_text(R"({"seed": 9223372036854775807})", "a.json");
    CHECK(example.seed == std::numeric_limits<std::int64_t>::max());
    schema.read_text(R"({"seed": -9223372036854775808})", "a.json");
    CHECK(example.seed == std::numeric_limits<std::int64_t>::min());
    schema.read_text(R"({"seed": 9007199254740993})", "a.json");
    CHECK(example.seed == 9007199254740993);
    CHECK_THAT(message_of_text(R"({"seed": 9223372036854775808})"),
               Contains("must be an integer in [-9223372036854775808, 9223372036854775807]"));
    CHECK_THAT(message_of_text(R"({"seed": 1e19})"), Contains("must be an integer"));
}

TEST_CASE("an unknown key of any length is refused at once") {
    const std::string key(2000000, 'k');
    CHECK_THAT(message_of_text("{\"" + key + "\": 1}"),
               Contains("a.json: kkkk") && EndsWith("kkk...: unknown key"));
}

TEST_CASE("a key given twice is refused, in whatever spelling") {
    CHECK_THAT(message_of_text(R"({"seed": 1, "seed": 2})"),
               Contains("a.json") && Contains("\"seed\" is given twice"));
    CHECK_THAT(message_of_text(R"({"optimizer": {"steps": 1}, "optimizer": {"steps": 2}})"),
               Contains("\"optimizer\" is given twice"));
    CHECK_THAT(message_of_text(R"({"optimizer.steps": 1})"),
               Contains("optimizer.steps: must be written as nested objects"));
    CHECK_THAT(message_of_text(R"({"data": {"folder": "steps"}, "optimizer": {"steps": 1}})"),
               Equals("no error"));
}

TEST_CASE("what is not JSON is refused with its line") {
    CHECK_THAT(message_of_text("{\n\"seed\": 1,\n}"), Equals("a.json: not JSON at line 3"));
    CHECK_THAT(message_of_text(""), Equals("a.json: not JSON at line 1"));
    CHECK_THAT(message_of_text("[]"), Contains("must be a JSON object"));
    CHECK_THAT(message_of_text(R"({"seed": 1e999})"), Equals("a.json: a number is too large"));
}

TEST_CASE("a file changes what its parents say") {
    const ScratchFolder folder;
    require_writable_folder(folder / "base");
    write_file(folder / "base/root.json",
               R"({"seed": 1, "optimizer": {"steps": 10, "learning_rate": 0.5}})");
    write_file(folder / "base/middle.json",
               R"({"parent": "root.json", "optimizer": {"steps": 20}})");
    write_file(folder / "leaf.json",
               R"({"optimizer": {"learning_rate": 0.25}, "parent": "base/middle.json"})");
    Example example;
    ConfigSchema schema = schema_of(example);
    schema.read_file(folder / "leaf.json");
    CHECK(example.seed == 1);
    CHECK(example.steps == 20);
    CHECK(example.learning_rate == 0.25);
}

TEST_CASE("parents that are missing, wrong or lead in a circle are refused") {
    const ScratchFolder folder;
    write_file(folder / "a.json", R"({"parent": "b.json"})");
    write_file(folder / "b.json", R"({"parent": "./a.json"})");
    write_file(folder / "self.json", R"({"parent": "self.json"})");
    write_file(folder / "lost.json", R"({"parent": "none.json"})");
    write_file(folder / "wrong.json", R"({"parent": 3})");
    write_file(folder / "bad_parent.json", R"({"parent": "wrong_key.json"})");
    write_file(folder / "wrong_key.json", R"({"sead": 3})");
    Example example;
    ConfigSchema schema = schema_of(example);
    CHECK_THROWS_WITH(schema.read_file(folder / "a.json"), Contains("lead back to itself"));
    CHECK_THROWS_WITH(schema.read_file(folder / "self.json"), Contains("lead back to itself"));
    CHECK_THROWS_WITH(schema.read_file(folder / "lost.json"),
                      Contains("none.json: cannot be read"));
    CHECK_THROWS_WITH(schema.read_file(folder / "wrong.json"),
                      Contains("parent = 3: must be a file name"));
    CHECK_THROWS_WITH(schema.read_file(folder / "bad_parent.json"),
                      Contains("wrong_key.json: sead: unknown key; did you mean seed?"));
    CHECK_THROWS_AS(schema.read_file(folder / "none.json"), FileError);
    CHECK_THAT(message_of_text(R"({"parent": "b.json"})"),
               Contains("parent: only a file can have one"));
}

TEST_CASE("the command line overrides single keys") {
    Example example;
    ConfigSchema schema = schema_of(example);
    schema.set("optimizer.learning_rate=1e-3");
    schema.set("optimizer.schedule=cosine");
    schema.set("data.mirror=false");
    schema.set("model.widths=[1, 2, 3]");
    CHECK(example.learning_rate == 1e-3);
    CHECK(example.schedule == "cosine");
    CHECK_FALSE(example.mirror);
    CHECK(example.widths == std::vector<std::int64_t>{1, 2, 3});

    for (const std::string word : {"a b=c", "2024", "true", "", "1e999", "[x"}) {
        schema.set("data.folder=" + word);
        CHECK(example.folder == word);
    }
    schema.set("data.folder=\"quoted\"");
    CHECK(example.folder == "quoted");
}

TEST_CASE("overrides that are no assignment or do not fit are refused") {
    CHECK_THAT(message_of_set("optimizer.steps"), Contains("must be key=value"));
    CHECK_THAT(message_of_set("=3"), Contains("must be key=value"));
    CHECK_THAT(message_of_set("optimizer.steps=many"),
               Equals("command line: optimizer.steps = \"many\": must be an integer in [1, 1000]"));
    CHECK_THAT(message_of_set("optimizer.steps="), Contains("must be an integer"));
    CHECK_THAT(message_of_set("optimizer.steps=1e999"), Contains("must be an integer"));
    CHECK_THAT(message_of_set("optimizer.steps=\xff"), Contains("UTF-8"));
    CHECK_THAT(message_of_set("data.folder=\xff"), Contains("must be UTF-8"));
}

TEST_CASE("the complete configuration reads back as it was") {
    Example example;
    example.learning_rate = 0.1;
    example.seed = std::numeric_limits<std::int64_t>::min();
    example.folder = "with \"quotes\"";
    const std::string json = schema_of(example).to_json();
    CHECK_THAT(json, Contains("\"optimizer\": {\n    \"steps\": 100,\n    \"learning_rate\": "
                              "0.1,\n    \"schedule\": \"epoch\"\n  }"));
    Example read;
    ConfigSchema schema = schema_of(read);
    schema.read_text(json, "config.json");
    CHECK(schema.to_json() == json);
    CHECK(read.seed == example.seed);
    CHECK(read.folder == example.folder);
}

TEST_CASE("the table shows defaults, not present values") {
    Example example;
    ConfigSchema schema = schema_of(example);
    schema.set("optimizer.steps=7");
    const std::string table = schema.to_markdown();
    CHECK_THAT(
        table,
        Contains("| `optimizer.steps` | `100` | an integer in [1, 1000] | optimiser steps |\n"));
    CHECK_THAT(table, Contains("| `optimizer.schedule` | `\"epoch\"` | one of epoch, cosine | of "
                               "the learning rate |\n"));
    CHECK_THAT(schema.to_json(), Contains("\"steps\": 7"));
}

TEST_CASE("a key cannot be bound twice") {
    Example example;
    ConfigSchema schema = schema_of(example);
    CHECK_THROWS_AS(schema.integer("seed", example.steps, 0, 1, "again"), ConfigError);
}
