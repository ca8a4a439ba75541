#include <catch2/catch.hpp>
#include <filesystem>

#include "support/check_close.h"
#include "train/photo_offsets.h"
#include "train/tiny_training.h"
#include "train/trainer.h"

namespace photo_change_tests {

using namespace stymo;
using namespace stymo::test;

namespace {

/// (rows, 2) with the number of the row in each.
Tensor numbered(std::int64_t rows) {
    Tensor result({rows, 2});
    const auto values = result.mutable_values<float>();
    for (std::size_t i = 0; i < values.size(); ++i) values[i] = static_cast<float>(i / 2 + 1);
    return result;
}

std::vector<double> first_column(const Tensor& rows) {
    std::vector<double> column;
    for (std::int64_t row = 0; row < rows.shape(0); ++row)
        column.push_back(rows.to_vector()[static_cast<std::size_t>(2 * row)]);
    return column;
}

TensorFile state_of(const std::vector<std::string>& ids) {
    const auto count = std::ssize(ids);
    TensorFile state;
    store_photo_ids(state, ids);
    state.tensors["poses.offset"] = numbered(count);
    state.tensors["codes.offset.id"] = numbered(2 * count);
    state.tensors["generator.adam.codes.offset.id.first"] = numbered(2 * count);
    state.tensors["generator.adam.codes.offset.id.steps"] = Tensor::full({1}, 7.0);
    state.tensors["decoder.field.layer0.weight"] = numbered(count);
    return state;
}

}  // namespace

TEST_CASE("offsets and their moments follow their photos", "[codes]") {
    TensorFile state = state_of({"a", "b", "c"});
    CHECK(follow_photos(state, {"a", "b", "c"}).empty());
    CHECK(first_column(state.tensors["poses.offset"]) == std::vector<double>{1, 2, 3});
    CHECK(follow_photos(state, {"b", "c", "d", "e"}) ==
          "the folder has changed since the checkpoint: 1 photo (a) gone, 2 photos (d, e) new; "
          "learnt offsets: 1 dropped, 2 from zero");
    CHECK(first_column(state.tensors["poses.offset"]) == std::vector<double>{2, 3, 0, 0});
    // The rows of mirror images follow those of the photos.
    const std::vector<double> both{2, 3, 0, 0, 5, 6, 0, 0};
    CHECK(first_column(state.tensors["codes.offset.id"]) == both);
    CHECK(first_column(state.tensors["generator.adam.codes.offset.id.first"]) == both);
    CHECK(state.tensors["generator.adam.codes.offset.id.steps"].item() == 7.0);
    CHECK(identical(state.tensors["decoder.field.layer0.weight"], numbered(3)));
}

TEST_CASE("a changed folder is said without learnt offsets too, with the first names", "[codes]") {
    TensorFile state;
    CHECK(follow_photos(state, {"a"}).empty());
    store_photo_ids(state, {"1", "2", "3", "4", "5"});
    CHECK(follow_photos(state, {"5", "6"}) ==
          "the folder has changed since the checkpoint: 4 photos (1, 2, 3, ...) gone, 1 photo (6) "
          "new");
    // Names of files may have several lines.
    const std::vector<std::string> odd{"J\xfcrgen", "two\nlines", "100%"};
    store_photo_ids(state, odd);
    const ScratchFolder folder;
    write_tensor_file(folder / "state.safetensors", state);
    TensorFile stored = read_tensor_file(folder / "state.safetensors");
    CHECK(follow_photos(stored, odd).empty());
    TensorFile nameless = state_of({"a", "b"});
    nameless.metadata["photos"] = "";
    CHECK_THROWS_AS(follow_photos(nameless, {"a", "b"}), FileError);
    TensorFile old = state_of({"a", "b"});
    old.metadata.clear();
    CHECK(follow_photos(old, {"b", "c"}) ==
          "the checkpoint does not name its photos; their learnt offsets are taken in the order of "
          "the ids");
}

TEST_CASE("a run that resumes without one of its photos keeps the offsets of the others",
          "[codes]") {
    const ScratchFolder folder;
    std::filesystem::copy(synthetic_folder(), folder / "faces",
                          std::filesystem::copy_options::recursive);
    TrainConfig config = tiny_train_config();
    config.model.code_source = "encoder_offset";
    config.stage1.pose_interval = 1;
    const RunFolder run(folder / "run", false);
    const Dataset all = faces_for_training(folder / "faces", config, Split::training);
    CHECK(Trainer(config, all, nullptr, 5).run(run, {}).finished);
    const auto offsets = [&](std::int64_t step) {
        return read_tensor_file(run.checkpoint(step) / "state.safetensors")
            .tensors.at("poses.offset")
            .to_vector();
    };
    std::filesystem::remove(all.files(1).image);
    const Dataset rest = faces_for_training(folder / "faces", config, Split::training);
    REQUIRE(rest.size() == all.size() - 1);
    config.stage1.steps = 5;
    config.stage1.pose_interval = 0;  // learns them no further
    Trainer trainer(config, rest, nullptr, 5);
    CHECK_THAT(trainer.resume(run.checkpoint(4)),
               Catch::Contains("1 photo (" + all.ids()[1] + ") gone, 0 photos new"));
    CHECK(trainer.run(RunFolder(folder / "run", true), {}).finished);
    const std::vector<double> before = offsets(4);
    std::vector<double> expected(before.begin(), before.begin() + 6);
    expected.insert(expected.end(), before.begin() + 12, before.end());
    CHECK(offsets(5) == expected);
}

}  // namespace photo_change_tests
