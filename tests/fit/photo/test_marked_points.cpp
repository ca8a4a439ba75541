#include <catch2/catch.hpp>

#include "core/error.h"
#include "core/io/file.h"
#include "core/io/scratch_folder.h"
#include "fit/photo/marked_points.h"

using namespace stymo;
using Catch::Matchers::Contains;

TEST_CASE("Distances to marked points are in units of the marked outer corners of the eyes") {
    MarkedPhoto marked{"a.jpg", {{36, {10.0, 20.0}}, {45, {60.0, 20.0}}, {8, {35.0, 90.0}}}};
    Landmarks found;
    found.fill({0.0, 0.0});
    found[36] = {10.0, 20.0};
    found[45] = {63.0, 24.0};
    found[8] = {35.0, 100.0};
    std::map<std::string, PointError> errors;
    add_errors(marked, found, errors);
    CHECK(errors["eyes"].mean() == Approx(0.05));
    CHECK(errors["eyes"].count == 2);
    CHECK(errors["chin"].mean() == Approx(0.2));
    CHECK(errors["all"].mean() == Approx(0.1));
    CHECK(PointError().mean() == 0.0);
    std::map<std::size_t, PointOffset> offsets;
    add_offsets(marked, found, offsets);
    CHECK((offsets[45].sum - Eigen::Vector2d(0.06, 0.08)).norm() < 1e-12);
    CHECK((offsets[8].sum - Eigen::Vector2d(0.0, 0.2)).norm() < 1e-12);
    CHECK((without_offsets(marked, found, offsets)[45] - marked.points[45]).norm() < 1e-12);
}

TEST_CASE("The marked portraits have the points that their page names") {
    const std::vector<MarkedPhoto> photos = read_marked_photos(
        std::filesystem::path(STYMO_SOURCE_DIR) / "tests/fit/photo/marked_portraits.json");
    CHECK(photos.size() == 20);
    for (const MarkedPhoto& photo : photos)
        for (const std::size_t k : {8U, 30U, 33U, 36U, 39U, 42U, 45U, 48U, 51U, 54U, 57U})
            CHECK(photo.points.contains(k));
}

TEST_CASE("A file of marked points that is malformed is refused with its name and reason") {
    const ScratchFolder folder;
    const auto refusal = [&](const std::string& text) {
        write_file(folder / "marks.json", text);
        try {
            (void)read_marked_photos(folder / "marks.json");
        } catch (const FileError& error) {
            return std::string(error.what());
        }
        return std::string("accepted");
    };
    CHECK_THAT(refusal("{"), Contains("marks.json: not {"));
    CHECK_THAT(refusal(R"({"photos": []})"), Contains("\"photos\" is empty"));
    CHECK_THAT(refusal(R"({"photos": [{"file": "a", "points": {"68": [1, 2]}}]})"),
               Contains("\"68\" is not the number of a point"));
    CHECK_THAT(refusal(R"({"photos": [{"file": "a", "points": {"36": [1, 2]}}]})"),
               Contains("a needs two different points 36 and 45"));
    CHECK_THAT(refusal(R"({"photos": [{"file": "a", "points": {"36": [1]}}]})"),
               Contains("not {\"photos\""));
}
