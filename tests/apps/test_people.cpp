#include <catch2/catch.hpp>
#include <nlohmann/json.hpp>
#include <sstream>

#include "apps/eval/commands.h"
#include "apps/tiny_run.h"
#include "core/error.h"
#include "core/io/file.h"
#include "core/io/scratch_folder.h"
#include "support/error_message.h"

namespace people_tests {

namespace fs = std::filesystem;
using namespace stymo;
using namespace stymo::test;
using nlohmann::json;

TEST_CASE("Codes that tell people apart have a score of one, and a wrong name is found") {
    // Three people with two photos each, in three directions of the space of codes.
    const std::vector<std::vector<double>> codes{{9, 0, 0}, {8, 1, 0}, {0, 9, 1},
                                                 {0, 8, 0}, {1, 0, 9}, {0, 0, 8}};
    const PeopleScore right = people_score(codes, {"a", "a", "b", "b", "c", "c"});
    CHECK(right.photos == 6);
    CHECK(right.people == 3);
    CHECK(right.nearest == 1.0);
    CHECK(right.apart == 1.0);
    CHECK(right.doubtful.empty());
    CHECK(right.same_cosine > 0.9);
    CHECK(right.other_cosine < 0.0);

    // The last photo of b is named c.
    const PeopleScore mixed = people_score(codes, {"a", "a", "", "c", "c", "c"});
    CHECK(mixed.people == 2);
    CHECK(mixed.nearest == Approx(0.8));
    CHECK(mixed.apart == 0.5);
    REQUIRE(mixed.doubtful.size() == 1);
    CHECK(mixed.doubtful.front() == std::pair<std::size_t, std::size_t>{3, 2});

    CHECK_THROWS_AS(people_score(codes, {"a", "b", "c", "d", "", ""}), ValueError);
    CHECK_THROWS_AS(people_score({{9, 0}, {8, 1}}, {"a", "a"}), ValueError);  // of one person
}

TEST_CASE("stymo-eval people reads the names of a folder") {
    const ScratchFolder scratch;
    fs::copy(tiny_run() / "faces", scratch.path() / "faces", fs::copy_options::recursive);
    const fs::path list = scratch.path() / "faces/faces.jsonl";
    std::istringstream lines(read_file(list));
    std::string line, named;
    for (int number = 0; std::getline(lines, line); ++number) {
        json record = json::parse(line);
        if (number < 4 || record["id"] == "00011") record["person"] = number < 2 ? "one" : "two";
        named += record.dump() + "\n";
    }
    write_file(list, named);
    // The third photo of person "two" cannot be read, and is passed over.
    write_file(scratch.path() / "faces/images/00011.png", "no image");
    PeopleOptions options;
    options.model = {tiny_run() / "run/model.safetensors", {}};
    options.data = scratch.path() / "faces";
    const json result = json::parse(evaluate_people(options).json.text());
    CHECK(result["photos"] == 4);
    CHECK(result["people"] == 2);
    CHECK(result["nearest"].get<double>() + 0.25 * static_cast<double>(result["doubtful"].size()) ==
          Approx(1.0));
    options.data = tiny_run() / "faces";
    CHECK_THAT(error_message<ValueError>([&] { static_cast<void>(evaluate_people(options)); }),
               Catch::Contains("no person has two photos"));
}

}  // namespace people_tests
