#include <catch2/catch.hpp>
#include <cmath>
#include <fstream>
#include <nlohmann/json.hpp>
#include <numeric>

#include "apps/common/command_line.h"
#include "apps/eval/commands.h"
#include "apps/eval/evaluate.h"
#include "apps/eval/person_measures.h"
#include "apps/eval/report_page.h"
#include "apps/eval/score.h"
#include "apps/tiny_run.h"
#include "core/angle.h"
#include "core/error.h"
#include "core/io/file.h"
#include "core/io/image.h"
#include "core/io/scratch_folder.h"
#include "core/parallel.h"
#include "fit/photo/face_detector.h"
#include "nn/models/code_file.h"
#include "nn/models/display_image.h"
#include "nn/pretrained/backbones/mobilefacenet.h"
#include "nn/realtime/view.h"
#include "render/depth_map.h"
#include "render/morphable/builtin_head.h"
#include "render/rasterizer.h"
#include "render/rays.h"
#include "support/error_message.h"
#include "support/thread_count.h"

namespace {

namespace fs = std::filesystem;
using namespace stymo;
using nlohmann::json;
using stymo::test::error_message;

FaceScore score_of(const std::string& id, const ImageMetrics& initial, const ImageMetrics& fitted) {
    return {id, {{Region::head, initial, fitted}}, 0.25};
}

const std::vector<FaceScore> three_scores = {
    score_of("a", {0.3, 0.1, 0.5, 20.0}, {0.2, 0.06, 0.7, 24.0}),
    score_of("b", {0.1, 0.04, 0.7, 10.0}, {0.0, 0.0, 0.9, 12.0}),
    score_of("c", {0.2, 0.07, 0.6, 12.0}, {0.1, 0.03, 0.8, 15.0})};

/// Faces whose fitted PSNR is 1, 2, ..., not in order.
std::vector<FaceScore> scores_by_psnr(int count) {
    std::vector<FaceScore> scores;
    for (int i = 0; i < count; ++i) {
        const int psnr = (i * 7) % count + 1;
        scores.push_back(score_of("face" + std::to_string(psnr), {},
                                  {0.0, 0.0, 0.0, static_cast<double>(psnr)}));
    }
    return scores;
}

std::vector<std::string> ids_of(const std::vector<SheetRow>& rows, const std::string& kind) {
    std::vector<std::string> ids;
    for (const SheetRow& row : rows)
        if (row.kind == kind) ids.push_back(row.id);
    return ids;
}

/// The tiny run's model on its faces.
struct TinyEvaluation {
    Model model = Model::load(tiny_run() / "run/model.safetensors");
    Dataset faces{tiny_run() / "faces", 64, {.cache_megabytes = 0}, Split::all};
    ReconstructionLoss loss{model.config().reconstruction};
    FitJobOptions fitting;
    EvaluationOptions options;

    TinyEvaluation() {
        options.range = {0, 2};
        options.fit = true;
        fitting.fit.steps = 2;
    }
    [[nodiscard]] FitJob job() const { return {model, loss, fitting}; }
    [[nodiscard]] Evaluation run() const { return evaluate(job(), faces, options); }
};

std::vector<std::string> lines_of(const std::vector<FaceScore>& scores) {
    std::vector<std::string> lines;
    for (const FaceScore& score : scores) lines.push_back(to_json(score).text());
    return lines;
}

}  // namespace

TEST_CASE("A range of faces is one place, two, or from one to the end") {
    CHECK(parse_range("700-799").first == 700);
    CHECK(parse_range("700-799").last == 799);
    CHECK(parse_range("5").first == 5);
    CHECK(parse_range("5").last == 5);
    CHECK(parse_range("7-7").last == 7);
    CHECK(parse_range("700-").first == 700);
    CHECK(parse_range("700-").last == -1);
    CHECK(parse_range("").first == 0);
    CHECK(parse_range("").last == -1);
}

