// The requests of stymo-view without HTTP, on the tiny run's model.
#include <algorithm>
#include <catch2/catch.hpp>
#include <chrono>
#include <cmath>
#include <future>
#include <mutex>
#include <thread>

#include "apps/tiny_run.h"
#include "apps/view/face_list.h"
#include "apps/view/frame.h"
#include "apps/view/private_file.h"
#include "apps/view_client.h"
#include "core/angle.h"
#include "core/error.h"
#include "core/io/jpeg.h"
#include "core/metrics.h"
#include "core/ops/elementwise.h"
#include "core/rng.h"
#include "fit/photo/face_detector.h"
#include "nn/models/code_file.h"
#include "nn/models/weight_changes.h"
#include "nn/realtime/view.h"
#include "render/morphable/builtin_head.h"
#include "render/soft_edge.h"
#include "support/tiny_model.h"
#include "train/data/synthetic_faces.h"

using namespace stymo;
using nlohmann::json;

namespace {

json frame_of(const std::string& face, const std::string& quality, double yaw = 0.0) {
    return {{"face", face}, {"quality", quality}, {"camera", {{"yaw", yaw}}}};
}

json frame_info(const view::Answer& answer) {
    const auto found = std::ranges::find(answer.headers, "X-Stymo-Frame",
                                         &std::pair<std::string, std::string>::first);
    REQUIRE(found != answer.headers.end());
    return json::parse(found->second);
}

Tensor picture(const view::Answer& answer) {
    INFO(answer.body.substr(0, 200));
    REQUIRE(answer.status == 200);
    return image_from_jpeg(answer.body, 1 << 20);
}

}  // namespace

TEST_CASE("a still frame is the exact view, a moving one is as near as promised", "[view]") {
    ViewClient client;
    const std::string face = client.first_face();
    const view::Answer still = client.ask("frame", frame_of(face, "still", 20.0));
    const Tensor image = picture(still);
    const Model& model = *client.shared().model();
    const Codes codes = client.shared().first_faces().front().face.codes;
    const View view = render_view(
        model, codes, 0,
        turned_camera(model.config().camera, head_middle, radians_from_degrees(20.0), 0.0, 0.0),
        {.samples_per_ray = 4, .mask = true});
    const Tensor exact = with_soft_edge(view.image, view.mask);
    CHECK(peak_signal_to_noise_ratio(image, exact) > 33.0);  // what JPEG leaves
    CHECK(frame_info(still)["mode"] == "exact");
    double psnr = frame_info(still)["psnr"];
    for (int i = 0; i < 4 && psnr < client.shared().options().frames.psnr; ++i)
        psnr = frame_info(client.ask("frame", frame_of(face, "still", 20.0)))["psnr"];
    CHECK(psnr >= client.shared().options().frames.psnr);
    const view::Answer moving = client.ask("frame", frame_of(face, "moving", 20.0));
    CHECK(peak_signal_to_noise_ratio(picture(moving), exact) > 28.0);
    CHECK(frame_info(moving)["mode"] != "exact");
    CHECK(picture(client.ask("frame", frame_of(face, "thumbnail"))).shape(0) == 64);
}

TEST_CASE("sliders, layers and the window change the picture", "[view]") {
    ViewClient client;
    json query = frame_of(client.first_face(), "still");
    const Tensor plain = picture(client.ask("frame", query));
    const auto differs = [&](const json& other) {
        return peak_signal_to_noise_ratio(picture(client.ask("frame", other)), plain) < 60.0;
    };
    CHECK_FALSE(differs(query));
    for (const char* layer : {"depth", "normals"}) {
        json other = query;
        other["layer"] = layer;
        INFO(layer);
        CHECK(differs(other));
    }
    for (const char* group : {"id", "expr", "tex", "light"}) {
        json other = query;
        other["sliders"] = {{group, {3.0}}};
        INFO(group);
        CHECK(differs(other));
    }
    json window = query;
    window["camera"] = {{"eye", {0.1, 0.0, 0.4}}, {"screen", 0.2}};
    CHECK(differs(window));
}

