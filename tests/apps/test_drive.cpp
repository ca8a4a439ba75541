// stymo-fit --video and stymo-drive on a film of a rendered head.
#include <algorithm>
#include <catch2/catch.hpp>
#include <cctype>
#include <cmath>
#include <filesystem>
#include <iostream>
#include <nlohmann/json.hpp>
#include <sstream>

#include "apps/drive/film_report.h"
#include "apps/tiny_run.h"
#include "apps/tool_run.h"
#include "core/io/file.h"
#include "core/io/film.h"
#include "core/io/image.h"
#include "core/metrics.h"
#include "fit/photo/face_detector.h"
#include "fit/video/acted_frame.h"
#include "render/morphable/arkit_shapes.h"
#include "support/mp3_frame.h"

namespace drive_tests {

namespace {

namespace fs = std::filesystem;
using namespace stymo;
using nlohmann::json;

constexpr int frame_count = 14;
const std::string settings = " --model run/model.safetensors ";
const std::string fit_settings = settings + "--key-steps 2 --frame-steps 1 ";

/// A head that moves to the right, is gone in three frames, and comes back after a cut.
bool has_film() {
    if (!FaceDetector::available()) {
        std::cout << "skipped: built without dlib\n";
        return false;
    }
    if (fs::exists(tiny_run() / "film.mp4")) return true;
    REQUIRE(run_tool(tiny_run(), "stymo-synth --out actor --count 1 --size 256").exit_code == 0);
    const Tensor head = read_image(tiny_run() / "actor/images/00000.png");
    FilmWriter writer(tiny_run() / "film.mp4", tiny_run() / "film.mp4", 256, 320, 25.0);
    FilmWriter empty(tiny_run() / "empty.mp4", tiny_run() / "empty.mp4", 256, 320, 25.0);
    for (int i = 0; i < frame_count; ++i) {
        Tensor frame = Tensor::full({256, 320, 3}, i < 10 ? 0.2 : 0.8);
        empty.add(frame);
        const std::size_t left = i < 10 ? static_cast<std::size_t>(2 * i) : 60;
        for (std::size_t row = 0; row < 256 && (i < 5 || i > 7); ++row)
            std::copy_n(head.values<float>().begin() + static_cast<std::ptrdiff_t>(row * 256 * 3),
                        256 * 3,
                        frame.mutable_values<float>().begin() +
                            static_cast<std::ptrdiff_t>((row * 320 + left) * 3));
        writer.add(frame);
    }
    writer.finish();
    empty.finish();
    write_file(tiny_run() / "sound.mp3", mp3_frames(20));
    add_sound(tiny_run() / "sound.mp3", tiny_run() / "film.mp4");
    return true;
}

/// The first line of a recording, and one without rotations in which the jaw is open.
std::pair<std::string, std::string> open_jaw() {
    std::string header = "Timecode,BlendShapeCount", row = "00:00:00:00.000,61";
    for (std::string name : arkit_names) {
        name[0] = static_cast<char>(std::toupper(name[0]));
        header += ',' + name;
        row += name == "JawOpen" ? ",0.8" : ",0";
    }
    return {header, row};
}

}  // namespace

TEST_CASE("A film is fitted frame by frame as one person, and frames without a face hold") {
    if (!has_film()) return;
    const ToolOutcome outcome =
        run_tool(tiny_run(), "stymo-fit --video film.mp4 --out film --json" + fit_settings);
    INFO(outcome.err);
    REQUIRE(outcome.exit_code == 0);
    const json report = json::parse(outcome.out);
    CHECK(report["frames"] == frame_count);
    CHECK(report["held"] == 3);
    CHECK(report["cuts"] == 1);
    CHECK(report["shots"] == 3);
    std::istringstream text(read_file(tiny_run() / "film/codes.jsonl"));
    std::vector<json> lines;
    for (std::string line; std::getline(text, line);) lines.push_back(json::parse(line));
    REQUIRE(lines.size() == frame_count);
    for (std::size_t i = 0; i < lines.size(); ++i) {
        CHECK(lines[i]["frame"] == i);
        CHECK(lines[i]["face"] == (i < 5 || i > 7));
        CHECK(lines[i]["starts"] == (i == 0 || i == 8 || i == 10));
        for (const char* group : {"id", "tex", "light"})
            CHECK(lines[i]["code"][group] == lines[0]["code"][group]);
    }
    CHECK(lines[6]["code"] == lines[4]["code"]);
    CHECK(lines[6]["pose"] == lines[4]["pose"]);
    CHECK(lines[9]["code"]["expr"] != lines[4]["code"]["expr"]);
}

TEST_CASE("A face is driven by a film, and the new film is as long and sounds alike") {
    if (!has_film()) return;
    const ToolOutcome outcome = run_tool(
        tiny_run(),
        "stymo-drive --codes fit/codes.json --video film.mp4 --out out.mp4 --measure" + settings);
    INFO(outcome.err);
    REQUIRE(outcome.exit_code == 0);
    CHECK_THAT(outcome.out, Catch::Contains("3 frames without the face hold the last one") &&
                                Catch::Contains("acceleration of landmarks"));
    FilmReader reader(tiny_run() / "out.mp4");
    CHECK(reader.frames_per_second() == Approx(25.0));
    int count = 0;
    while (const std::optional<Tensor> frame = reader.next()) {
        CHECK(frame->shape() == Shape{64, 64, 3});
        ++count;
    }
    CHECK(count == frame_count);
    CHECK_THAT(outcome.out, Catch::Contains("sound: kept"));
    const std::string bytes = read_file(tiny_run() / "out.mp4");
    for (int i = 0; i < 20; ++i) CHECK(bytes.find(mp3_frame(i)) != std::string::npos);
}

TEST_CASE("Of a long film a part is enough, whose frames keep their numbers") {
    if (!has_film()) return;
    const std::string part = " --first-frame 2 --every 3 --most-frames 3 ";
    const ToolOutcome fit =
        run_tool(tiny_run(), "stymo-fit --video film.mp4 --out part" + part + fit_settings);
    INFO(fit.err);
    REQUIRE(fit.exit_code == 0);
    CHECK_THAT(fit.err, Catch::Contains("reading") && Catch::Contains("frames   0% 0/3"));
    std::istringstream text(read_file(tiny_run() / "part/codes.jsonl"));
    std::vector<int> numbers;
    std::vector<bool> faces;
    for (std::string line; std::getline(text, line);) {
        numbers.push_back(json::parse(line)["frame"]);
        faces.push_back(json::parse(line)["face"]);
    }
    CHECK(numbers == std::vector{2, 5, 8});
    CHECK(faces == std::vector{true, false, true});

    const ToolOutcome drive =
        run_tool(tiny_run(),
                 "stymo-drive --codes fit/codes.json --video film.mp4 --out part.mp4 "
                 "--sheet part.png" +
                     part + settings);
    INFO(drive.err);
    REQUIRE(drive.exit_code == 0);
    CHECK_THAT(drive.out, Catch::Contains("sound: left out, because this is a part"));
    CHECK(FilmReader(tiny_run() / "part.mp4").frames_per_second() ==
          Approx(25.0 / 3.0).margin(1e-3));
    const Tensor sheet = read_image(tiny_run() / "part.png");
    REQUIRE(sheet.shape() == Shape{512, 3 * 320, 3});
    // The frame without the head, which is dark, and the one after the gap.
    const auto above = [&](std::int64_t column) {
        return std::ranges::max(image_part(sheet, 0, 320 * column, 256, 320).values<float>());
    };
    CHECK(above(1) < 0.4F);
    CHECK(above(2) > 0.4F);
    const ToolOutcome beyond =
        run_tool(tiny_run(), "stymo-fit --video film.mp4 --out beyond --first-frame 99" + settings);
    CHECK(beyond.exit_code == 1);
    CHECK_THAT(beyond.err, Catch::Contains("holds no frames from the first wanted one on"));
}

TEST_CASE("Landmarks of a head that is moved are off by as much") {
    if (!has_film()) return;
    constexpr std::int64_t moved = 9;
    double eyes = 0.0;
    for (const char* name : {"still.mp4", "moved.mp4"}) {
        FilmWriter writer(tiny_run() / name, tiny_run() / name, video_tests::frame_height,
                          video_tests::frame_width, 25.0);
        for (int i = 0; i < 3; ++i) {
            Tensor frame = video_tests::empty_frame(0.35);
            const std::int64_t left = 100 + 20 * i + (name[0] == 'm' ? moved : 0);
            eyes = inter_ocular_distance(video_tests::draw(frame, 1, {.left = left}));
            writer.add(frame);
        }
        writer.finish();
    }
    const FaceDetector detector;
    const fs::path still = tiny_run() / "still.mp4";
    const LandmarkError none = landmark_error(still, still, detector);
    CHECK(none.frames == 3);
    CHECK(none.mouth == 0.0);
    const LandmarkError error = landmark_error(tiny_run() / "moved.mp4", still, detector);
    CHECK(error.face == Approx(100.0 * moved / eyes).epsilon(0.25));
    CHECK(error.mouth == Approx(100.0 * moved / eyes).epsilon(0.25));
}

TEST_CASE("A face is driven by coefficients of ARKit's shapes and rotations of the head") {
    static_cast<void>(tiny_run());
    const auto take = open_jaw();
    const std::string &header = take.first, &row = take.second;
    const auto drive = [&](const std::string& rows) {
        write_file(tiny_run() / "take.csv", header + ",HeadYaw,HeadPitch,HeadRoll\n" + rows);
        return run_tool(tiny_run(),
                        "stymo-drive --codes fit/codes.json --model run/model.safetensors "
                        "--coefficients take.csv --out coefficients.mp4 --rate 30 --explain");
    };
    const ToolOutcome outcome =
        drive(row + ",0,0,0\n" + row + ",0.6,0,0\n00:00:00:02.000,0\n" + row + ",-0.6,0,0\n");
    INFO(outcome.err);
    REQUIRE(outcome.exit_code == 0);
    CHECK_THAT(outcome.out, Catch::StartsWith("4 frames, "));
    CHECK_THAT(outcome.err,
               Catch::Contains("the face at rest: at worst") && Catch::Contains("field points"));
    FilmReader reader(tiny_run() / "coefficients.mp4");
    CHECK(reader.frames_per_second() == Approx(30.0));
    std::vector<Tensor> frames;
    while (std::optional<Tensor> frame = reader.next()) frames.push_back(std::move(*frame));
    REQUIRE(frames.size() == 4);
    const auto difference = [&](std::size_t a, std::size_t b) {
        return mean_absolute_error(frames[a], frames[b]);
    };
    // A row without a face repeats the one before.
    CHECK(difference(1, 2) <= 0.5 * difference(0, 1) + 0.002);
    fs::remove(tiny_run() / "coefficients.mp4");
    const std::vector<std::pair<std::string, std::string>> bad{
        {"", "take.csv: holds no coefficients"},
        {row + ",45,0,0\n", "line 2: HeadYaw is \"45\", expected a number from -3.14"},
        {row + ",0\n", "line 2 has 55 cells, the first 57"}};
    for (const auto& [rows, words] : bad) {
        const ToolOutcome refused = drive(rows);
        CHECK(refused.exit_code == 1);
        CHECK(line_count(refused.err) == 1);
        CHECK_THAT(refused.err, Catch::Contains(words));
        CHECK_FALSE(fs::exists(tiny_run() / "coefficients.mp4"));
    }
}

TEST_CASE("Absolute expressions replace those of the face") {
    static_cast<void>(tiny_run());
    json codes = json::parse(read_file(tiny_run() / "fit/codes.json"));
    for (json& number : codes["code"]["expr"]) number = number.get<double>() + 1.0;
    write_file(tiny_run() / "smiling.json", codes.dump());
    const auto [header, row] = open_jaw();
    write_file(tiny_run() / "jaw.csv", header + '\n' + row + '\n');
    const auto driven = [&](const std::string& face, const std::string& options) {
        const ToolOutcome outcome = run_tool(
            tiny_run(), "stymo-drive --codes " + face +
                            " --model run/model.safetensors --coefficients jaw.csv --out jaw.mp4" +
                            options);
        INFO(outcome.err);
        REQUIRE(outcome.exit_code == 0);
        return FilmReader(tiny_run() / "jaw.mp4").next().value();
    };
    const auto difference = [&](const std::string& options) {
        return mean_absolute_error(driven("fit/codes.json", options),
                                   driven("smiling.json", options));
    };
    CHECK(difference(" --absolute") == 0.0);
    CHECK(difference("") > 0.0);
}

TEST_CASE("Films that cannot be used are refused with one line, and nothing is written", "[slow]") {
    if (!has_film()) return;
    const std::string film = read_file(tiny_run() / "film.mp4");
    write_file(tiny_run() / "cut.mp4", film.substr(0, film.size() / 2));
    const auto refused = [](const std::string& command, const std::string& words) {
        const ToolOutcome outcome = run_tool(tiny_run(), command + settings);
        CHECK(outcome.exit_code != 0);
        // Progress may stand above it.
        const std::size_t error = outcome.err.rfind("stymo-", outcome.err.find(words));
        REQUIRE(error != std::string::npos);
        CHECK(outcome.err.find("stymo-") == error);
        CHECK(line_count(outcome.err.substr(error)) == 1);
        CHECK_FALSE(fs::exists(tiny_run() / "none.mp4"));
        CHECK_FALSE(fs::exists(tiny_run() / "none"));
    };
    const std::string drive = "stymo-drive --out none.mp4 --codes ";
    refused("stymo-fit --out none --video empty.mp4", "empty.mp4: no face was found");
    refused(drive + "fit/codes.json --video empty.mp4", "empty.mp4: no face was found");
    refused(drive + "fit/codes.json --video cut.mp4", "cut.mp4: no film that can be read");
    refused(drive + "fit/codes.json --video text.png", "text.png: no film");
    refused(drive + "fit/codes.json --video missing.mp4", "missing.mp4: no such file");
    refused(drive + "tiny.json --video film.mp4", "tiny.json: not a code file");
    refused("stymo-drive --codes fit/codes.json --video film.mp4 --out none.avi", "must end in");
    refused("stymo-drive --codes fit/codes.json --video film.mp4 --out film.mp4",
            "film.mp4, which is read, would be replaced");
    CHECK(read_file(tiny_run() / "film.mp4") == film);
    refused(drive + "fit/codes.json --video film.mp4 --truth missing.mp4", "no such file");
    refused(drive + "fit/codes.json --video film.mp4 --sheet a.gif", "must end in");
    refused(drive + "fit/codes.json", "give --video or --coefficients");
    refused(drive + "fit/codes.json --coefficients text.png", "must end in .csv or .json");
    json codes = json::parse(read_file(tiny_run() / "fit/codes.json"));
    codes["model"] = "0";
    write_file(tiny_run() / "other.json", codes.dump());
    refused(drive + "other.json --video film.mp4", "other.json: holds codes of another model");
}

TEST_CASE("Even motion has no acceleration, and noise has that of its second difference") {
    LandmarkJitter even, noisy;
    for (int t = 0; t < 5; ++t) {
        Landmarks face;
        for (std::size_t i = 0; i < face.size(); ++i) face[i] = {3.0 * t, 0.0};
        // The centres of the eyes are 50 pixels apart.
        for (std::size_t i = 42; i < 48; ++i) face[i].x() += 50.0;
        even.add(face);
        for (Eigen::Vector2d& point : face) point.y() += t % 2 == 0 ? 1.0 : 0.0;
        noisy.add(face);
    }
    CHECK(even.mean() == Approx(0.0).margin(1e-12));
    CHECK(noisy.mean() == Approx(100.0 * 2.0 / 50.0));
    CHECK(std::isnan(LandmarkJitter().mean()));
}

}  // namespace drive_tests