TEST_CASE("Anything else is no range of faces") {
    const auto text =
        GENERATE("x", "-3", "1-2-3", "5-2", "1-x", "1.5", " 1", "1 ", "99999999999999999999", "-");
    CHECK_THROWS_AS(parse_range(text), UsageError);
    CHECK_THROWS_WITH(parse_range(text), Catch::Contains("--ids"));
}

TEST_CASE("A list of ids selects its faces, and what is wrong in it is named by its line") {
    const ScratchFolder scratch;
    const fs::path list = scratch / "ids.txt";
    const TinyEvaluation tiny;
    const std::vector<std::string>& ids = tiny.faces.ids();
    const auto positions = [&](const std::string& text) {
        write_file(list, text);
        return positions_of(tiny.faces, parse_range(list.string()));
    };
    const std::vector<std::int64_t> two{2, 7};
    CHECK(positions(ids[7] + "\n" + ids[2] + "\n") == two);
    CHECK(positions(ids[2] + "\r\n" + ids[7]) == two);
    const auto refusal = [&](const std::string& text) {
        const std::string said =
            error_message<FileError>([&] { static_cast<void>(positions(text)); });
        CHECK(test::is_one_line(said));
        return said;
    };
    CHECK_THAT(refusal(""), Catch::EndsWith("ids.txt: lists no ids"));
    CHECK_THAT(refusal(ids[0] + "\n\n" + ids[1]), Catch::EndsWith(", line 2: there is no id"));
    CHECK_THAT(refusal(ids[0] + "\n" + ids[1] + "\n" + ids[0]),
               Catch::EndsWith(", line 3: " + ids[0] + " is listed twice"));
    CHECK_THAT(refusal(ids[0] + "\nnobody"),
               Catch::EndsWith(", line 2: the folder has no face nobody"));
}

TEST_CASE("The scores of a folder are the means and the medians over its faces") {
    const auto value =
        json::parse(summary_json(three_scores, {{"d", "d.png: not an image"}}).text());
    CHECK(value["count"] == 3);
    CHECK(value["mean"]["head"]["initial"]["psnr"].get<double>() == Approx(14.0));
    CHECK(value["mean"]["head"]["fitted"]["l1"].get<double>() == Approx(0.1));
    CHECK(value["median"]["head"]["initial"]["psnr"].get<double>() == Approx(12.0));
    CHECK(value["median"]["head"]["fitted"]["ssim"].get<double>() == Approx(0.8));
    CHECK(value["counting_samples"].get<double>() == Approx(0.25));
    CHECK(value["failed"] == json{{{"id", "d"}, {"reason", "d.png: not an image"}}});
    CHECK_FALSE(value["mean"].contains("face"));
    CHECK_THAT(summary_text(three_scores),
               Catch::Contains("3 faces") && Catch::Contains("14.00") && Catch::Contains("17.00") &&
                   Catch::Contains("median") && !Catch::Contains("LPIPS"));

    std::vector<FaceScore> initial_alone = three_scores;
    for (FaceScore& score : initial_alone) score.regions.front().fitted.reset();
    CHECK_FALSE(
        json::parse(summary_json(initial_alone, {}).text())["mean"]["head"].contains("fitted"));
    CHECK_THAT(summary_text(initial_alone), !Catch::Contains("fitted"));
}