TEST_CASE("new faces are drawn, opened, shared, mixed and kept", "[view]") {
    ViewClient client;
    const std::string first = client.first_face();
    const auto codes_of = [&](const json& answer) {
        for (const json& face : answer["faces"]) {
            if (face["face"] == answer["face"]) return face["codes"].get<std::string>();
        }
        return std::string();
    };
    const json drawn = client.json("face", {{"seed", 5}, {"truncation", 0.5}});
    const std::string other = drawn["face"];
    CHECK(codes_of(client.json("face", {{"seed", 5}, {"truncation", 0.5}})) == codes_of(drawn));
    CHECK(codes_of(client.json("face", {{"codes", codes_of(drawn)}})) == codes_of(drawn));
    const view::Answer file = client.ask("codes", {{"face", other}});
    CHECK(codes_of(client.json("face", {{"file", file.body}})) == codes_of(drawn));
    json other_model = json::parse(file.body);
    REQUIRE(other_model.contains("model"));
    other_model["model"] = "0";
    const view::Answer refused = client.send("face", json({{"file", other_model.dump()}}).dump());
    CHECK(refused.status == 400);
    CHECK_THAT(refused.body, Catch::Contains("the file: holds codes of another model"));

    const json mixed =
        client.json("face", {{"face", first}, {"source", other}, {"groups", {"tex"}}});
    const Codes target = view::codes_of_text(client.opened()["faces"][0]["codes"]),
                source = view::codes_of_text(codes_of(drawn)),
                both = view::codes_of_text(codes_of(mixed));
    CHECK(both.texture().value().to_vector() == source.texture().value().to_vector());
    CHECK(both.identity().value().to_vector() == target.identity().value().to_vector());

    const json moved = client.json("face", {{"face", other}, {"sliders", {{"light", {1.0}}}}});
    CHECK(codes_of(moved) != codes_of(drawn));
    const view::Answer left = client.send("remove", "", {{"face", other}});
    CHECK(json::parse(left.body)["faces"].size() == client.json("faces")["faces"].size());
    CHECK(client.ask("frame", frame_of(other, "still")).status == 400);
}

TEST_CASE("names of faces do not grow without limit, and end with a whole character", "[view]") {
    ViewClient client;
    const std::string first = client.first_face();
    const auto name_of = [](const json& answer) {
        return answer["faces"].back()["name"].get<std::string>();
    };
    std::string name;
    for (int i = 0; i < 50; ++i) name += "\u9854";
    CHECK(name_of(client.json("face", {{"seed", 5}, {"name", name}})) == name.substr(0, 78));

    json mixed = {{"face", first}};
    for (int i = 0; i < 8; ++i) {
        const std::string id = mixed["face"];
        mixed = client.json("face", {{"face", id}, {"source", id}, {"groups", {"tex"}}});
    }
    CHECK(name_of(mixed).size() == 80);
}

TEST_CASE("tuned weights that were saved are opened again, and no others", "[view]") {
    ViewClient client;
    const std::string face = client.first_face();
    const Model& model = *client.shared().model();
    const Model tuned = Model::load(tiny_run() / "run/model.safetensors", ModelParts::decoder);
    const Parameter& parameter = tuned.parameters().all().front();
    parameter.set_value((Variable(parameter.variable().value()) * 1.25).value());
    const auto bytes_of = [](const WeightChanges& changes) {
        return view::written_bytes(".safetensors",
                                   [&](const std::filesystem::path& file) { changes.save(file); });
    };
    WeightChanges changes = WeightChanges::between(model, tuned);
    changes.name_face(read_code_file(tiny_run() / "fit/codes.json").codes);
    const std::string weights = bytes_of(changes);
    const auto opening = [&](const std::string& bytes) {
        const view::Answer answer = client.send("weights", bytes, {{"face", face}});
        return answer.status == 200 ? client.ended_job() : json::parse(answer.body);
    };
    const std::string id = opening(weights)["face"];
    CHECK(client.json("faces")["faces"].back()["tuned"] == true);
    CHECK(client.send("tuned", "", {{"face", id}}).status == 200);
    CHECK(client.ended_job()["state"] == "done");
    CHECK(client.ask("result").body == weights);
    CHECK(peak_signal_to_noise_ratio(picture(client.ask("frame", frame_of(id, "still"))),
                                     picture(client.ask("frame", frame_of(face, "still")))) < 50.0);

    const auto reason = [&](const std::string& bytes) {
        return opening(bytes)["error"].get<std::string>();
    };
    CHECK_THAT(reason("no weights"), Catch::StartsWith("the file: "));
    CHECK_THAT(reason(bytes_of(WeightChanges::between(tuned, model))),
               Catch::StartsWith("the file: these weight changes were made for another model"));
    CHECK(client.send("weights", "", {{"face", face}}).status == 400);
    for (int i = 0; i < 15; ++i) CHECK(opening(weights)["state"] == "done");
    CHECK_THAT(reason(weights), Catch::Contains("remove one first"));
    // A fit that could not keep its tuned weights does not begin.
    const view::Answer fit = client.send("photo", "x", {{"tune", "5"}});
    CHECK(fit.status == 400);
    CHECK_THAT(fit.body, Catch::Contains("remove one first"));
    CHECK(client.send("photo", "x").status == 200);
}

