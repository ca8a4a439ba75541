#include <algorithm>
#include <catch2/catch.hpp>
#include <chrono>
#include <cmath>
#include <csignal>
#include <iomanip>
#include <limits>
#include <nlohmann/json.hpp>
#include <numbers>
#include <sstream>
#include <thread>

#include "core/interrupt.h"
#include "core/io/file.h"
#include "core/ops/ops.h"
#include "nn/pretrained/backbones/mobilefacenet.h"
#include "support/check_close.h"
#include "support/error_message.h"
#include "support/thread_count.h"
#include "train/plan.h"
#include "train/tick.h"
#include "train/tiny_training.h"
#include "train/trainer.h"

namespace trainer_tests {

using namespace stymo;
using namespace stymo::test;
namespace fs = std::filesystem;

namespace {

const Dataset& faces() {
    static const Dataset dataset = synthetic_dataset();
    return dataset;
}

/// Trains in `folder` until `steps` are done, from the checkpoint of `resume_from` if that is not
/// negative.
TrainingOutcome train(TrainConfig config, const fs::path& folder, std::int64_t steps,
                      std::int64_t resume_from = -1, const Dataset* validation = nullptr) {
    config.stage1.steps = steps;
    const RunFolder run(folder, resume_from >= 0);
    Trainer trainer(config, faces(), validation, 5);
    if (resume_from >= 0) trainer.resume(run.checkpoint(resume_from));
    return trainer.run(run, {});
}

/// Weights, their EMA, moments and state are all in these files, to the last bit.
void check_same_run(const fs::path& a, const fs::path& b, const std::string& checkpoint) {
    const fs::path folder = fs::path("checkpoints") / checkpoint;
    for (const fs::path& file : {folder / "model.safetensors", folder / "state.safetensors",
                                 fs::path("model.safetensors")}) {
        INFO(file.string());
        CHECK(read_file(a / file) == read_file(b / file));
    }
    CHECK(statistics(a) == statistics(b));
}

std::vector<Tensor> values_of(const Model& model) {
    std::vector<Tensor> values;
    for (const Parameter& parameter : model.parameters().all())
        values.push_back(parameter.variable().value());
    return values;
}

Parameter parameter_named(const Model& model, const std::string& name) {
    const auto& all = model.parameters().all();
    const auto found = std::ranges::find(all, name, &Parameter::name);
    REQUIRE(found != all.end());
    return *found;
}

/// A mobilefacenet with random weights in the file format of the published ones.
void write_backbone_weights(const fs::path& path) {
    Rng rng(3);
    TensorFile file;
    for (const auto& [name, shape] : mobilefacenet_tensors()) {
        const double inputs =
            shape.rank() == 4 ? static_cast<double>(shape[1] * shape[2] * shape[3]) : 0.0;
        file.tensors[name] =
            inputs > 0.0 ? rng.normal(shape, 0.0, std::sqrt(2.0 / inputs))
                         : Tensor::full(shape, name.ends_with("weight") || name.ends_with("var"));
    }
    write_tensor_file(path, file);
}

}  // namespace

TEST_CASE("a finished run that is resumed tells of no loss", "[trainer]") {
    const ScratchFolder folder;
    const RunFolder run(folder / "run", false);
    const TrainingOutcome done = train(tiny_train_config(), folder / "run", 1);
    CHECK_THAT(outcome_text(done, run), Catch::Contains("steps 1, loss "));
    const TrainingOutcome outcome = train(tiny_train_config(), folder / "run", 1, 1);
    CHECK(outcome.finished);
    CHECK_FALSE(outcome.last_tick);
    CHECK_THAT(outcome_text(outcome, run), !Catch::Contains("loss"));
    CHECK_THAT(to_json(outcome, run).text(),
               Catch::Contains(R"("loss":null,"reconstruction":null)"));
}

TEST_CASE("a run that stops and resumes gives the same bits as one that does not", "[trainer]") {
    const ScratchFolder folder;
    TrainConfig config = tiny_train_config();
    config.loss.mask_start_epoch = 2;  // after step 4
    static_cast<void>(train(config, folder / "whole", 6));
    for (const std::int64_t stop : {1, 3, 4}) {
        const fs::path run = folder / std::to_string(stop);
        CHECK(train(config, run, stop).finished);
        const TrainingOutcome outcome = train(config, run, 6, stop);
        CHECK(outcome.steps == 6);
        CHECK(outcome.finished);
        INFO("stopped after step " << stop);
        check_same_run(folder / "whole", run, "000006");
    }
    const std::vector<nlohmann::json> lines = statistics(folder / "whole");
    REQUIRE(lines.size() == 6);
    for (std::size_t step = 1; step <= 6; ++step)
        CHECK((lines[step - 1]["mask"].get<double>() > 0.0) == (step > 4));
}

TEST_CASE(
    "resuming is exact across the epoch in which the backbone is unfrozen and the mask loss sets "
    "in",
    "[trainer]") {
    const ScratchFolder folder;
    TrainConfig config = tiny_train_config();
    write_backbone_weights(folder / "backbone.safetensors");
    config.model.encoder.backbone = "mobilefacenet";
    config.model.encoder.backbone_weights = (folder / "backbone.safetensors").string();
    config.optimizer.backbone_frozen_epochs = 1;
    config.loss.mask_start_epoch = 1;  // both after step 2
    static_cast<void>(train(config, folder / "whole", 3));
    static_cast<void>(train(config, folder / "parts", 1));
    static_cast<void>(train(config, folder / "parts", 2, 1));

    const std::string backbone = "adam.encoder.backbone.embed.conv.weight.first";
    const fs::path checkpoints = folder / "parts/checkpoints";
    CHECK(read_tensor_file(checkpoints / "000002/state.safetensors").tensors.count(backbone) == 0);
    static_cast<void>(train(config, folder / "parts", 3, 2));
    CHECK(read_tensor_file(checkpoints / "000003/state.safetensors").tensors.count(backbone) == 1);
    check_same_run(folder / "whole", folder / "parts", "000003");
    CHECK(statistics(folder / "parts").back()["mask"].get<double>() > 0.0);

    const TensorFile frozen = read_tensor_file(checkpoints / "000001/model.safetensors");
    const TensorFile still_frozen = read_tensor_file(checkpoints / "000002/model.safetensors");
    const TensorFile unfrozen = read_tensor_file(checkpoints / "000003/model.safetensors");
    const std::string weight = "encoder.backbone.embed.conv.weight";
    CHECK(identical(frozen.tensors.at(weight), still_frozen.tensors.at(weight)));
    CHECK_FALSE(identical(frozen.tensors.at(weight), unfrozen.tensors.at(weight)));
}

TEST_CASE("a run begins with the weights of another model, also of 16 bits", "[trainer]") {
    const ScratchFolder folder;
    static_cast<void>(train(tiny_train_config(), folder / "first", 2));
    const fs::path model_file = folder / "first/model.safetensors";
    Trainer trainer(tiny_train_config(), faces(), nullptr, 6);
    CHECK(trainer.begin_with(model_file).empty());
    CHECK(trainer.state().step == 0);
    CHECK(all_identical(values_of(trainer.model()), values_of(Model::load(model_file))));
    CHECK_FALSE(trainer.step().non_finite);

    const fs::path halves = folder / "half.safetensors";
    write_tensor_file(halves, read_tensor_file(model_file), StoredElements::float16);
    CHECK(trainer.begin_with(halves).empty());
    CHECK(all_identical(values_of(trainer.model()), values_of(Model::load(halves))));

    TrainConfig nearer = tiny_train_config();
    nearer.model.camera.intrinsics.focal *= 0.5;
    Trainer of_other_photos(nearer, faces(), nullptr, 6);
    CHECK_THAT(of_other_photos.begin_with(model_file), Catch::Contains("stymo-prep --focal"));

    TrainConfig wider = tiny_train_config();
    wider.model.decoder.field_width = 12;
    Trainer other(wider, faces(), nullptr, 5);
    CHECK(error_message([&] { return other.begin_with(model_file); }).find("shape") !=
          std::string::npos);
}

TEST_CASE("the first losses of a run are those written down here", "[trainer]") {
    Trainer trainer(tiny_train_config(), faces(), nullptr, 5);
    const std::vector<double> expected{7.375521183, 1.306274116, 8.4707150459};
    for (const double total : expected)
        CHECK(trainer.step().losses.total == Approx(total).epsilon(1e-4));
}

TEST_CASE("how many images are computed at once does not change a step", "[trainer]") {
    TrainConfig config = tiny_train_config();
    config.stage1.steps = 1;
    config.stage1.batch = 4;
    config.loss.mask_start_epoch = 0;
    std::vector<LossValues> losses;
    std::vector<std::vector<Tensor>> moments;
    for (const std::int64_t micro_batch : {1, 2, 4}) {
        config.stage1.micro_batch = micro_batch;
        const ScratchFolder folder;
        Trainer trainer(config, faces(), nullptr, 5);
        losses.push_back(trainer.step().losses);
        CHECK(losses.back()["mask"] > 0.0);
        static_cast<void>(trainer.run(RunFolder(folder.path(), false), {}));
        // Adam's first step depends on the sign of a gradient alone; its first moment is a tenth of
        // the gradient itself.
        const TensorFile state = read_tensor_file(folder / "checkpoints/000001/state.safetensors");
        moments.emplace_back();
        for (const auto& [name, tensor] : state.tensors)
            if (name.starts_with("adam.") && name.ends_with(".first"))
                moments.back().push_back(tensor);
    }
    for (std::size_t run = 1; run < 3; ++run) {
        CHECK(losses[run].total == Approx(losses[0].total).epsilon(1e-5));
        REQUIRE(moments[run].size() == moments[0].size());
        for (std::size_t i = 0; i < moments[0].size(); ++i) {
            const CloseReport report = check_close(moments[run][i], moments[0][i], 1e-5);
            INFO(report.message);
            CHECK(report.passed);
        }
    }
}

TEST_CASE("one and two threads train to the same bits", "[trainer]") {
    const ThreadCount before;
    std::vector<std::vector<Tensor>> values;
    for (const int threads : {1, 2}) {
        set_thread_count(threads);
        Trainer trainer(tiny_train_config(), faces(), nullptr, 5);
        for (int step = 0; step < 3; ++step) static_cast<void>(trainer.step());
        values.push_back(values_of(trainer.model()));
    }
    CHECK(all_identical(values[0], values[1]));
}

TEST_CASE(
    "steps without a finite gradient change nothing, and too many of them in a row end the run by "
    "name",
    "[trainer]") {
    Trainer trainer(tiny_train_config(), faces(), nullptr, 5);
    static_cast<void>(trainer.step());
    const Parameter parameter = parameter_named(trainer.model(), "decoder.field.density.weight");
    const Tensor healthy = parameter.variable().value();
    const Tensor broken = Tensor::full(healthy.shape(), std::numeric_limits<double>::quiet_NaN());

    parameter.set_value(broken);
    const std::vector<Tensor> before = values_of(trainer.model());
    for (const std::int64_t failures : {1, 2}) {
        static_cast<void>(trainer.step());
        CHECK(trainer.state().failures == failures);
    }
    CHECK(trainer.state().step == 3);
    CHECK(all_identical(values_of(trainer.model()), before));

    parameter.set_value(healthy);
    CHECK(std::isfinite(trainer.step().losses.total));
    CHECK(trainer.state().failures == 0);

    parameter.set_value(broken);
    for (int step = 0; step < 2; ++step) static_cast<void>(trainer.step());
    const std::string message =
        error_message<NumericError>([&] { static_cast<void>(trainer.step()); });
    CHECK(is_one_line(message));
    CHECK_THAT(message, Catch::Contains("step 7") &&
                            Catch::Contains("encoder.backbone.conv0.weight") &&
                            Catch::Contains("3 steps in a row") &&
                            Catch::Contains("optimizer.learning_rate"));
}

TEST_CASE("a backbone that has published weights needs them, or random ones by that name",
          "[trainer]") {
    TrainConfig config = tiny_train_config();
    config.model.encoder.backbone = "mobilefacenet";
    const std::string message =
        error_message<ConfigError>([&] { Trainer(config, faces(), nullptr, 5); });
    CHECK(is_one_line(message));
    CHECK_THAT(message, Catch::Contains("encoder.backbone_weights") &&
                            Catch::Contains("stymo-weights import") && Catch::Contains("random"));
    config.model.encoder.backbone_weights = "random";
    config.optimizer.backbone_frozen_epochs = 1;
    Trainer trainer(config, faces(), nullptr, 5);
    static_cast<void>(trainer.step());
    // Random weights learn from the first step on.
    CHECK(parameter_named(trainer.model(), "encoder.backbone.embed.conv.weight").trainable());
    // Those of a model or a checkpoint wait, though no file is named.
    config.model.encoder.backbone_weights.clear();
    assume_weights(config.model.encoder);
    Trainer resumed(config, faces(), nullptr, 5);
    static_cast<void>(resumed.step());
    CHECK_FALSE(parameter_named(resumed.model(), "encoder.backbone.embed.conv.weight").trainable());
}

TEST_CASE("a photo near profile is skipped and named where the sampling planes are of the world",
          "[trainer]") {
    const ScratchFolder folder;
    fs::copy(synthetic_folder(), folder.path() / "faces", fs::copy_options::recursive);
    std::istringstream lines(read_file(synthetic_folder() / "faces.jsonl"));
    std::string records;
    for (std::string line; std::getline(lines, line);) {
        nlohmann::json record = nlohmann::json::parse(line);
        if (record["id"] == "00001") record["pose"]["yaw_deg"] = 80.0;
        records += record.dump() + "\n";
    }
    write_file(folder.path() / "faces/faces.jsonl", records);
    TrainConfig config = tiny_train_config();
    const Dataset training = faces_for_training(folder.path() / "faces", config, Split::training);
    CHECK(training.ids() == std::vector<std::string>{"00000", "00002", "00003"});
    const std::string summary = training.summary().text();
    CHECK_THAT(summary, Catch::Contains("3 faces") && Catch::Contains("1 skipped") &&
                            Catch::Contains("00001.png: "));
    CHECK(std::ranges::count(summary, '\n') == 1);
    config.stage1.steps = 4;
    Trainer trainer(config, training, nullptr, 5);
    CHECK(trainer.run(RunFolder(folder.path() / "run", false), {}).finished);
    config.model.decoder.depth_planes = "optical_axis";
    CHECK(faces_for_training(folder.path() / "faces", config, Split::training).size() == 4);
}

TEST_CASE("a model with half as many rays trains, on images from half the side on", "[trainer]") {
    TrainConfig config = tiny_train_config();
    config.model.decoder.rays.rays_per_side = 16;
    config.model.decoder.block_channels = {6, 4};
    config.model.reconstruction.resolution_weights = {0.5, 1.0};
    Trainer trainer(config, faces(), nullptr, 5);
    CHECK(std::isfinite(trainer.step().losses.total));
    CHECK(trainer.model().decoder().ladder().sides() == std::vector<std::int64_t>{32, 64});
}

TEST_CASE("the learning rate falls by its schedule", "[trainer]") {
    const ScratchFolder folder;
    TrainConfig config = tiny_train_config();
    config.optimizer.decay = 0.5;
    static_cast<void>(train(config, folder / "epoch", 5));
    config.optimizer.schedule = "cosine";
    static_cast<void>(train(config, folder / "cosine", 5));
    const std::vector<nlohmann::json> epoch = statistics(folder / "epoch");
    const std::vector<nlohmann::json> cosine = statistics(folder / "cosine");
    REQUIRE(epoch.size() == 5);
    REQUIRE(cosine.size() == 5);
    // Four faces and batches of two: an epoch is over after steps 2 and 4.
    const std::vector<double> factors{1.0, 1.0, 0.5, 0.5, 0.25};
    for (std::size_t i = 0; i < 5; ++i) {
        CHECK(epoch[i]["learning_rate"].get<double>() == Approx(1e-3 * factors[i]));
        const double angle = std::numbers::pi * static_cast<double>(i) / 5.0;
        CHECK(cosine[i]["learning_rate"].get<double>() ==
              Approx(0.5e-3 * (1.0 + std::cos(angle))).margin(1e-15));
    }
}

namespace {

/// A step leaves just the parameters with these prefixes where they are.
void check_still(const TrainConfig& config, const std::vector<std::string>& prefixes) {
    Trainer trainer(config, faces(), nullptr, 5);
    const std::vector<Tensor> before = values_of(trainer.model());
    static_cast<void>(trainer.step());
    const std::vector<Parameter>& parameters = trainer.model().parameters().all();
    for (std::size_t i = 0; i < parameters.size(); ++i) {
        const std::string& name = parameters[i].name();
        INFO(name);
        const bool still = std::ranges::any_of(
            prefixes, [&](const std::string& prefix) { return name.starts_with(prefix); });
        CHECK(identical(before[i], parameters[i].variable().value()) == still);
    }
}

}  // namespace

TEST_CASE("a frozen decoder stays where it is while the encoder learns", "[trainer]") {
    TrainConfig config = tiny_train_config();
    config.stage1.decoder_frozen = true;
    check_still(config, {"decoder."});
}

TEST_CASE("of a frozen encoder and decoder the corrections learn alone", "[trainer]") {
    TrainConfig config = tiny_train_config();
    config.model.encoder.corrections = 1;
    config.stage1.encoder_frozen = config.stage1.decoder_frozen = true;
    // The zeros after its hidden layers pass no gradient at first.
    check_still(config, {"encoder.backbone.", "encoder.heads.", "decoder.",
                         "encoder.corrector.wide.", "encoder.corrector.narrow."});
}

TEST_CASE("a factor of zero keeps the backbone where it is", "[trainer]") {
    TrainConfig config = tiny_train_config();
    config.optimizer.backbone_factor = 0.0;
    // The mask's branch takes no part before its loss does.
    check_still(config, {"encoder.backbone.", "decoder.mask."});
}

TEST_CASE("a first stage of fewer pixels than the model has leaves the finer blocks as they are",
          "[trainer]") {
    TrainConfig config = tiny_two_stage_config();
    config.stage1.resolution = 64;
    config.loss.mask_start_epoch = 0;
    Trainer trainer(config, faces(), nullptr, 5);
    const std::vector<Tensor> before = values_of(trainer.model());
    static_cast<void>(trainer.step());
    const std::vector<Parameter>& parameters = trainer.model().parameters().all();
    for (std::size_t i = 0; i < parameters.size(); ++i) {
        const std::string& name = parameters[i].name();
        INFO(name);
        const bool still =
            name.starts_with("decoder.block128.") || name.starts_with("decoder.mask.");
        CHECK(identical(before[i], parameters[i].variable().value()) == still);
    }
}

TEST_CASE("a run that is told to stop leaves a checkpoint to go on from", "[trainer]") {
    const ScratchFolder folder;
    const fs::path run = folder / "run";
    TrainingOutcome outcome;
    {
        const InterruptGuard own;  // should the signal come before or after the run's guard
        const std::jthread sender([&](const std::stop_token& stop) {
            while (!fs::exists(run / "stats.jsonl") && !stop.stop_requested())
                std::this_thread::sleep_for(std::chrono::milliseconds(5));
            ::kill(::getpid(), SIGTERM);
        });
        outcome = train(tiny_train_config(), run, 100000);
        CHECK_FALSE(outcome.finished);
        REQUIRE(outcome.steps > 0);
        REQUIRE(outcome.steps < 100000);
        CHECK(RunFolder(run, true).latest_checkpoint() ==
              RunFolder(run, true).checkpoint(outcome.steps));
    }
    CHECK(train(tiny_train_config(), run, outcome.steps + 1, outcome.steps).finished);
}

TEST_CASE("a run keeps the model that scores best and samples of what it sees", "[trainer]") {
    const ScratchFolder folder;
    TrainConfig config = tiny_train_config();
    config.output.sample_steps = 2;
    const Dataset validation = synthetic_dataset();
    static_cast<void>(train(config, folder / "run", 2, -1, &validation));
    CHECK(fs::exists(folder / "run/samples/000002.png"));
    const Model best = Model::load(folder / "run/best.safetensors");
    const Model ema = Model::load(folder / "run/model.safetensors");
    CHECK(all_identical(values_of(best), values_of(ema)));
    const std::string log = read_file(folder / "run/log.txt");
    REQUIRE(ema.validation_psnr());
    std::ostringstream psnr;
    psnr << std::fixed << std::setprecision(2) << "PSNR " << *ema.validation_psnr() << " dB";
    CHECK_THAT(log, Catch::Contains(psnr.str()));
    const TensorFile raw = read_tensor_file(folder / "run/checkpoints/000002/model.safetensors");
    CHECK_FALSE(identical(parameter_named(ema, "decoder.field.density.weight").variable().value(),
                          raw.tensors.at("decoder.field.density.weight")));
}

TEST_CASE(
    "a run's model has the statistics of its own codes of the training faces, unless that is "
    "switched off",
    "[trainer]") {
    const ScratchFolder folder;
    TrainConfig config = tiny_train_config();
    static_cast<void>(train(config, folder / "run", 2));
    const Model model = Model::load(folder / "run/model.safetensors");
    REQUIRE(model.code_statistics());
    CHECK(model.code_statistics()->faces() == faces().size());
    std::vector<Variable> codes;
    for (std::int64_t i = 0; i < faces().size(); ++i)
        codes.push_back(
            joined(model.encoder()(Variable(make_batch(std::vector{faces().load(i)}).input))));
    const CodeStatistics expected = CodeStatistics::of(split_codes(concat(codes, 0)));
    CHECK(check_close(model.code_statistics()->mean(), expected.mean(), 1e-6).passed);
    CHECK(check_close(model.code_statistics()->factor(), expected.factor(), 1e-3).passed);
    CHECK_FALSE(Model::load(folder / "run/checkpoints/000002/model.safetensors").code_statistics());

    config.output.statistics_images = 0;
    static_cast<void>(train(config, folder / "without", 1));
    CHECK_FALSE(Model::load(folder / "without/model.safetensors").code_statistics());
    config.output.statistics_images = 3;
    static_cast<void>(train(config, folder / "some", 1));
    CHECK(Model::load(folder / "some/model.safetensors").code_statistics()->faces() == 3);
}

TEST_CASE("a checkpoint of another seed or another model is refused in one line", "[trainer]") {
    const ScratchFolder folder;
    static_cast<void>(train(tiny_train_config(), folder / "run", 1));
    const fs::path checkpoint = folder / "run/checkpoints/000001";

    Trainer other_seed(tiny_train_config(), faces(), nullptr, 6);
    const auto a_weight = [&] {
        return other_seed.model().parameters().all().front().variable().value();
    };
    const Tensor before = a_weight();
    const std::string seeds = error_message<FileError>([&] { other_seed.resume(checkpoint); });
    CHECK(is_one_line(seeds));
    CHECK_THAT(seeds, Catch::Contains("--seed 5"));
    CHECK(identical(a_weight(), before));

    TrainConfig wider = tiny_train_config();
    wider.model.decoder.field_width = 9;
    Trainer other_model(wider, faces(), nullptr, 5);
    const std::string shapes = error_message<FileError>([&] { other_model.resume(checkpoint); });
    CHECK(is_one_line(shapes));
    CHECK_THAT(shapes, Catch::Contains("model.safetensors") && Catch::Contains("decoder.field."));

    // Else the changed state would count as damaged.
    fs::remove(checkpoint / "checksums.txt");
    TensorFile state = read_tensor_file(checkpoint / "state.safetensors");
    state.tensors.erase("average.decoder.field.density.weight");
    write_tensor_file(checkpoint / "state.safetensors", state);
    Trainer with_ema(tiny_train_config(), faces(), nullptr, 5);
    const std::string average = error_message<FileError>([&] { with_ema.resume(checkpoint); });
    CHECK(is_one_line(average));
    CHECK_THAT(average, Catch::Contains("has no tensor average.decoder.field.density.weight"));

    state = read_tensor_file(folder / "run/checkpoints/000001/state.safetensors");
    state.tensors["average.decoder.field.density.weight"] =
        state.tensors.at("adam.decoder.field.density.weight.first");
    state.tensors.erase("adam.decoder.field.density.weight.steps");
    write_tensor_file(checkpoint / "state.safetensors", state);
    Trainer same(tiny_train_config(), faces(), nullptr, 5);
    const std::string moments = error_message<FileError>([&] { same.resume(checkpoint); });
    CHECK(is_one_line(moments));
    CHECK_THAT(moments, Catch::Contains("state.safetensors") &&
                            Catch::Contains("decoder.field.density.weight is incomplete"));
}

TEST_CASE("A loss that explodes while it is finite ends the run and keeps the last good checkpoint",
          "[trainer]") {
    TrainConfig config = tiny_train_config();
    config.output.checkpoint_steps = 1;
    config.optimizer.learning_rate = 1.0;
    for (const std::int64_t steps : {60, 16}) {
        INFO(steps << " steps");
        const ScratchFolder scratch;
        const std::string said =
            error_message<NumericError>([&] { train(config, scratch.path(), steps); });
        CHECK_THAT(said, Catch::Contains("above 1000 times the lowest of this phase") &&
                             Catch::Contains("lower optimizer.learning_rate"));
        CHECK(is_one_line(said));
        const nlohmann::json last = statistics(scratch.path()).back();
        const std::int64_t kept = *checkpoint_step(latest_checkpoint(scratch.path()));
        CHECK(last["loss"].get<double>() > 1000.0);
        CHECK(kept < last["step"].get<std::int64_t>());
    }
}

TEST_CASE("A loss that is only noisy, or fitted to almost nothing, does not end a run",
          "[trainer]") {
    LossWatch watch;
    for (int step = 0; step < 100; ++step) {
        watch.add(step % 10 == 9 ? 1e-9 : 5.0);
        CHECK(watch.high_steps() == 0);
    }
    watch.add(11.0);
    watch.add(12.0);
    CHECK(watch.high_steps() == 2);
    watch.add(9.0);
    CHECK(watch.high_steps() == 0);
}

}  // namespace trainer_tests
