#include <catch2/catch.hpp>
#include <fstream>

#include "core/io/file.h"
#include "core/io/scratch_folder.h"
#include "support/check_close.h"
#include "support/error_message.h"
#include "support/grouping_locale.h"
#include "support/tiny_model.h"
#include "train/checkpoint.h"

using namespace stymo;
using namespace stymo::test;
namespace fs = std::filesystem;

namespace {

constexpr std::uint64_t some_seed = 18446744073709551615U;

Checkpoint some_checkpoint() {
    Checkpoint checkpoint;
    checkpoint.state = {.seed = some_seed,
                        .step = 12345678901,
                        .mask_loss = true,
                        .epoch_loss_sum = 0.1 + 0.2,
                        .epoch_loss_count = 7,
                        .epoch_losses = {1.0 / 3.0, 1e-300},
                        .failures = 2,
                        .best_validation = 0.123456789012345,
                        .best_resolution = 128};
    checkpoint.tensors.tensors["adam.x.first"] = Tensor::full({2, 3}, 0.1);
    return checkpoint;
}

std::string read_error(const fs::path& folder) {
    Model model = tiny_model(2);
    const Tensor before = model.parameters().all().front().variable().value();
    std::string message = error_message<FileError>(
        [&] { static_cast<void>(read_checkpoint(folder, model, some_seed)); });
    CHECK(is_one_line(message));
    CHECK(identical(before, model.parameters().all().front().variable().value()));
    return message;
}

void cut(const fs::path& file, std::uintmax_t size) {
    fs::resize_file(file, size);
}

}  // namespace

TEST_CASE("a checkpoint reads back as it was written", "[checkpoint]") {
    const ScratchFolder folder;
    const Model model = tiny_model(1);
    const Checkpoint written = some_checkpoint();
    write_checkpoint(folder / "c", model, written);
    Model other = tiny_model(2);
    const Checkpoint read = read_checkpoint(folder / "c", other, some_seed);
    CHECK(read.state.seed == written.state.seed);
    CHECK(read.state.step == written.state.step);
    CHECK(read.state.mask_loss == written.state.mask_loss);
    CHECK(read.state.epoch_loss_sum == written.state.epoch_loss_sum);
    CHECK(read.state.epoch_loss_count == written.state.epoch_loss_count);
    CHECK(read.state.epoch_losses == written.state.epoch_losses);
    CHECK(read.state.failures == written.state.failures);
    CHECK(read.state.best_validation == written.state.best_validation);
    CHECK(read.state.best_resolution == written.state.best_resolution);
    CHECK(identical(read.tensors.tensors.at("adam.x.first"),
                    written.tensors.tensors.at("adam.x.first")));
    for (std::size_t i = 0; i < model.parameters().all().size(); ++i)
        CHECK(identical(model.parameters().all()[i].variable().value(),
                        other.parameters().all()[i].variable().value()));
}

TEST_CASE("a checkpoint that another locale wrote is read", "[checkpoint]") {
    const ScratchFolder folder;
    Model model = tiny_model(1);
    model.set_validation_psnr(31.25);
    {
        const GroupingLocale locale;
        write_checkpoint(folder / "c", model, some_checkpoint());
    }
    Model other = tiny_model(2);
    CHECK(read_checkpoint(folder / "c", other, some_seed).state.step ==
          some_checkpoint().state.step);
    CHECK(Model::load(folder / "c" / "model.safetensors").validation_psnr() == 31.25);
}

TEST_CASE("a run's first checkpoint has no epochs and no score", "[checkpoint]") {
    const ScratchFolder folder;
    write_checkpoint(folder / "c", tiny_model(), {});
    Model model = tiny_model();
    const TrainingState state = read_checkpoint(folder / "c", model, 0).state;
    CHECK(state.epoch_losses.empty());
    CHECK(state.best_validation == TrainingState{}.best_validation);
    CHECK_FALSE(state.mask_loss);
}

TEST_CASE("writing again replaces a checkpoint and what an earlier attempt left", "[checkpoint]") {
    const ScratchFolder folder;
    fs::create_directories(folder / "c.unfinished/rest");
    write_checkpoint(folder / "c", tiny_model(), {});
    write_checkpoint(folder / "c", tiny_model(), some_checkpoint());
    Model model = tiny_model();
    CHECK(read_checkpoint(folder / "c", model, some_seed).state.step ==
          some_checkpoint().state.step);
    CHECK(folder.file_count() == 1);
}

TEST_CASE("a checkpoint that stepped aside for one that never came is read all the same",
          "[checkpoint]") {
    const ScratchFolder folder;
    write_checkpoint(folder / "c", tiny_model(), some_checkpoint());
    fs::rename(folder / "c", folder / "c.replaced");
    Model model = tiny_model();
    CHECK(read_checkpoint(folder / "c", model, some_seed).state.step ==
          some_checkpoint().state.step);
    CHECK(folder.file_count() == 1);
}