TEST_CASE("a model is loaded by a job, which waits for others, and not by the request", "[view]") {
    ViewClient client;
    const std::string face = client.first_face();
    std::unique_lock other(client.shared().heavy_work());
    CHECK(client.send("weights", "no weights", {{"face", face}}).status == 200);
    json job = client.json("job");
    for (int i = 0; i < 100 && job["phase"] == ""; ++i) {
        std::this_thread::sleep_for(std::chrono::milliseconds(10));
        job = client.json("job");
    }
    CHECK(job["phase"] == "waiting for another job");
    other.unlock();
    CHECK(client.ended_job()["state"] == "failed");
}

TEST_CASE("tuned models are counted, however they come to a list, and faces of one model once",
          "[view]") {
    Rng rng(1);
    const auto tuned = [&] {
        return view::ListedFace{
            .name = "tuned",
            .face = {},
            .model = std::make_shared<const Model>(test::tiny_model_config(), rng),
            .tuned = true};
    };
    view::TunedModels all(20);
    view::FaceList list(all), other(all);
    const view::ListedFace first = tuned();
    const std::string removed = list.add(tuned());
    for (int i = 0; i < 20; ++i) static_cast<void>(list.add(first));  // as mixed faces do
    for (int i = 0; i < 14; ++i) static_cast<void>(list.add(tuned()));
    // As a fit does: its face is there before it is tuned.
    const std::string fitted = list.add({.name = "fitted", .face = {}, .model = first.model});
    CHECK_THROWS_AS(list.require_room_for_tuned(), ValueError);
    CHECK_THROWS_WITH(list.replace(fitted, tuned()), Catch::Contains("remove one first"));
    CHECK_THROWS_WITH(list.add(tuned()), Catch::Contains("remove one first"));
    CHECK_FALSE(list.find(fitted).tuned);
    list.remove(removed);
    CHECK_NOTHROW(list.require_room_for_tuned());
    CHECK(list.replace(fitted, tuned()));
    CHECK(list.replace(fitted, tuned()));  // in place of its own

    for (int i = 0; i < 4; ++i) static_cast<void>(other.add(tuned()));
    CHECK_THROWS_WITH(other.add(tuned()), Catch::Contains("all open pages have room for 20"));
    CHECK_THROWS_AS(other.require_room_for_tuned(), ValueError);
    CHECK_NOTHROW(other.add(first));
}

TEST_CASE("a film, a mesh and a change of colour are made; a job is cancelled", "[view]") {
    ViewClient client;
    const std::string face = client.first_face();
    const json keys = {{{"yaw", -20}}, {{"yaw", 20}}};
    json film = {{"face", face}, {"keys", keys}, {"seconds", 0.3}, {"fps", 10}, {"format", "gif"}};
    client.json("film", film);
    CHECK(client.ended_job()["state"] == "done");
    const view::Answer gif = client.ask("result");
    CHECK(gif.type == "image/gif");
    CHECK(gif.body.starts_with("GIF8"));

    const json color = {{"face", face}, {"x", 0.5}, {"y", 0.5}, {"color", {0.8, 0.2, 0.2}}};
    client.json("color", color);
    const json recolored = client.ended_job();
    INFO(recolored.dump());
    CHECK(recolored["state"] == "done");
    CHECK(recolored["face"] != "");

    film["seconds"] = 40;
    client.json("film", film);
    CHECK(client.ask("film", film).status == 400);  // one at a time
    client.json("cancel");
    CHECK(client.ended_job()["state"] == "cancelled");
    CHECK(client.ask("result").status == 404);
}

