// stymo-prep and stymo-fit on photos as they come, played by rendered heads.
#include <unistd.h>

#include <catch2/catch.hpp>
#include <csignal>
#include <fstream>
#include <iostream>
#include <nlohmann/json.hpp>
#include <set>
#include <sstream>

#include "apps/common/child_process.h"
#include "apps/tiny_run.h"
#include "apps/tool_run.h"
#include "core/io/file.h"
#include "core/io/image.h"
#include "fit/photo/face_detector.h"
#include "train/data/dataset.h"
#include "train/data/folder_scan.h"

namespace prep_tests {

namespace {

namespace fs = std::filesystem;
using nlohmann::json;
using stymo::run_tool;
using stymo::tiny_run;
using stymo::ToolOutcome;

ToolOutcome done(const std::string& command) {
    ToolOutcome outcome = run_tool(tiny_run(), command);
    INFO(command << "\n" << outcome.err);
    CHECK(outcome.exit_code == 0);
    return outcome;
}

std::set<std::string> names_in(const fs::path& folder) {
    std::set<std::string> names;
    for (const auto& entry : fs::directory_iterator(folder))
        names.insert(entry.path().filename().string());
    return names;
}

std::vector<json> records_in(const fs::path& file) {
    std::istringstream text(stymo::read_file(file));
    std::vector<json> records;
    for (std::string line; std::getline(text, line);) records.push_back(json::parse(line));
    return records;
}

/// The first heads of the tiny run with their landmarks and masks, and a file that is no image.
fs::path photos_with_landmarks(const std::string& name, int count) {
    const fs::path folder = tiny_run() / name;
    fs::create_directories(folder / "images");
    fs::create_directories(folder / "masks");
    std::string lines;
    for (const json& record : records_in(tiny_run() / "faces/faces.jsonl")) {
        if (count-- == 0) break;
        const std::string file = record["id"].get<std::string>() + ".png";
        for (const char* kind : {"images", "masks"})
            fs::copy_file(tiny_run() / "faces" / kind / file, folder / kind / file,
                          fs::copy_options::overwrite_existing);
        lines += json{{"id", record["id"]},
                      {"landmarks", record["landmarks"]},
                      {"person", "of " + record["id"].get<std::string>()},
                      {"series", "studio"},
                      {"source", "albums"},
                      {"take", "noon"}}
                     .dump() +
                 "\n";
    }
    fs::copy_file(tiny_run() / "zero.png", folder / "images/zero.png",
                  fs::copy_options::overwrite_existing);
    const json landmarks = records_in(tiny_run() / "faces/faces.jsonl").front()["landmarks"];
    stymo::write_file(folder / "faces.jsonl",
                      lines + json{{"id", "zero"}, {"landmarks", landmarks}}.dump() + "\n");
    return folder;
}

bool has_detector() {
    if (!stymo::FaceDetector::available()) std::cout << "skipped: built without dlib\n";
    return stymo::FaceDetector::available();
}

}  // namespace

TEST_CASE(
    "stymo-prep makes a folder with poses, codes and overlays that trains, and names what it left "
    "out") {
    const fs::path& folder = tiny_run();
    photos_with_landmarks("photos", 3);
    const json report =
        json::parse(done("stymo-prep --photos photos --out prepared --size 64 --json").out);
    CHECK(report["found"] == 4);
    CHECK(report["ok"] == 3);
    CHECK(report["faces"] == 3);
    CHECK(report["made_masks"] == 0);
    CHECK(report["failed"] ==
          json{{{"file", "photos/images/zero.png"}, {"reason", "not an image (zero bytes)"}}});
    CHECK(report == json::parse(stymo::read_file(folder / "prepared/report.json")));
    CHECK(names_in(folder / "prepared") == std::set<std::string>{"camera.json", "faces.jsonl",
                                                                 "images", "masks", "overlays",
                                                                 "report.json", "unknown"});
    for (const std::string& name : names_in(folder / "prepared/unknown"))
        CHECK(stymo::read_mask(folder / "prepared/unknown" / name).shape() ==
              stymo::Shape{64, 64, 1});
    CHECK(names_in(folder / "prepared/images") ==
          std::set<std::string>{"00000.png", "00001.png", "00002.png"});
    CHECK(names_in(folder / "prepared/masks") == names_in(folder / "prepared/images"));
    CHECK(stymo::read_image(folder / "prepared/overlays/sheet_000.png").shape() ==
          stymo::Shape{192, 3 * 192, 3});
    const std::vector<json> truth = records_in(folder / "faces/faces.jsonl");
    const std::vector<json> found = records_in(folder / "prepared/faces.jsonl");
    REQUIRE(found.size() == 3);
    for (std::size_t i = 0; i < found.size(); ++i) {
        CHECK(found[i]["id"] == truth[i]["id"]);
        CHECK(found[i]["pose"]["yaw_deg"].get<double>() ==
              Approx(truth[i]["pose"]["yaw_deg"].get<double>()).margin(5.0));
        CHECK(found[i]["code"]["expr"].size() == 79);
        CHECK(found[i]["person"] == "of " + found[i]["id"].get<std::string>());
        CHECK(found[i]["series"] == "studio");
        CHECK(found[i]["source"] == "albums");
        CHECK(found[i]["take"] == "noon");
    }
    done(
        "stymo-train --config tiny.json --data prepared --out prepared_run --set stage1.steps=1 "
        "--set data.split.test=0");
    const ToolOutcome again =
        run_tool(folder, "stymo-prep --photos photos --out prepared --size 64");
    CHECK(again.exit_code == 1);
    CHECK_THAT(again.err, Catch::Contains("prepared: exists already"));
}

TEST_CASE("Poses are fitted for the focal length that heads were rendered with") {
    const fs::path& folder = tiny_run();
    done("stymo-synth --out far --count 3 --size 64 --focal 4.06 --seed 3");
    done("stymo-prep --photos far --out prepared_far --size 64 --focal 4.06 --no-overlay");
    const std::vector<json> truth = records_in(folder / "far/faces.jsonl");
    const std::vector<json> found = records_in(folder / "prepared_far/faces.jsonl");
    REQUIRE(found.size() == 3);
    for (std::size_t i = 0; i < found.size(); ++i) {
        const auto distance = [](const json& record) {
            const auto t = record["pose"]["t"].get<std::array<double, 3>>();
            return Eigen::Vector3d(t.data()).norm();
        };
        CHECK(distance(truth[i]) == Approx(2.0 * 5.3).margin(0.4));
        CHECK(distance(found[i]) == Approx(distance(truth[i])).epsilon(0.1));
        CHECK(found[i]["pose"]["yaw_deg"].get<double>() ==
              Approx(truth[i]["pose"]["yaw_deg"].get<double>()).margin(5.0));
    }
    CHECK(json::parse(stymo::read_file(folder / "prepared_far/camera.json"))["focal"] == 4.06);
}

TEST_CASE("Folders of persons are prepared with paths as ids, and what is no photo is named") {
    const fs::path& folder = tiny_run();
    const json landmarks = records_in(folder / "faces/faces.jsonl").front()["landmarks"];
    std::string lines;
    for (const char* person : {"anna", "ben"}) {
        for (const char* kind : {"images", "masks"}) {
            fs::create_directories(folder / "persons" / kind / person);
            fs::copy_file(folder / "faces" / kind / "00000.png",
                          folder / "persons" / kind / person / "1.png");
        }
        lines += json{{"id", std::string(person) + "/1"}, {"landmarks", landmarks}}.dump() + "\n";
    }
    stymo::write_file(folder / "persons/faces.jsonl", lines);
    stymo::write_file(folder / "persons/images/note.txt", "no photo");
    const json report = json::parse(
        done("stymo-prep --photos persons --out prepared_persons --size 32 --json").out);
    CHECK(report["ok"] == 2);
    CHECK(report["photos"] == json{"anna/1", "ben/1"});
    CHECK(report["left_out"] ==
          json{{{"file", "persons/images/note.txt"}, {"reason", "not an image"}}});
    const stymo::FolderScan scan = stymo::scan_folder(folder / "prepared_persons");
    REQUIRE(scan.faces.size() == 2);
    for (const stymo::FaceFiles& face : scan.faces) {
        CHECK(face.image == folder / "prepared_persons/images" / (face.id + ".png"));
        CHECK(face.mask == folder / "prepared_persons/masks" / (face.id + ".png"));
        CHECK(scan.records.find(face.id) != nullptr);
    }
}

TEST_CASE("A preparation that was stopped goes on with the next call, as if it had not been",
          "[slow]") {
    const fs::path folder = photos_with_landmarks("many", 12).parent_path();
    done("stymo-prep --photos many --out in_one_go --size 32");
    stymo::RunningTool first(folder, "stymo-prep",
                             stymo::words("--photos many --out in_two --size 32"));
    REQUIRE(first.says("Photos"));
    // Past the first batch.
    for (int i = 0; i < 600; ++i) {
        if (fs::exists(folder / "in_two/progress.jsonl") &&
            stymo::line_count(stymo::read_file(folder / "in_two/progress.jsonl")) > 1)
            break;
        ::usleep(100000);
    }
    first.send(SIGINT);
    const ToolOutcome stopped = first.wait();
    CHECK(stopped.exit_code == 1);
    CHECK_THAT(stopped.err, Catch::Contains("photos; the same command continues from there"));
    // What is done is a data set, whose split is that of the whole folder.
    const stymo::FolderScan so_far = stymo::scan_folder(folder / "in_two");
    CHECK(so_far.faces.size() < 12);
    CHECK(so_far.records.size() == std::ssize(so_far.faces));
    CHECK(so_far.photo_ids.size() == 13);  // one of them is not an image
    CHECK(so_far.records.find(stymo::Dataset(folder / "in_two", 32, {.test = 2, .validation = 1},
                                             stymo::Split::test)
                                  .ids()
                                  .front()) != nullptr);
    const ToolOutcome other = run_tool(folder, "stymo-prep --photos many --out in_two --size 64");
    CHECK(other.exit_code == 1);
    CHECK_THAT(other.err, Catch::Contains("was begun with other settings (--size was 32, now 64)"));
    // A photo that was removed in between is in no part of the data set.
    std::string line = stymo::read_file(folder / "in_two/progress.jsonl");
    line = line.substr(0, line.find('\n') + 1);
    const json first_record = json::parse(line);
    json gone = first_record;
    gone["file"] = "images/gone.png";
    gone["faces"][0]["face"]["id"] = "gone";
    const std::string kept = first_record["faces"][0]["face"]["id"].get<std::string>() + ".png";
    for (const char* kind : {"images", "masks"})
        fs::copy_file(folder / "in_two" / kind / kept, folder / "in_two" / kind / "gone.png");
    std::ofstream(folder / "in_two/progress.jsonl", std::ios::app) << gone.dump() << '\n'
                                                                   << R"({"file":"images/000)";
    done("stymo-prep --photos many --out in_two --size 32");
    for (const char* part : {"", "images", "masks"})
        CHECK(names_in(folder / "in_two" / part) == names_in(folder / "in_one_go" / part));
    for (const char* file : {"faces.jsonl", "report.json", "camera.json", "images/00010.png",
                             "overlays/sheet_000.png"})
        CHECK(stymo::read_file(folder / "in_two" / file) ==
              stymo::read_file(folder / "in_one_go" / file));
}