TEST_CASE("a damaged or foreign checkpoint is refused in one line that names the file",
          "[checkpoint]") {
    const ScratchFolder folder;
    const fs::path checkpoint = folder / "c";
    const fs::path state = checkpoint / "state.safetensors";
    const fs::path weights = checkpoint / "model.safetensors";
    write_checkpoint(checkpoint, tiny_model(), some_checkpoint());

    CHECK_THAT(read_error(folder / "nowhere"), Catch::Contains("nowhere"));
    // As older versions wrote it.
    fs::remove(checkpoint / "checksums.txt");

    SECTION("a state that ends early") {
        cut(state, fs::file_size(state) - 5);
        CHECK_THAT(read_error(checkpoint), Catch::Contains(state.string()));
        cut(state, 4);
        CHECK_THAT(read_error(checkpoint), Catch::Contains(state.string()));
        cut(state, 0);
        CHECK_THAT(read_error(checkpoint), Catch::Contains(state.string()));
    }
    SECTION("weights that end early") {
        cut(weights, fs::file_size(weights) - 5);
        CHECK_THAT(read_error(checkpoint), Catch::Contains(weights.string()));
    }
    SECTION("a missing number") {
        for (const char* key : {"seed", "step", "mask_loss", "epoch_loss_sum", "epoch_loss_count",
                                "failures", "best_validation", "best_resolution"}) {
            write_checkpoint(checkpoint, tiny_model(), some_checkpoint());
            fs::remove(checkpoint / "checksums.txt");
            TensorFile file = read_tensor_file(state);
            file.metadata.erase(key);
            write_tensor_file(state, file);
            CHECK_THAT(read_error(checkpoint), Catch::Contains(state.string()) &&
                                                   Catch::Contains(std::string("\"") + key + "\""));
        }
    }
    SECTION("what is not a number") {
        TensorFile file = read_tensor_file(state);
        file.metadata["step"] = "12 steps";
        write_tensor_file(state, file);
        CHECK_THAT(read_error(checkpoint),
                   Catch::Contains("\"step\" is \"12 steps\", not a number"));
    }
    SECTION("a missing tensor") {
        TensorFile file = read_tensor_file(state);
        file.tensors.erase("state.epoch_losses");
        write_tensor_file(state, file);
        CHECK_THAT(read_error(checkpoint), Catch::Contains("state.epoch_losses"));
    }
    SECTION("another program's file") {
        TensorFile foreign;
        foreign.tensors["weight"] = Tensor::zeros({3});
        write_tensor_file(weights, foreign);
        CHECK_THAT(read_error(checkpoint),
                   Catch::Contains(weights.string()) && Catch::Contains("has no tensor encoder."));
        write_tensor_file(state, foreign);
        CHECK_THAT(read_error(checkpoint),
                   Catch::Contains(state.string()) && Catch::Contains("not a training state"));
    }
    SECTION("weights of another shape") {
        TensorFile file = read_tensor_file(weights);
        file.tensors["decoder.field.density.weight"] = Tensor::zeros({1, 77});
        write_tensor_file(weights, file);
        CHECK_THAT(read_error(checkpoint),
                   Catch::Contains("decoder.field.density.weight") && Catch::Contains("(1, 77)"));
    }
}

TEST_CASE("a damaged checkpoint is refused, and the newest older one that is whole is named",
          "[checkpoint]") {
    const ScratchFolder folder;
    const auto at = [&](std::int64_t step) { return folder / ("0000" + std::to_string(step)); };
    for (const std::int64_t step : {10, 20, 30}) {
        Checkpoint checkpoint = some_checkpoint();
        checkpoint.state.step = step;
        write_checkpoint(at(step), tiny_model(static_cast<std::uint64_t>(step)), checkpoint);
    }
    const fs::path state = at(30) / "state.safetensors";
    const fs::path weights = at(30) / "model.safetensors";
    std::string offered = "; --resume " + at(20).string() + " works";
    std::string named = weights.string() + ": is damaged (checksum and size are ";
    SECTION("one bit") {
        std::string bytes = read_file(weights);
        bytes[bytes.size() / 2] ^= '\1';
        write_file(weights, bytes);
    }
    SECTION("a file that ends early") {
        cut(weights, fs::file_size(weights) - 5);
    }
    SECTION("a file of another checkpoint") {
        fs::copy_file(at(20) / "model.safetensors", weights, fs::copy_options::overwrite_existing);
    }
    SECTION("a missing file") {
        fs::remove(weights);
        named = weights.string() + ": is missing";
    }
    SECTION("a missing folder") {
        fs::remove_all(at(30));
        named = state.string() + ": cannot be read";
    }
    SECTION("another checkpoint") {
        fs::remove_all(at(30));
        fs::copy(at(10), at(30));
        named = state.string() + ": is of step 10, not of step 30";
    }
    SECTION("cut checksums") {
        cut(at(30) / "checksums.txt", 50);
        named = (at(30) / "checksums.txt").string() + ": is damaged";
    }
    SECTION("a state that ends early, and one before it too") {
        cut(state, 100);
        cut(at(20) / "state.safetensors", 100);
        fs::remove(at(30) / "checksums.txt");
        named = state.string();
        offered = "; --resume " + at(10).string() + " works";
    }
    const std::string message = read_error(at(30));
    CHECK_THAT(message, Catch::StartsWith(named) && Catch::EndsWith(offered));
}

TEST_CASE("a checkpoint that cannot be written says so and leaves nothing", "[checkpoint]") {
    const ScratchFolder folder;
    write_file(folder / "file", "");
    const std::string message = error_message<FileError>(
        [&] { write_checkpoint(folder / "file" / "c", tiny_model(), some_checkpoint()); });
    CHECK(is_one_line(message));
    CHECK_THAT(message, Catch::Contains((folder / "file").string()));
    CHECK(folder.file_count() == 1);
    CHECK(fs::is_regular_file(folder / "file"));
}