TEST_CASE("the viewer's own face moves the shown one, from its rest on", "[view]") {
    if (!FaceDetector::available()) return;
    ViewClient client;
    SyntheticFace actor = sample_synthetic_face(builtin_head(), Rng(5));
    const auto seen = [&](double yaw, const std::map<std::string, std::string>& query) {
        actor.pose = orbit_pose(yaw, 0.0, 0.0, 5.3);
        const Tensor image = render_synthetic_face(builtin_head(), actor, {}, 320).color;
        const view::Answer answer = client.send("expression", jpeg_bytes(image, 95), query);
        INFO(answer.body);
        REQUIRE(answer.status == 200);
        return json::parse(answer.body);
    };
    const auto norm = [](const json& sight) {
        REQUIRE(sight["expression"].size() == 79);
        double sum = 0.0;
        for (const json& number : sight["expression"]) sum += std::abs(number.get<double>());
        return sum;
    };
    const json rest = seen(0.0, {});
    REQUIRE(rest["found"] == true);
    CHECK(norm(rest) == 0.0);
    const json turned = seen(0.3, {});
    CHECK(turned["yaw"].get<double>() - rest["yaw"].get<double>() ==
          Approx(degrees_from_radians(0.3)).margin(8.0));
    CHECK(norm(turned) > 0.0);
    CHECK(norm(seen(0.3, {{"anew", "1"}})) == 0.0);
    const view::Answer none =
        client.send("expression", jpeg_bytes(Tensor::full({240, 320, 3}, 0.5), 90));
    CHECK(json::parse(none.body)["found"] == false);

    json query{{"face", client.first_face()}, {"quality", "thumbnail"}};
    const std::string at_rest = client.ask("frame", query).body;
    query["expression"] = json(std::vector<double>(79, 1.0));
    CHECK(client.ask("frame", query).body != at_rest);
    query["expression"] = json::array();
    CHECK(client.ask("frame", query).body == at_rest);
}

TEST_CASE("the sliders get their names in the background", "[view]") {
    ViewClient client;
    json names = client.json("names");
    for (int i = 0; i < 600 && !names.contains("names"); ++i) {
        std::this_thread::sleep_for(std::chrono::milliseconds(50));
        names = client.json("names");
    }
    REQUIRE(names.contains("names"));
    for (const json& group : client.opened()["groups"]) {
        const json& ends = names["names"][group["group"].get<std::string>()];
        // The tiny model draws no faces; where landmarks fail, there are no names.
        CHECK((ends.empty() || ends.size() == group["shares"].size()));
    }
}

TEST_CASE("what a job has to say is one line", "[view]") {
    view::Job job([](view::Job& self) {
        self.add_note("the photo is dark");
        self.add_note("the fit ended no better than it began");
    });
    while (job.running()) std::this_thread::sleep_for(std::chrono::milliseconds(1));
    CHECK(job.status().note == "the photo is dark; the fit ended no better than it began");
}