TEST_CASE("A folder none of whose photos can be used leaves nothing behind") {
    const fs::path folder = photos_with_landmarks("unusable", 0);
    const ToolOutcome outcome =
        run_tool(tiny_run(), "stymo-prep --photos unusable --out unusable_set");
    CHECK(outcome.exit_code == 1);
    CHECK_THAT(
        outcome.err,
        Catch::Contains(
            "unusable: none of its 1 photos can be used; the first: unusable/images/zero.png: "
            "not an image (zero bytes)\n"));
    CHECK_FALSE(fs::exists(tiny_run() / "unusable_set"));
}

TEST_CASE("A copy of stymo-prep without the landmark network says that it uses dlib's") {
    const fs::path& folder = tiny_run();
    photos_with_landmarks("copied_photos", 1);
    // Deep enough that the program's search for configs/ above it ends within this folder.
    const fs::path copy = folder / "copied/to/a/deep/folder/stymo-prep";
    fs::create_directories(copy.parent_path());
    fs::copy_file(STYMO_BINARY_DIR "/bin/stymo-prep", copy);
    const stymo::ChildOutcome outcome = stymo::run_child(
        {copy.string(), "--photos", (folder / "copied_photos").string(), "--out",
         (folder / "copied/out").string(), "--size", "32", "--threads", "1", "--mask-net",
         STYMO_SOURCE_DIR "/configs/models/head-mask/network.safetensors"});
    CHECK(outcome.exit_code == 0);
    CHECK_THAT(outcome.err, Catch::Contains("warning: the landmark network that comes with stymo"));
}