TEST_CASE("A face's score is read back from its line as it was, infinite PSNR included") {
    FaceScore score{
        "00012",
        {{Region::head,
          {0.1, 1.0 / 3.0, 0.25, 21.0, 0.125},
          ImageMetrics{0.0, 0.0, 1.0, INFINITY, 0.0}},
         {Region::face, {1e-7, 0.2, 0.3, 30.0, 0.5}, ImageMetrics{0.1, 0.2, 0.3, 4.0, 0.25}}},
        0.28,
        IdentityScore{0.75, 1.0 / 3.0, -0.25, 0.125},
        IdentityScore{0.8, 0.7, 0.6, 0.125}};
    score.regions[1].tuned = ImageMetrics{0.05, 0.1, 0.5, 30.0, 0.1};
    const std::string line = to_json(score).text();
    const FaceScore again = parse_face_score(line);
    CHECK(to_json(again).text() == line);
    CHECK(again.regions[0].fitted->psnr == INFINITY);
    CHECK(again.regions[0].initial.l1_mean == 1.0 / 3.0);
    CHECK(again.regions[1].region == Region::face);
    REQUIRE(again.regions[1].tuned);
    CHECK(again.regions[1].last().psnr == 30.0);
    REQUIRE(again.tuned_identity);
    CHECK(again.tuned_identity->turned_30 == 0.6);
    REQUIRE(again.identity);
    CHECK(again.identity->turned_15 == 1.0 / 3.0);
    for (const char* text : {"", "{}", R"({"id":"a","counting_samples":1})",
                             R"({"id":"a","head":{},"counting_samples":1})", "[1"})
        CHECK_THROWS_AS(parse_face_score(text), FileError);
}

TEST_CASE("The mean of identities is over the faces that have one") {
    std::vector<FaceScore> scores = three_scores;
    CHECK_FALSE(json::parse(summary_json(scores, {}).text()).contains("identity"));
    CHECK_THAT(summary_text(scores), !Catch::Contains("cosine"));
    scores[0].identity = {0.5, 0.25, 0.75, 0.0};
    scores[2].identity = {1.0, 0.75, 0.25, 0.5};
    scores[1].tuned_identity = {0.875, 0.5, 0.5, 0.0};
    const json mean = json::parse(summary_json(scores, {}).text());
    CHECK(mean["identity"] ==
          json{{"photo", 0.75}, {"turned_15", 0.5}, {"turned_30", 0.5}, {"other", 0.25}});
    CHECK(mean["tuned_identity"]["photo"] == 0.875);
    CHECK_THAT(summary_text(scores),
               Catch::Contains("cosine of embeddings: photo and face 0.750") &&
                   Catch::Contains("embeddings, tuned: photo and face 0.875"));
}

TEST_CASE("Depth is compared up to a shift, in distances of the eyes") {
    CHECK(shifted_difference({}) == INFINITY);
    CHECK(shifted_difference({7.0, 7.0, 7.0}) == 0.0);
    CHECK(shifted_difference({5.0, 6.0, 7.0, 8.0, 9.0}) == 1.0);

    const MorphableHead head = builtin_head();
    const std::vector<float> identity(MorphableHead::identity_size, 0.5F),
        expression(MorphableHead::expression_size, 0.0F);
    const Tensor vertices = head_vertices(head, identity, expression);
    const Camera camera = camera_from_pose(orbit_pose(0.2, 0.1, 0.0, 5.3), {});
    constexpr std::int64_t side = 32;
    const RasterImage surface =
        rasterize(vertices, Tensor::zeros(vertices.shape()), head.triangles, camera,
                  {.width = side, .height = side, .samples_per_side = 1});
    const RaySampling rays{.rays_per_side = side};
    const auto depths_with = [&](double left, double right) {
        Tensor depths({side, side, 1});
        for (std::int64_t i = 0; i < side * side; ++i) {
            const double axial = surface.depth.values<float>()[static_cast<std::size_t>(i)];
            const Eigen::Vector3d direction =
                camera_direction(camera.intrinsics, rays, i / side, i % side);
            depths.mutable_values<float>()[static_cast<std::size_t>(i)] =
                static_cast<float>(axial / direction[2] + (i % side < side / 2 ? left : right));
        }
        return depths;
    };
    CHECK(depth_difference(head, vertices, camera, depths_with(0.0, 0.0)) < 1e-5);
    CHECK(depth_difference(head, vertices, camera, depths_with(0.3, 0.3)) < 1e-5);
    Tensor other = depths_with(0.0, 0.0);
    for (float& depth : other.mutable_values<float>()) depth *= depth;
    CHECK(depth_difference(head, vertices, camera, other) > 0.1);

    // The middle of a pixel is where its ray meets the surface.
    const Tensor depths = depths_with(0.0, 0.0);
    const Ray ray = camera_ray(camera, rays, 15, 18);
    const Eigen::Vector3d point =
        point_at(camera, depths, Eigen::Vector2d(18.5 / side, 15.5 / side));
    CHECK((point - ray.origin - depths.values<float>()[15 * side + 18] * ray.direction).norm() <
          1e-5);
}