TEST_CASE("requests that are wrong are refused with a reason", "[view]") {
    ViewClient client;
    const std::string face = client.first_face();
    struct Row {
        const char* path;
        std::string body;
        const char* reason;
    };
    const std::string nested(10000, '[');
    const std::vector<Row> rows{
        {"frame", "", "the request is not a JSON object"},
        {"frame", "[]", "the request is not a JSON object"},
        {"frame", "{\"a\":" + nested, "the request: nested deeper than 32 levels"},
        {"frame", "{\"a\": \"" + std::string(1U << 20U, 'x') + "\"}", "the request is too large"},
        {"frame", R"({"face": "f99"})", "there is no face f99"},
        {"frame", R"({"face": 3})", "\"face\" is not a text"},
        {"frame", R"({"quality": "best"})", "\"quality\": there is no \"best\""},
        {"frame", R"({"layer": "x"})", "\"layer\": there is no \"x\""},
        {"frame", R"({"camera": 1})", "\"camera\" is not an object"},
        {"frame", R"({"camera": {"yaw": 1e9}})", "\"yaw\" must be from -180 to 180, got 1e+09"},
        {"frame", R"({"camera": {"yaw": "left"}})", "\"yaw\" is not a number"},
        {"frame", R"({"camera": {"yaw": 1e999}})", "\"yaw\" is too large a number"},
        {"frame", R"({"sliders": {"id": [-1e999]}})", "\"id\" is too large a number"},
        {"frame", R"({"camera": {"eye": [0, 1]}})", "\"eye\" must be three numbers"},
        {"frame", R"({"sliders": {"id": [9]}})", "\"id\" must be numbers from -6 to 6"},
        {"face", R"({"codes": "12"})", "codes are 1224 hexadecimal digits, got 2 characters"},
        {"face", R"({"file": "{}"})", "the file: not a code file (\"code\" is missing)"},
        {"face", R"({"seed": -1})", "\"seed\" must be from 0 to 4.29497e+09, got -1"},
        {"face", R"({"face": "f1", "source": "f1", "groups": ["nose"]})",
         "\"groups\" are id, expr, tex, light"},
        {"face", R"({"face": "f1", "source": "f1", "groups": {"a": "id"}})",
         "\"groups\" names no group"},
        {"face", R"({"face": "f1", "source": "f1", "groups": []})", "\"groups\" names no group"},
        {"color", R"({"face": "f1"})", "\"color\" is missing"},
        {"film", R"({"face": "f1", "keys": [{}]})", "a path has from 2 to 64 keys"},
        {"mesh", "", "the request is not a JSON object"},
        {"codes", R"({"face": "f77"})", "there is no face f77"},
        {"tuned", "", "\"face\" is missing"},
        {"film", R"({"face": "f1", "keys": [{}, {}], "seconds": 60, "fps": 60})",
         "a film of 3600 frames is too long; at most 900 are made"},
        {"color", R"({"face": "f1", "color": [0, 2, 0]})", "\"color\" must be numbers from 0 to 1"},
        {"eyes", "xx", "not a JPEG image"},
        {"expression", "xx", "not a JPEG image"},
        {"frame", R"({"face": "f1", "expression": [1]})", "\"expression\" must be 79 numbers"},
        {"frame", R"({"face": "f1", "expression": [1e9]})",
         "\"expression\" must be numbers from -100 to 100"},
        {"nothing", "", "there is no /api/nothing"},
        {"result", "", "there is no result yet"},
    };
    for (const Row& row : rows) {
        INFO(row.path << " " << row.body.substr(0, 60));
        const view::Answer answer = client.send(row.path, row.body);
        CHECK(answer.status >= 400);
        CHECK(json::parse(answer.body)["error"].get<std::string>().starts_with(row.reason));
    }
    CHECK(client.send("tuned", "", {{"face", face}}).status == 400);
    for (const char* number : {"long", "1e999", "-1e999", "inf", "nan", ""}) {
        INFO(number);
        const view::Answer answer = client.send("photo", "x", {{"tune", number}});
        CHECK(answer.status == 400);
        CHECK_THAT(answer.body, Catch::Contains("\\\"tune\\\" must be a number from 0 to 600"));
    }
    CHECK(client.api()({.path = "/api/frame", .session = "unknown"}).status == 410);
}

TEST_CASE("a session is one of a few, and gets no more requests than it may", "[view]") {
    ViewClient client;  // the first of four
    for (int i = 0; i < 3; ++i) CHECK(client.api()({.path = "/api/session"}).status == 200);
    CHECK(client.api()({.path = "/api/session"}).status == 503);
    CHECK(client.ask("close").status == 200);
    CHECK(client.ask("faces").status == 410);
    const view::Answer reopened = client.api()({.path = "/api/session"});
    REQUIRE(reopened.status == 200);
    const std::string session = json::parse(reopened.body)["session"];
    int refused = 0;
    for (int i = 0; i < 2000; ++i)
        refused += client.api()({.path = "/api/job", .session = session}).status == 429 ? 1 : 0;
    CHECK(refused > 0);
}

TEST_CASE("sessions are not opened without limit", "[view]") {
    ViewClient client;
    int refused = 0;
    for (int i = 0; i < 100; ++i) {
        const view::Answer opened = client.api()({.path = "/api/session"});
        refused += opened.status == 429 ? 1 : 0;
        if (opened.status != 200) continue;
        const std::string session = json::parse(opened.body)["session"];
        CHECK(client.api()({.path = "/api/close", .session = session}).status == 200);
    }
    CHECK(refused > 50);
    CHECK(client.ask("faces").status == 200);
}

