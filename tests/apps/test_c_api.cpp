#include <array>
#include <catch2/catch.hpp>
#include <cmath>
#include <limits>
#include <memory>
#include <string>
#include <thread>
#include <type_traits>
#include <vector>

#include "apps/c/stymo.h"
#include "core/io/scratch_folder.h"

using stymo::ScratchFolder;

namespace c_api_tests {

struct Freed {
    void operator()(stymo_model* model) const { stymo_model_free(model); }
    void operator()(stymo_face* face) const { stymo_face_free(face); }
};
using OwnedModel = std::unique_ptr<stymo_model, Freed>;
using OwnedFace = std::unique_ptr<stymo_face, Freed>;

}  // namespace c_api_tests

using namespace c_api_tests;

TEST_CASE("The C interface draws, mixes, writes and renders faces", "[c_api]") {
    const OwnedModel model(stymo_model_load(nullptr, nullptr));
    REQUIRE(model);
    CHECK(stymo_model_side(model.get()) == 256);
    const OwnedFace first(stymo_sample(model.get(), 1, 0.7)),
        second(stymo_sample(model.get(), 2, 0.7));
    const OwnedFace mixed(stymo_mix(first.get(), second.get(), "id,light"));
    REQUIRE((first && second && mixed));
    std::vector<float> a(STYMO_CODE_SIZE), b(STYMO_CODE_SIZE), c(STYMO_CODE_SIZE);
    CHECK(stymo_face_codes(first.get(), a.data()) == 0);
    CHECK(stymo_face_codes(second.get(), b.data()) == 0);
    CHECK(stymo_face_codes(mixed.get(), c.data()) == 0);
    CHECK((c[0] == b[0] && c[100] == a[100] && c[305] == b[305]));

    const ScratchFolder scratch;
    const std::string file = (scratch.path() / "codes.json").string();
    CHECK(stymo_face_write(mixed.get(), file.c_str(), nullptr) == 0);
    const OwnedFace read(stymo_face_read(model.get(), file.c_str(), nullptr));
    REQUIRE(read);
    const std::array<double, 3> angles{15.0, 0.0, 0.0};
    std::vector<std::uint8_t> here(64 * 64 * 3), there(64 * 64 * 3);
    CHECK(stymo_render(model.get(), mixed.get(), angles.data(), 64, here.data()) == 0);
    CHECK(stymo_render(model.get(), read.get(), angles.data(), 64, there.data()) == 0);
    CHECK(here == there);
    CHECK(stymo_render(model.get(), read.get(), nullptr, 64, there.data()) == 0);
    CHECK(here != there);
}

TEST_CASE("The C interface answers misuse with one line, on the thread that made it", "[c_api]") {
    const auto failed = [](auto result, const std::string& message) {
        INFO(stymo_error());
        bool is_failure = false;
        if constexpr (std::is_pointer_v<decltype(result)>)
            is_failure = result == nullptr;
        else
            is_failure = result == -1;
        CHECK((is_failure && stymo_error() == message));
    };
    std::thread([] { CHECK(std::string(stymo_error()).empty()); }).join();
    const OwnedModel model(stymo_model_load(nullptr, nullptr));
    const OwnedFace face(stymo_sample(model.get(), 1, 0.7));
    REQUIRE((model && face));
    std::vector<std::uint8_t> pixels(64 * 64 * 3);
    failed(stymo_sample(nullptr, 1, 0.7), "model is NULL");
    failed(stymo_model_side(nullptr), "model is NULL");
    failed(stymo_fit(nullptr, pixels.data(), 64, 64, 0), "model is NULL");
    failed(stymo_fit(model.get(), nullptr, 64, 64, 0), "rgb is NULL");
    failed(stymo_fit(model.get(), pixels.data(), 0, 64, 0), "a photo of 0 x 64 pixels is empty");
    failed(stymo_fit(model.get(), pixels.data(), 64, 64, -1), "-1 steps; give 0 or more");
    failed(stymo_fit(model.get(), pixels.data(), 64, 64, 1), "the photo: no face was found");
    failed(stymo_tune(model.get(), nullptr, 1.0), "face is NULL");
    failed(stymo_tune(model.get(), face.get(), 1.0),
           "only a face that was fitted to a photo here can be tuned to it");
    failed(stymo_mix(face.get(), nullptr, "id"), "source is NULL");
    failed(stymo_mix(face.get(), face.get(), nullptr), "take is NULL");
    failed(stymo_mix(face.get(), face.get(), "ear"),
           "\"ear\" is no group of codes; there are id, expr, tex and light");
    failed(stymo_face_codes(face.get(), nullptr), "codes is NULL");
    failed(stymo_face_warnings(nullptr), "face is NULL");
    CHECK(std::string(stymo_face_warnings(face.get())).empty());
    CHECK(std::isnan(stymo_face_psnr(nullptr)));
    CHECK(std::isnan(stymo_face_psnr(face.get())));
    failed(stymo_render(model.get(), face.get(), nullptr, 64, nullptr), "rgb is NULL");
    failed(stymo_render(model.get(), face.get(), nullptr, 0, pixels.data()),
           "a side of 0 pixels is empty");
    failed(stymo_model_load("no.safetensors", nullptr),
           "no.safetensors: cannot be read (No such file or directory)");
    failed(stymo_set_threads(-1),
           "[threads] -1 threads; give 0 for one per processor or a number from 1 to 1024");
    failed(stymo_sample(model.get(), 1, -0.5),
           "the truncation of a new face must be from 0 to 10, not -0.5");
    const double nan = std::numeric_limits<double>::quiet_NaN();
    failed(
        stymo_render(model.get(), face.get(), std::vector{nan, 0.0, 0.0}.data(), 64, pixels.data()),
        "an angle is nan degrees");
    stymo_model_free(nullptr);
    stymo_face_free(nullptr);
}
