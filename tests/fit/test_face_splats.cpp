#include <catch2/catch.hpp>

#include "core/error.h"
#include "fit/face_splats.h"
#include "support/tiny_model.h"

using namespace stymo;
using namespace stymo::test;

TEST_CASE("A face is made of about as many splats as are asked for, and of no fewer than one",
          "[splats]") {
    ModelConfig config = tiny_model_config();
    Rng rng(1);
    const Model model(config, rng);
    for (const Parameter& parameter : model.parameters().all()) {
        if (parameter.name() == "decoder.field.density.bias")
            parameter.set_value(Tensor::full({1}, 4.0));
    }
    const Codes codes = random_codes(1, 2);
    for (const std::int64_t count : {-1, 0})
        CHECK_THROWS_AS(face_splats(model, codes, count), ValueError);
    const std::int64_t splats = face_splats(model, codes, 300).centers.shape(0);
    CHECK(splats > 100);
    CHECK(splats < 900);
}