TEST_CASE("a new session takes the place of an idle one, but of none whose job runs", "[view]") {
    ViewClient client;
    view::Sessions sessions(client.shared(), 1, 0.0);
    const std::shared_ptr<view::Session> busy = sessions.open();
    REQUIRE(busy);
    busy->start([](view::Job& job) {
        for (;;) {
            job.report("working", 0, 0);
            std::this_thread::sleep_for(std::chrono::milliseconds(1));
        }
    });
    CHECK_FALSE(sessions.open());
    CHECK(sessions.find(busy->id()));
    busy->cancel();
    while (busy->job_status()->state == view::JobStatus::State::running)
        std::this_thread::sleep_for(std::chrono::milliseconds(1));
    CHECK(sessions.open());
    CHECK_FALSE(sessions.find(busy->id()));
}

TEST_CASE("a newer frame takes the place of one that waits, and none is lost", "[view]") {
    ViewClient client;
    const std::string face = client.first_face();
    std::vector<std::future<view::Answer>> answers;
    for (int i = 0; i < 24; ++i) {
        answers.push_back(std::async(std::launch::async, [&, i] {
            return client.ask("frame", frame_of(face, i % 3 == 0 ? "still" : "moving", double(i)));
        }));
    }
    int shown = 0;
    for (auto& answer : answers) {
        const int status = answer.get().status;
        CHECK((status == 200 || status == 204));
        shown += status == 200 ? 1 : 0;
    }
    CHECK(shown >= 1);
}

TEST_CASE("a frame that waits is dropped when a newer one is asked for", "[view]") {
    ViewClient client;
    view::Scheduler scheduler({});
    const Codes codes = client.shared().first_faces().front().face.codes;
    // Frames of this size take so long that two more requests come while one is rendered.
    ModelConfig config = test::tiny_model_config();
    config.decoder.resolution = 512;
    config.decoder.block_channels = {6, 6, 6, 6, 6, 6};
    config.reconstruction.resolution_weights = {1, 1, 1, 1, 1, 1};
    Rng rng(1);
    const auto model = std::make_shared<const Model>(config, rng);
    const auto ask = [&](double yaw) {
        return std::async(std::launch::async, [&, yaw] {
            return scheduler.render(
                "page",
                {.model = model, .codes = codes, .camera = model_camera(*model, yaw, 0.0, 0.0)});
        });
    };
    for (int attempt = 0, dropped = 0; dropped == 0; ++attempt) {
        REQUIRE(attempt < 50);
        std::vector<std::future<std::optional<view::Frame>>> frames;
        for (int i = 0; i < 12; ++i) frames.push_back(ask(0.01 * i));
        int shown = 0;
        for (auto& frame : frames) (frame.get() ? shown : dropped) += 1;
        CHECK(shown >= 1);
        CHECK(ask(0.2).get());  // and the newest is always rendered
    }
}

TEST_CASE("a page that is closed ends its work", "[view]") {
    ViewClient client;
    const json keys = {{{"yaw", -20}}, {{"yaw", 20}}};
    const json film = {{"face", client.first_face()},
                       {"keys", keys},
                       {"seconds", 40},
                       {"fps", 20},
                       {"format", "gif"}};
    client.json("film", film);
    CHECK(client.ask("close").status == 200);
    CHECK(client.ask("job").status == 410);
    // The lock of heavy work is free again, so the job is not running.
    std::timed_mutex& lock = client.shared().heavy_work();
    REQUIRE(lock.try_lock());
    lock.unlock();
}

TEST_CASE("codes survive their text to 16 bits", "[view]") {
    const Codes codes = test::random_codes(1, 4);
    const std::string text = view::text_of_codes(codes);
    CHECK(text.size() == 1224);
    const std::vector<double> before = joined(codes).value().to_vector(),
                              after = joined(view::codes_of_text(text)).value().to_vector();
    for (std::size_t i = 0; i < before.size(); ++i)
        CHECK(after[i] == Approx(before[i]).epsilon(1e-3).margin(1e-4));
    CHECK(view::text_of_codes(view::codes_of_text(text)) == text);
    CHECK_THROWS_AS(view::codes_of_text(std::string(1224, 'g')), ValueError);
    CHECK_THROWS_AS(view::codes_of_text(std::string(1224, 'f')), ValueError);  // NaN
}