TEST_CASE("A face that no detector finds has a depth but no landmarks") {
    if (!FaceDetector::available()) return;
    const TinyEvaluation tiny;
    const ShapeMeasure measure({}, builtin_head());
    const ComparedFace face = compared_face(tiny.model, tiny.faces, 0, tiny.options);
    const FitResult fit = fit_codes(tiny.model, tiny.loss, face.batch, {.steps = 0});
    const ShapeScore score = measure.measure(tiny.model, face, fit);
    CHECK(score.landmarks_30 == INFINITY);
    CHECK(score.found_30 == 0.0);
    CHECK(std::isfinite(score.depth) == face.batch.has_codes());

    FaceScore whole{"a", {{Region::head, {0.1, 0.1, 0.5, 20.0}}}, 1.0};
    whole.shape = score;
    whole.tuned_shape = ShapeScore{0.04, 1.0, 0.06};
    const std::string line = to_json(whole).text();
    CHECK(to_json(parse_face_score(line)).text() == line);
    FaceScore second = whole;
    second.shape = ShapeScore{0.5, 1.0, 0.25};
    const json mean = json::parse(summary_json({whole, second}, {}).text());
    CHECK(mean["shape"]["landmarks_30"] == 0.5);
    CHECK(mean["shape"]["found_30"] == 0.5);
    CHECK(mean["tuned_shape"]["depth"] == 0.06);
    CHECK_THAT(summary_text({whole, second}),
               Catch::Contains("in distances of the eyes: landmarks at 30 degrees off by 0.500 "
                               "(found in 50 % of the views)"));
}

TEST_CASE("A face is as like itself as can be, and the network's weights are read") {
    const fs::path file = tiny_run() / "mobilefacenet.safetensors";
    TensorFile weights;
    Rng rng(1);
    for (const auto& [name, shape] : mobilefacenet_tensors()) {
        const double low = name.ends_with("running_var") ? 0.05 : -0.2;
        weights.tensors.emplace(name, rng.uniform(shape, low, 0.2));
    }
    write_tensor_file(file, weights);
    const TinyEvaluation tiny;
    const IdentityMeasure measure(file);
    const ComparedFace face = compared_face(tiny.model, tiny.faces, 0, tiny.options);
    const FitResult fit = fit_codes(tiny.model, tiny.loss, face.batch, {.steps = 0});
    const IdentityScore score = measure.measure(tiny.model, face, &face, fit);
    CHECK(score.other == Approx(1.0));
    CHECK(std::isinf(measure.measure(tiny.model, face, nullptr, fit).other));
    const ViewOptions options{
        .samples_per_ray = tiny.model.config().reconstruction.fit_samples_per_ray,
        .resolution = face.batch.targets.back().shape(1)};
    const auto seen_by = [&](const Camera& camera) {
        return measure.embedding(render_view(tiny.model, fit.fitted, 0, camera, options).image,
                                 camera, tiny.model.config().camera);
    };
    const std::vector<double> fitted = seen_by(fit.cameras.front());
    const auto likeness_at = [&](double degrees) {
        double sum = 0.0;
        for (const double yaw : {-degrees, degrees}) {
            const std::vector<double> turned =
                seen_by(model_camera(tiny.model, radians_from_degrees(yaw), 0.0, 0.0));
            sum += std::inner_product(fitted.begin(), fitted.end(), turned.begin(), 0.0);
        }
        return 0.5 * sum;
    };
    CHECK(score.turned_15 == Approx(likeness_at(15.0)));
    CHECK(score.turned_30 == Approx(likeness_at(30.0)));
    CHECK(score.turned_15 != Approx(score.turned_30).epsilon(1e-9));
    CHECK(std::abs(score.photo) <= 1.0 + 1e-6);
    CHECK_THROWS_AS(IdentityMeasure(tiny_run() / "run/model.safetensors"), FileError);

    const ScratchFolder folder;
    DrawnOptions drawn{.model = {tiny_run() / "run/model.safetensors", {}},
                       .data = tiny_run() / "faces",
                       .ids = "4-9",
                       .identity = file,
                       .count = 5,
                       .sheet = folder.path() / "sheet.png"};
    const json result = json::parse(evaluate_drawn(drawn, 1).json.text());
    CHECK(result["photos"] == 6);
    CHECK(result["drawn"] == 5);
    CHECK(std::isfinite(result["kid"].get<double>()));
    CHECK(json::parse(evaluate_drawn(drawn, 1).json.text()) == result);
    CHECK(fs::exists(drawn.sheet));
    drawn.ids = "4-5";
    CHECK_THROWS_AS(evaluate_drawn(drawn, 1), UsageError);
}

