#include <catch2/catch.hpp>
#include <cmath>

#include "core/autograd/grad.h"
#include "core/ops/ops.h"
#include "nn/optim/adam.h"
#include "render/tracked_rays.h"
#include "support/check_close.h"
#include "train/photo_offsets.h"
#include "train/step_gradients.h"
#include "train/tiny_training.h"
#include "train/trainer.h"

namespace photo_offset_tests {

using namespace stymo;
using namespace stymo::test;

namespace {

const Dataset& faces() {
    static const Dataset all = synthetic_dataset();
    return all;
}

/// The first two photos, and the mirror image of the first one.
FaceBatch batch_with_mirror_image() {
    return make_batch(std::vector{faces().load(0), faces().load(1), mirrored(faces().load(0))});
}

/// Sets row 0 to `first`, and the last row so that the mean is zero.
void set_rows(const Parameter& offsets, const std::vector<double>& first) {
    std::vector<double> values(static_cast<std::size_t>(offsets.variable().value().size()));
    for (std::size_t i = 0; i < first.size(); ++i) {
        values[i] = first[i];
        values[values.size() - first.size() + i] = -first[i];
    }
    offsets.set_value(Tensor::from(offsets.variable().shape(), std::span<const double>(values))
                          .to(DType::float32));
}

TrainConfig with_poses(std::int64_t interval) {
    TrainConfig config = tiny_train_config();
    config.stage1.pose_interval = interval;
    config.optimizer.sample_tolerance = 1e-3;
    return config;
}

}  // namespace

TEST_CASE("a learnt offset moves the camera of its photo, and mirrored that of the mirror image",
          "[poses]") {
    const FaceBatch batch = batch_with_mirror_image();
    PhotoOffsets offsets(faces().ids(), {.poses = true});
    const std::vector<Camera> unmoved = face_cameras(batch, &offsets);
    for (std::size_t i = 0; i < 3; ++i)
        CHECK(unmoved[i].center.isApprox(batch.cameras[i].center, 1e-6));
    set_rows(offsets.parameters().all().front(), {2.0, -1.0, 0.5, 0.3, 0.2, -0.4});
    const std::vector<Camera> moved = face_cameras(batch, &offsets);
    const Pose before = pose_from_camera(batch.cameras[0]), after = pose_from_camera(moved[0]);
    CHECK(after.yaw - before.yaw == Approx(0.1).margin(1e-5));
    CHECK(after.pitch - before.pitch == Approx(-0.05).margin(1e-5));
    CHECK(after.roll - before.roll == Approx(0.025).margin(1e-5));
    CHECK(moved[1].center.isApprox(batch.cameras[1].center, 1e-6));
    const Camera expected =
        camera_from_pose(mirrored(pose_from_camera(moved[0])), batch.cameras[2].intrinsics);
    CHECK(moved[2].center.isApprox(expected.center, 1e-5));
    CHECK(moved[2].world_from_camera.isApprox(expected.world_from_camera, 1e-5));
}

TEST_CASE("a step leaves the poses of photos that it does not show as they are", "[poses]") {
    const FaceBatch batch = make_batch(std::vector{faces().load(0), faces().load(2)});
    PhotoOffsets offsets(faces().ids(), {.poses = true});
    const Variable& all = offsets.parameters().all().front().variable();
    const Tensor gradient = grad(sum(square(offsets.orbits(batch))), all).value();
    for (std::int64_t row = 0; row < 4; ++row) {
        const Tensor own = slice(Variable(gradient), 0, row, row + 1).value();
        const bool shown = row == 0 || row == 2;
        CHECK((sum(abs(Variable(own))).value().item() > 0.0) == shown);
    }
}

TEST_CASE("a photo and its mirror image have an offset of their code each", "[codes]") {
    const FaceBatch batch = batch_with_mirror_image();
    PhotoOffsets offsets(faces().ids(), {.codes = true, .mirrored_codes = true});
    const Parameter& light = offsets.parameters().all().back();
    CHECK(light.variable().shape() == Shape{8, code_sizes[3]});
    light.set_value(Rng(3).normal(light.variable().shape(), 0.0, 1.0));
    const Tensor rows = offsets.codes(batch).light().value();
    const auto row = [](const Tensor& x, std::int64_t i) {
        return slice(Variable(x), 0, i, i + 1).value();
    };
    CHECK(identical(row(rows, 0), row(light.variable().value(), 0)));
    CHECK(identical(row(rows, 1), row(light.variable().value(), 1)));
    CHECK(identical(row(rows, 2), row(light.variable().value(), 4)));
}

TEST_CASE("each photo has the light of its source, which a checkpoint keeps by name", "[codes]") {
    FaceBatch batch = batch_with_mirror_image();
    batch.sources = {"", "studio", "synthetic"};
    PhotoOffsets offsets(faces().ids(), {.poses = true, .sources = {"studio", "synthetic"}});
    const Tensor studio = Rng(3).normal({code_sizes[3]}, 0.0, 1.0);
    const Tensor synthetic = Rng(4).normal({code_sizes[3]}, 0.0, 1.0);
    TensorFile file;
    file.tensors = {{"sources.studio", studio}, {"sources.synthetic", synthetic}};
    offsets.load(file, "state");
    const auto row = [](const Variable& x, std::int64_t i) {
        return slice(x, 0, i, i + 1).value().reshaped({code_sizes[3]});
    };
    const Variable lights = offsets.source_lights(batch);
    const auto is_zero = [](const Tensor& x) {
        return sum(abs(Variable(x))).value().item() == 0.0;
    };
    CHECK(is_zero(row(lights, 0)));
    CHECK(identical(row(lights, 1), studio));
    CHECK(identical(row(lights, 2), synthetic));

    Rng weights(1);
    const Model model(tiny_train_config().model, weights);
    const Variable moved = face_codes(model, batch, &offsets).light();
    CHECK(
        identical(row(moved, 1),
                  (Variable(row(face_codes(model, batch).light(), 1)) + Variable(studio)).value()));

    PhotoOffsets others(faces().ids(), {.sources = {"new", "synthetic"}});
    others.load(file, "state");
    batch.sources = {"new", "studio", "synthetic"};
    CHECK(is_zero(row(others.source_lights(batch), 0)));
    CHECK(is_zero(row(others.source_lights(batch), 1)));
    CHECK(identical(row(others.source_lights(batch), 2), synthetic));
    CHECK_FALSE(PhotoOffsets(faces().ids(), {.poses = true}).source_lights(batch).defined());

    // The name of one source begins with that of another.
    PhotoOffsets more(faces().ids(), {.sources = {"studio", "studio2"}});
    more.load(file, "state");
    batch.sources = {"studio2", "", "studio"};
    CHECK(is_zero(row(more.source_lights(batch), 0)));
    CHECK(identical(row(more.source_lights(batch), 2), studio));
}

TEST_CASE("an offset that all photos share moves no camera", "[poses]") {
    const FaceBatch batch = batch_with_mirror_image();
    PhotoOffsets offsets(faces().ids(), {.poses = true});
    const Parameter& all = offsets.parameters().all().front();
    all.set_value(Tensor::full(all.variable().shape(), 0.7));
    const std::vector<Camera> cameras = face_cameras(batch, &offsets);
    for (std::size_t i = 0; i < 3; ++i)
        CHECK(cameras[i].center.isApprox(batch.cameras[i].center, 1e-5));
}

TEST_CASE("a step's gradient leads wrong poses back to those from which the model drew the photos",
          "[poses]") {
    TrainConfig config = with_poses(1);
    config.loss = {.mask_weight = 0.0, .opacity_weight = 0.0};
    config.loss.code_weights = {0.0, 0.0, 0.0, 0.0};
    config.optimizer.sample_tolerance = 0.0;
    const TrainingPosition position = TrainingSchedule(config).position(0);
    Rng weights(1);
    Model model(config.model, weights);
    const ReconstructionLoss reconstruction(config.model.reconstruction);
    FaceBatch batch = make_batch(std::vector{faces().load(0), faces().load(1)});
    const std::vector<double> wrong{0.1, -0.1};
    const Codes codes = detached(face_codes(model, batch));
    batch.targets = {
        model.decoder()(codes, batch.cameras, {.samples_per_ray = 4}).images.back().value()};
    std::vector<double> truth;
    for (std::size_t i = 0; i < 2; ++i) {
        Pose pose = pose_from_camera(batch.cameras[i]);
        truth.push_back(pose.yaw);
        batch.cameras[i] = camera_from_pose(
            orbit_pose(pose.yaw + wrong[i], pose.pitch, pose.roll, pose.translation.norm()),
            batch.cameras[i].intrinsics);
    }
    model.parameters().set_trainable("", false);
    PhotoOffsets offsets(batch.ids, {.poses = true});
    const std::vector<Parameter> learnt = offsets.parameters().trainable();
    Adam adam({0.9, 0.999, 1e-8});
    for (int step = 0; step < 60; ++step) {
        Rng jitter(2);
        const LossAndGradients result = generator_gradients(
            {model, reconstruction, config, &offsets}, position, batch, learnt, jitter);
        adam.step(learnt, result.gradients, 0.05);
    }
    const std::vector<Camera> found = face_cameras(batch, &offsets);
    for (std::size_t i = 0; i < 2; ++i)
        CHECK(std::abs(pose_from_camera(found[i]).yaw - truth[i]) < 0.05);
}

TEST_CASE("poses learn in every n-th step alone, and a run that resumes gives the same bits",
          "[poses]") {
    const ScratchFolder folder;
    const auto trained = [&](const std::string& name, std::int64_t stop) {
        TrainConfig config = with_poses(2);
        if (stop > 0) {
            TrainConfig first = config;
            first.stage1.steps = stop;
            Trainer trainer(first, faces(), nullptr, 5);
            CHECK(trainer.run(RunFolder(folder / name, false), {}).finished);
        }
        const RunFolder run(folder / name, stop > 0);
        Trainer trainer(config, faces(), nullptr, 5);
        if (stop > 0) trainer.resume(run.checkpoint(stop));
        CHECK(trainer.run(run, {}).finished);
        return read_tensor_file(run.checkpoint(4) / "state.safetensors").tensors;
    };
    const auto whole = trained("whole", 0), parts = trained("parts", 1);
    CHECK(identical(whole.at("poses.offset"), parts.at("poses.offset")));
    // Of the four steps the first and the third one learn poses.
    const auto after = [&](std::int64_t steps) {
        TrainConfig config = with_poses(2);
        config.stage1.steps = steps;
        const RunFolder run(folder / std::to_string(steps), false);
        CHECK(Trainer(config, faces(), nullptr, 5).run(run, {}).finished);
        return read_tensor_file(run.checkpoint(steps) / "state.safetensors")
            .tensors.at("poses.offset");
    };
    const Tensor one = after(1), two = after(2), three = after(3);
    CHECK(identical(one, two));
    CHECK_FALSE(identical(two, three));
    CHECK(identical(three, whole.at("poses.offset")));
    // A run that did not learn poses goes on learning them.
    TrainConfig without = with_poses(0), config = with_poses(2);
    without.stage1.steps = 2;
    CHECK(
        Trainer(without, faces(), nullptr, 5).run(RunFolder(folder / "later", false), {}).finished);
    Trainer later(config, faces(), nullptr, 5);
    later.resume(folder / "later/checkpoints/000002");
    CHECK(later.run(RunFolder(folder / "later", true), {}).finished);
    const auto offsets_at = [&](const char* step) {
        return read_tensor_file(folder / "later/checkpoints" / step / "state.safetensors")
            .tensors.at("poses.offset");
    };
    const Tensor learnt = offsets_at("000004");
    CHECK(sum(abs(Variable(learnt))).value().item() > 0.0);
    // A run that no longer learns poses keeps them.
    without.stage1.steps = 5;
    Trainer last(without, faces(), nullptr, 5);
    last.resume(folder / "later/checkpoints/000004");
    CHECK(last.run(RunFolder(folder / "later", true), {}).finished);
    CHECK(identical(offsets_at("000005"), learnt));
    TrainingPosition position = TrainingSchedule(config).position(1);
    CHECK_FALSE(learns_poses(config, position));
    position = TrainingSchedule(config).position(2);
    CHECK(learns_poses(config, position));
}

TEST_CASE("learnt poses go on into the second stage as they are, beside learnt codes too",
          "[poses]") {
    for (const std::string source : {"encoder", "encoder_offset"}) {
        INFO(source);
        const ScratchFolder folder;
        TrainConfig config = tiny_two_stage_config();
        config.model.code_source = source;
        config.stage1.pose_interval = 1;
        const Dataset large = synthetic_dataset(128);
        const auto offsets_at = [&](const char* step) {
            return read_tensor_file(folder / "run/checkpoints" / step / "state.safetensors")
                .tensors.at("poses.offset");
        };
        CHECK(
            Trainer(config, large, nullptr, 5).run(RunFolder(folder / "run", false), {}).finished);
        const Tensor learnt = offsets_at("000002");
        CHECK(sum(abs(Variable(learnt))).value().item() > 0.0);
        CHECK(identical(offsets_at("000006"), learnt));
        // Also if the run that goes on does not learn poses.
        config.stage1.pose_interval = 0;
        config.output.keep_last = 9;
        Trainer without(config, large, nullptr, 5);
        without.resume(folder / "run/checkpoints/000002");
        CHECK(without.run(RunFolder(folder / "run", true), {}).finished);
        CHECK(identical(offsets_at("000006"), learnt));
    }
}

}  // namespace photo_offset_tests
