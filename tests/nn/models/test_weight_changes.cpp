#include <catch2/catch.hpp>
#include <cmath>

#include "core/error.h"
#include "core/io/file.h"
#include "core/io/scratch_folder.h"
#include "core/io/tensor_file.h"
#include "core/ops/elementwise.h"
#include "nn/models/weight_changes.h"
#include "support/error_message.h"
#include "support/grouping_locale.h"
#include "support/tiny_model.h"

using namespace stymo;
using namespace stymo::test;

namespace {

const Parameter& parameter_called(const Model& model, const std::string& name) {
    for (const Parameter& parameter : model.parameters().all())
        if (parameter.name() == name) return parameter;
    FAIL("no parameter " << name);
    return model.parameters().all().front();
}

constexpr const char* changed = "decoder.field.layer1.weight";

/// A model whose one matrix is larger by `difference`.
Model moved_model(double difference) {
    Model model = tiny_model(1);
    const Parameter& parameter = parameter_called(model, changed);
    parameter.set_value((Variable(parameter.variable().value()) + difference).value());
    return model;
}

}  // namespace

TEST_CASE("changes of weights are those of the tuned parameters, and come back from their file",
          "[weight_changes]") {
    const ScratchFolder folder;
    const Model before = tiny_model(1), after = moved_model(0.5);
    const WeightChanges changes = WeightChanges::between(before, after);
    REQUIRE(changes.differences().size() == 1);
    CHECK(changes.differences().contains(changed));
    changes.save(folder / "tuned.safetensors");

    Model model = tiny_model(1);
    WeightChanges::load(folder / "tuned.safetensors").apply(model);
    for (std::size_t i = 0; i < model.parameters().all().size(); ++i) {
        const std::vector<double> actual =
            model.parameters().all()[i].variable().value().to_vector();
        const std::vector<double> expected =
            after.parameters().all()[i].variable().value().to_vector();
        // 0.5 plus a rounding error of the sums is what the file holds with 11 bits.
        for (std::size_t k = 0; k < actual.size(); ++k)
            REQUIRE(std::abs(actual[k] - expected[k]) <= 3e-4);
    }
}

TEST_CASE("changes of weights know whose they are, whatever the face does", "[weight_changes]") {
    const ScratchFolder folder;
    const std::filesystem::path file = folder / "tuned.safetensors";
    WeightChanges changes = WeightChanges::between(tiny_model(1), moved_model(0.5));
    const Codes own = random_codes(1, 1), other = random_codes(1, 2);
    changes.save(file);
    CHECK(WeightChanges::load(file).are_of(other));  // as files of earlier versions
    changes.name_face(own);
    changes.save(file);
    const WeightChanges known = WeightChanges::load(file);
    CHECK(known.are_of(own));
    CHECK_FALSE(known.are_of(other));
    Codes edited = other;
    edited.groups[0] = own.groups[0] * 1.05;
    CHECK(known.are_of(edited));

    TensorFile damaged = read_tensor_file(file);
    damaged.metadata["identity"] = "1 2 x";
    write_tensor_file(file, damaged);
    CHECK_THROWS_WITH(WeightChanges::load(file), Catch::Contains("is not the code of a face"));
}

TEST_CASE("changes of weights serve no other model", "[weight_changes]") {
    const WeightChanges changes = WeightChanges::between(tiny_model(1), moved_model(0.5));
    Model other = tiny_model(2);
    CHECK_THROWS_WITH((changes.apply(other)), Catch::Contains("another model"));
    Model tuned = moved_model(0.5);
    CHECK_THROWS_WITH((changes.apply(tuned)), Catch::Contains("another model"));

    ModelConfig config = tiny_model_config();
    config.decoder.field_width = 12;
    Rng rng(1);
    const Model wider(config, rng);
    CHECK_THROWS_AS(WeightChanges::between(tiny_model(1), wider), ValueError);
}

TEST_CASE("a file that holds no changes of weights is refused by its name", "[weight_changes]") {
    const ScratchFolder folder;
    tiny_model(1).save(folder / "model.safetensors");
    const std::string message = error_message<FileError>(
        [&] { static_cast<void>(WeightChanges::load(folder / "model.safetensors")); });
    CHECK(is_one_line(message));
    CHECK_THAT(message, Catch::Contains("model.safetensors: not the weight changes"));
}

TEST_CASE("the fingerprint of a decoder does not depend on the program's locale",
          "[weight_changes]") {
    const Model model = tiny_model();
    const std::string before = decoder_fingerprint(model);
    const GroupingLocale locale;
    CHECK(decoder_fingerprint(model) == before);
}

TEST_CASE("the fingerprint of a decoder changes with its weights, not with the encoder's",
          "[weight_changes]") {
    const std::string fingerprint = decoder_fingerprint(tiny_model(1));
    CHECK(fingerprint == decoder_fingerprint(tiny_model(1)));
    CHECK(fingerprint != decoder_fingerprint(tiny_model(2)));
    CHECK(fingerprint != decoder_fingerprint(moved_model(1e-3)));
    Model model = tiny_model(1);
    const Parameter& encoder = parameter_called(model, "encoder.heads.id.code.bias");
    encoder.set_value((Variable(encoder.variable().value()) + 1.0).value());
    CHECK(fingerprint == decoder_fingerprint(model));
}