TEST_CASE("The kernel distance of a few features is what its formula gives by hand") {
    // Kernels: 27 within the first set, 1 within the second, 1 between them.
    CHECK(kernel_distance({{2.0, 0.0}, {2.0, 0.0}}, {{0.0, 0.0}, {0.0, 0.0}}) == Approx(26.0));
    // Within: 1 and (3 / 2 + 1)^3; between: 1, 1, (2 / 2 + 1)^3 and 1.
    CHECK(kernel_distance({{0.0, 0.0}, {2.0, 0.0}}, {{1.0, 1.0}, {0.0, 3.0}}) ==
          Approx(1.0 + 15.625 - 2.0 * (1.0 + 1.0 + 8.0 + 1.0) / 4.0));
    CHECK_THROWS_AS(kernel_distance({{1.0}}, {{1.0}, {2.0}}), ValueError);
    CHECK_THROWS_AS(kernel_distance({{1.0}, {1.0, 2.0}}, {{1.0}, {2.0}}), ValueError);
}

TEST_CASE("The sheet shows the best, the median and the worst faces, none of them twice") {
    const std::vector<SheetRow> many = sheet_rows(scores_by_psnr(20));
    CHECK(ids_of(many, "best") == std::vector<std::string>{"face20", "face19", "face18"});
    CHECK(ids_of(many, "median") == std::vector<std::string>{"face12", "face11", "face10"});
    CHECK(ids_of(many, "worst") == std::vector<std::string>{"face3", "face2", "face1"});
    CHECK(many.front().psnr == 20.0);
    const std::vector<SheetRow> few = sheet_rows(scores_by_psnr(5));
    REQUIRE(few.size() == 3);
    CHECK(few[0].id == "face5");
    CHECK(few[1].id == "face3");
    CHECK(few[2].id == "face1");
    CHECK(sheet_rows(scores_by_psnr(2)).size() == 2);
    CHECK(sheet_rows(scores_by_psnr(1)).size() == 1);
}

TEST_CASE("A face's score is the same on one thread and on two, by itself and beside others") {
    TinyEvaluation tiny;
    const test::ThreadCount restored;
    set_thread_count(2);
    const std::vector<std::string> side_by_side = lines_of(tiny.run().scores);
    tiny.options.one_by_one = true;
    const std::vector<std::string> one_by_one = lines_of(tiny.run().scores);
    set_thread_count(1);
    tiny.options.one_by_one = false;
    const std::vector<std::string> on_one_thread = lines_of(tiny.run().scores);
    tiny.options.range = {1, 1};
    const std::vector<std::string> alone = lines_of(tiny.run().scores);
    REQUIRE(side_by_side.size() == 3);
    CHECK(side_by_side == one_by_one);
    CHECK(side_by_side == on_one_thread);
    CHECK(alone == std::vector<std::string>{side_by_side[1]});
    tiny.options.range = {12, -1};
    CHECK_THROWS_AS(tiny.run(), ConfigError);
}