TEST_CASE("A pose comes back from every form that stymo-prep pose writes") {
    const fs::path& folder = tiny_run();
    const json pose = json::parse(
        done("stymo-prep pose --yaw 20 --pitch -5 --roll 3 --out pose.json --json").out);
    CHECK(pose["pose"]["yaw_deg"].get<double>() == Approx(20.0));
    CHECK(pose == json::parse(stymo::read_file(folder / "pose.json")));
    const json record = {{"id", "a"}, {"pose", pose["pose"]}};
    const json other = {
        {"id", "b"},
        {"pose", {{"yaw_deg", 0}, {"pitch_deg", 0}, {"roll_deg", 0}, {"t", {0, 0, 5}}}}};
    const json labels = {{"labels", json::array({json::array({"00000/a.png", pose["eg3d"]})})}};
    std::ostringstream plain;
    for (const json& number : pose["eg3d"]) plain << number.get<double>() << ", ";
    const std::vector<std::pair<std::string, std::string>> forms = {
        {"form.json --json", pose["eg3d"].dump()},
        {"form.json --json", pose["world_from_camera"].dump()},
        {"form.json --json", pose["camera_from_world"].dump()},
        {"form.json --json", pose["pose"].dump()},
        {"form.json --json", plain.str()},
        {"form.json --json --id a", other.dump() + "\n" + record.dump() + "\n"},
        {"form.json --json --id 00000/a.png", labels.dump()}};
    for (const auto& [arguments, text] : forms) {
        stymo::write_file(folder / "form.json", text);
        const json back = json::parse(done("stymo-prep pose " + arguments).out);
        for (const char* angle : {"yaw_deg", "pitch_deg", "roll_deg"})
            CHECK(back["pose"][angle].get<double>() ==
                  Approx(pose["pose"][angle].get<double>()).margin(0.01));
        for (std::size_t axis = 0; axis < 3; ++axis)
            CHECK(back["pose"]["t"][axis].get<double>() ==
                  Approx(pose["pose"]["t"][axis].get<double>()).margin(0.001));
    }
    // The focal length of the file counts.
    const json tele = json::parse(
        done("stymo-prep pose --yaw 20 --focal 4.2647 --distance 10.2 --out tele.json --json").out);
    const json back = json::parse(done("stymo-prep pose tele.json --json").out);
    for (std::size_t i = 0; i < 25; ++i)
        CHECK(back["eg3d"][i].get<double>() == Approx(tele["eg3d"][i].get<double>()).margin(0.001));
    // So does that of the folder of a faces.jsonl, whose lines may be apart.
    const json line = {{"id", "a"}, {"pose", tele["pose"]}};
    fs::create_directories(folder / "tele_faces");
    stymo::write_file(folder / "tele_faces/faces.jsonl", other.dump() + "\n\n" + line.dump());
    stymo::write_file(folder / "tele_faces/camera.json", tele["camera"].dump());
    const json of_folder =
        json::parse(done("stymo-prep pose tele_faces/faces.jsonl --id a --json").out);
    CHECK(of_folder["pose"] == back["pose"]);
    done("stymo-prep pose form.json --id 00000/a.png --draw axes.png");
    CHECK(stymo::read_image(folder / "axes.png").shape() == stymo::Shape{192, 192, 3});
}

