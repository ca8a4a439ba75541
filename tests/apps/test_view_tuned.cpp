#include <catch2/catch.hpp>
#include <filesystem>

#include "apps/tiny_run.h"
#include "apps/view_client.h"
#include "nn/models/weight_changes.h"

namespace view_tuned_tests {

using namespace stymo;

TEST_CASE("the tuned weights of the command line are for its faces alone", "[view]") {
    const auto first_value = [](const Model& model) {
        return model.parameters().all().front().variable().value().to_vector();
    };
    const Model plain = Model::load(tiny_run() / "run/model.safetensors");
    const Model changed = Model::load(tiny_run() / "run/model.safetensors", ModelParts::decoder);
    const Parameter& parameter = changed.parameters().all().front();
    parameter.set_value((Variable(parameter.variable().value()) * 1.25).value());
    const std::filesystem::path file = tiny_run() / "of_one_face.safetensors";
    WeightChanges::between(plain, changed).save(file);
    ViewClient client([&](view::ViewerOptions& options) { options.model.tuned = file; });
    const view::ListedFace& face = client.shared().first_faces().front();
    CHECK(face.name == "fit");  // the folder's name
    CHECK(face.tuned);
    CHECK(first_value(*face.model) != first_value(plain));
    CHECK(first_value(*client.shared().model()) == first_value(plain));
}

}  // namespace view_tuned_tests