TEST_CASE("A tuned face is scored as its files show it") {
    const ScratchFolder scratch;
    TinyEvaluation tiny;
    OneRank alone;
    ScoreFolder folder(scratch.path() / "out", {}, "5", alone);
    tiny.options.folder = &folder;
    tiny.options.range = {0, 0};
    tiny.fitting.tuning.steps = 3;
    // Tuning that ends worse than it began is not kept.
    tiny.fitting.tuning.learning_rate = 1e-3;
    tiny.fitting.tuning.weights = {.regularizer = 0.0};
    const FaceScore score = tiny.run().scores.front();
    const RegionScore& head = score.regions.front();
    REQUIRE(head.tuned);
    CHECK(head.tuned->l1 != head.fitted->l1);

    Model tuned = Model::load(tiny_run() / "run/model.safetensors", ModelParts::decoder);
    WeightChanges::load(folder.tuned_of(score.id)).apply(tuned);
    const CodeFile codes = read_code_file(folder.codes_of(score.id));
    const ComparedFace face = compared_face(tiny.model, tiny.faces, 0, tiny.options);
    const View view =
        render_view(tuned, codes.codes, 0, face.batch.cameras.front(),
                    {.samples_per_ray = tuned.config().reconstruction.fit_samples_per_ray});
    const MetricTarget measured(display_image(face.batch.targets.back(), 0),
                                display_mask(face.masks.front(), 0), nullptr);
    CHECK(measured.measure(view.image).l1 == Approx(head.tuned->l1).epsilon(1e-4));
    const Tensor sheet = score_sheet(tiny.job(), tiny.faces, tiny.options, sheet_rows({score}));
    CHECK(sheet.shape(1) > 7 * 64 - 1);
}

TEST_CASE("An evaluation goes on where it was stopped, without the line that was cut off") {
    const ScratchFolder scratch;
    const Settings settings{{"--steps", 2}, {"--fit", true}};
    OneRank alone;
    TinyEvaluation tiny;
    {
        ScoreFolder folder(scratch.path() / "out", settings, "5", alone);
        tiny.options.folder = &folder;
        tiny.options.range = {0, 1};
        static_cast<void>(tiny.run());
    }
    const fs::path file = scratch.path() / "out/scores.jsonl";
    const std::string two_lines = read_file(file);
    std::ofstream(file, std::ios::app) << R"({"id":"00002","head":{"ini)";
    const std::string cut_off = read_file(file);
    ScoreFolder folder(scratch.path() / "out", settings, "5", alone);
    CHECK(folder.score("00001").id == "00001");
    CHECK_FALSE(folder.results().contains("00002"));
    // Another process may be writing the line.
    CHECK(read_file(file) == cut_off);
    tiny.options.folder = &folder;
    tiny.options.range = {0, 2};
    const Evaluation continued = tiny.run();
    CHECK(read_file(file) == two_lines + to_json(continued.scores[2]).text() + "\n");
    CHECK(read_code_file(folder.codes_of("00002")).model == "5");
    tiny.options.folder = nullptr;
    CHECK(lines_of(continued.scores) == lines_of(tiny.run().scores));
}

TEST_CASE("A folder of scores that was begun otherwise is refused by the setting that differs") {
    const ScratchFolder scratch;
    OneRank alone;
    const auto open = [&](std::int64_t steps) {
        ScoreFolder(scratch.path() / "out", {{"--fit", true}, {"--steps", steps}}, "5", alone)
            .results()
            .begin();
    };
    open(100);
    CHECK_NOTHROW(open(100));
    CHECK_THAT(error_message([&] { open(50); }),
               Catch::Contains("other settings (--steps was 100, now 50)"));
    write_file(scratch.path() / "out/scores.jsonl", "{}\n");
    CHECK_THAT(error_message([&] { open(100); }), Catch::Contains("scores.jsonl, line 1: "));
    fs::create_directory(scratch.path() / "other");
    write_file(scratch.path() / "other/scores.jsonl", "");
    CHECK_THAT(error_message([&] { ScoreFolder(scratch.path() / "other", {}, "5", alone); }),
               Catch::Contains("settings.json"));
}