TEST_CASE("What is no pose is named") {
    const fs::path& folder = tiny_run();
    stymo::write_file(folder / "seven.txt", "1 2 3 4 5 6 7");
    stymo::write_file(folder / "many.jsonl", "{\"id\": \"a\"}\n{\"id\": \"b\"}\n");
    stymo::write_file(folder / "flat.json", R"({"yaw_deg": 3, "camera": {"focal": 0}})");
    const std::vector<std::pair<std::string, std::string>> calls = {
        {"flat.json", "flat.json: "},
        {"seven.txt", "seven.txt: holds 7 numbers"},
        {"text.png", "text.png: neither JSON nor numbers"},
        {"many.jsonl", "name one with --id"},
        {"none.json", "none.json: "}};
    for (const auto& [file, reason] : calls) {
        const ToolOutcome outcome = run_tool(folder, "stymo-prep pose " + file);
        CHECK(outcome.exit_code == 1);
        CHECK(stymo::line_count(outcome.err) == 1);
        CHECK_THAT(outcome.err, Catch::Contains(reason));
    }
}

TEST_CASE(
    "stymo-fit finds the faces of photos as they come, and fits those of one person together") {
    if (!has_detector()) return;
    const fs::path& folder = tiny_run();
    done("stymo-synth --out large --count 2 --size 256");
    done(
        "stymo-fit --model run/model.safetensors --image large/images/00000.png --image "
        "large/images/00001.png --refine-pose "
        "--out person --steps 2");
    for (const char* id : {"00000", "00001"}) {
        CHECK(names_in(folder / "person" / id) ==
              std::set<std::string>{"aligned.png", "overlay.png", "codes.json", "fit.png",
                                    "render.png", "report.json"});
        CHECK(stymo::read_image(folder / "person" / id / "aligned.png").shape() ==
              stymo::Shape{512, 512, 3});
        CHECK(json::parse(stymo::read_file(folder / "person" / id / "report.json"))["warnings"]
                  .is_array());
    }
    const auto codes = [&](const char* id) {
        return json::parse(stymo::read_file(folder / "person" / id / "codes.json"))["code"];
    };
    CHECK(codes("00000")["id"] == codes("00001")["id"]);
    CHECK(codes("00000")["tex"] == codes("00001")["tex"]);
    CHECK(codes("00000")["expr"] != codes("00001")["expr"]);
    stymo::write_image(folder / "grey.png", stymo::Tensor::full({90, 120, 3}, 0.5));
    const ToolOutcome none =
        run_tool(folder, "stymo-fit --model run/model.safetensors --image grey.png --out none");
    CHECK(none.exit_code == 1);
    CHECK_THAT(none.err,
               Catch::Contains("grey.png: no face was found; if it is an aligned crop already"));
    CHECK_FALSE(fs::exists(folder / "none"));
}

}  // namespace prep_tests