TEST_CASE("The face's region is scored within the head, of the folder's parsing or by a parser") {
    const ScratchFolder scratch;
    const fs::path folder = scratch.path() / "faces";
    fs::create_directories(folder / "parsing");
    fs::copy(tiny_run() / "faces/images", folder / "images");
    fs::copy(tiny_run() / "faces/masks", folder / "masks");
    // The head is skin on the left half, hair on the right.
    for (const char* id : {"00000", "00001"}) {
        Tensor classes({64, 64, 1});
        const std::span<float> values = classes.mutable_values<float>();
        for (std::size_t i = 0; i < values.size(); ++i)
            values[i] = (i % 64 < 32 ? 1.0F : 13.0F) / 255.0F;
        write_image(folder / "parsing" / (std::string(id) + ".png"), classes);
    }
    TinyEvaluation tiny;
    tiny.faces = Dataset(folder, 64, {.cache_megabytes = 0}, Split::all);
    tiny.options.fit = false;
    tiny.options.regions = {Region::head, Region::face};
    FaceRegion by_folder;
    tiny.options.face_region = &by_folder;

    const ComparedFace face = compared_face(tiny.model, tiny.faces, 0, tiny.options);
    const std::vector<double> head = face.masks[0].to_vector();
    const std::vector<double> left = face.masks[1].to_vector();
    for (std::size_t i = 0; i < head.size(); ++i) REQUIRE(left[i] == (i % 64 < 32 ? head[i] : 0.0));
    const Evaluation evaluation = tiny.run();
    REQUIRE(evaluation.scores.size() == 2);
    CHECK(evaluation.failed.size() == 1);
    CHECK_THAT(evaluation.failed.front().reason,
               Catch::Contains("00002.png") && Catch::Contains("--parser"));
    const std::vector<RegionScore>& regions = evaluation.scores.front().regions;
    CHECK(regions[1].initial.l1 > 0.0);
    CHECK(regions[1].initial.l1 < regions[0].initial.l1);

    FaceRegion by_parser(STYMO_SOURCE_DIR "/tests/golden/onnx/face_parser_celebamask.onnx");
    tiny.options.face_region = &by_parser;
    CHECK(tiny.run().failed.empty());
    tiny.options.face_region = &by_folder;
    tiny.options.range = {3, 5};
    CHECK_THAT(error_message([&] { static_cast<void>(tiny.run()); }),
               Catch::Contains("--region") && Catch::Contains("--parser"));
}

TEST_CASE("The split is that of the model's run, or there is none") {
    CHECK(split_called("") == Split::all);
    CHECK(split_called("val") == Split::validation);
    CHECK_THROWS_AS(split_called("rest"), UsageError);
    CHECK(split_of_run(tiny_run() / "run/model.safetensors").test == 2);
    CHECK(split_of_run(tiny_run() / "run/checkpoints/000004/model.safetensors").held_out == "last");
    CHECK_THROWS_WITH(split_of_run(tiny_run() / "fit/model.safetensors"), Catch::Contains("--ids"));
}

TEST_CASE(
    "The page of an evaluation has its table, what failed, the sheet's rows and the settings") {
    const std::string page =
        report_page({three_scores, {{"d", "d.png: not an image"}}},
                    {{{"--steps", 100}}, "vgg16, random weights", sheet_rows(three_scores)});
    CHECK_THAT(page, Catch::Contains("3 faces, 1 failed") &&
                         Catch::Contains(
                             "| head   | fitted  | mean   | 0.1000            | 0.0300    |") &&
                         Catch::Contains("- d: d.png: not an image") &&
                         Catch::Contains("LPIPS: vgg16, random weights") &&
                         Catch::Contains("| 1   | a    | best   | 24.00   |") &&
                         Catch::Contains("| `--steps` | 100   |"));
}
