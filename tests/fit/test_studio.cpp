#include <catch2/catch.hpp>
#include <filesystem>
#include <limits>

#include "core/angle.h"
#include "core/io/scratch_folder.h"
#include "core/metrics.h"
#include "fit/shipped_files.h"
#include "fit/studio.h"
#include "nn/models/code_file.h"
#include "nn/realtime/view.h"
#include "render/soft_edge.h"
#include "support/error_message.h"

using namespace stymo;
using namespace stymo::test;

namespace studio_tests {

std::vector<double> elements(const StudioFace& face) {
    return joined(face.face.codes).value().to_vector();
}

const Studio& shared_studio() {
    static const Studio studio({}, STYMO_SOURCE_DIR "/configs");
    return studio;
}

}  // namespace studio_tests

using namespace studio_tests;

TEST_CASE("A studio finds the model above the program and renders as the library does",
          "[studio]") {
    CHECK(std::filesystem::equivalent(
        shipped_model(), STYMO_SOURCE_DIR "/configs/models/faces-256/model.safetensors"));
    CHECK(named_model({}) == shipped_model());
    CHECK(std::filesystem::equivalent(
        named_model("faces-512"), STYMO_SOURCE_DIR "/configs/models/faces-512/model.safetensors"));
    // A path is meant as it stands, and what has no model is left to the reader of the file.
    CHECK(named_model("./faces-512") == "./faces-512");
    CHECK(named_model("no.safetensors") == "no.safetensors");
    const Studio& studio = shared_studio();
    CHECK(studio.model().validation_psnr());  // what stymo-fit takes for usual
    const StudioFace face = studio.sample(3);
    const StudioView view{.yaw = 20.0,
                          .options = {.mode = RenderMode::exact, .resolution = 64, .mask = true},
                          .raw = true};
    const View expected = render_view(studio.model(), face.face.codes, 0,
                                      turned_camera(studio.model().config().camera, head_middle,
                                                    radians_from_degrees(20.0), 0.0, 0.0),
                                      {.resolution = 64, .mask = true});
    const View seen = studio.render(face, view);
    CHECK(seen.image.to_vector() == expected.image.to_vector());
    CHECK(seen.mask.to_vector() == expected.mask.to_vector());

    StudioView usual = view;
    usual.raw = usual.options.mask = false;
    const View soft = studio.render(face, usual);
    CHECK(soft.image.to_vector() == with_soft_edge(expected.image, expected.mask).to_vector());
    CHECK_FALSE(soft.mask.defined());
}

TEST_CASE("A renderer that a studio keeps does not show an earlier face or view", "[studio]") {
    const Studio& studio = shared_studio();
    const StudioFace first = studio.sample(1), second = studio.sample(2);
    const StudioView small{.options = {.mode = RenderMode::exact, .resolution = 64}};
    const std::vector<double> alone = studio.render(first, small).image.to_vector();
    CHECK(studio.render(second, small).image.to_vector() != alone);
    CHECK(studio.render(first, {.options = {.mode = RenderMode::exact, .resolution = 128}})
              .image.shape(0) == 128);
    CHECK(studio.render(first, small).image.to_vector() == alone);
}

TEST_CASE("Mixing takes groups of the source and keeps the rest of the target", "[studio]") {
    const StudioFace target = shared_studio().sample(1), source = shared_studio().sample(2);
    std::vector<double> expected = elements(target);
    const std::vector<double> other = elements(source);
    std::copy(other.begin() + 100, other.begin() + 179, expected.begin() + 100);  // expression
    CHECK(elements(mix(target, source, "expr")) == expected);
    CHECK(error_message<ValueError>([&] { static_cast<void>(mix(target, source, "nose")); }) ==
          "\"nose\" is no group of codes; there are id, expr, tex and light");
    CHECK(error_message<ValueError>([&] { static_cast<void>(mix(target, source, "")); }) ==
          "no group of codes is named; there are id, expr, tex and light");
}

TEST_CASE("A studio says in one line what it cannot do", "[studio]") {
    const Studio& studio = shared_studio();
    const ScratchFolder scratch;
    const auto fails_with = [](const auto& call) {
        return error_message<Error>([&] { static_cast<void>(call()); });
    };
    CHECK(fails_with([] { return Studio("no.safetensors"); }).find("no.safetensors") !=
          std::string::npos);
    CHECK(fails_with([&] {
              return Studio({}, scratch.path());
          }).find("the model that comes with stymo was not found in ") == 0);
    CHECK(fails_with([&] {
              return studio.fit(Tensor::zeros({8, 8}));
          }) == "the photo must have the shape (height, width, 3), not (8, 8)");
    for (const double value : {255.0, std::numeric_limits<double>::quiet_NaN()})
        CHECK(fails_with([&] {
                  return studio.fit(Tensor::full({8, 8, 3}, value));
              }) == "the values of the photo must be from 0 to 1");
    CHECK(fails_with([&] {
              return studio.sample(1, 0, 1e300);
          }).starts_with("the truncation of a new face must be from 0 to 10"));
    CHECK(fails_with([&] { return studio.tune(studio.sample(1), 1.0); }) ==
          "only a face that was fitted to a photo here can be tuned to it");
    StudioFace photographed = studio.sample(1);
    photographed.photo.emplace();
    CHECK(fails_with([&] {
              return studio.tune(photographed, std::numeric_limits<double>::infinity());
          }) == "tuning takes a finite number of seconds, not inf");
    FitJobOptions endless = studio.fit_options();
    endless.tuning.seconds = std::numeric_limits<double>::infinity();
    CHECK(fails_with([&] {
              return studio.fit(Tensor::zeros({8, 8, 3}), endless);
          }) == "tuning takes a finite number of seconds, not inf");
    CHECK(fails_with([&] { return write(studio.sample(1), "a.json", "t.safetensors"), 0; }) ==
          "the face is not tuned; leave out t.safetensors");
    StudioFace face = studio.sample(1);
    const std::filesystem::path file = scratch.path() / "codes.json";
    write(face, file);
    CHECK(elements(studio.read(file)) == elements(face));
    face.face.model = "0";
    write(face, file);
    CHECK(fails_with([&] { return studio.read(file); }) ==
          file.string() + ": holds codes of another model; name that one");
    CHECK(fails_with([&] { return studio.render(face); }) == "this face is one of another model");
    CHECK(fails_with([&] { return studio.mesh(face, 256); }) ==
          "this face is one of another model");
    CHECK(fails_with([&] { return mix(face, studio.sample(1), "id"); }) ==
          "the two faces are of two models");
}

TEST_CASE("A face that a studio fits and tunes looks the same after it was written and read",
          "[studio][slow]") {
    const Studio& studio = shared_studio();
    const StudioFace drawn = studio.sample(5);
    FitJobOptions options = studio.fit_options();
    options.fit.steps = 20;
    const StudioFace fitted = studio.fit(studio.render(drawn).image, options);
    CHECK(*fitted.psnr > 25.0);
    const StudioFace tuned = studio.tune(fitted, 0.0, 6);
    CHECK(*tuned.psnr > *fitted.psnr - 1.0);
    CHECK(elements(tuned) == elements(fitted));
    const StudioFace kept = studio.tune(tuned, 0.0, 1);
    CHECK(kept.psnr == tuned.psnr);
    CHECK(kept.tuned == tuned.tuned);
    REQUIRE_FALSE(kept.warnings.empty());
    CHECK_THAT(kept.warnings.back(), Catch::StartsWith("tuning begins anew"));

    const ScratchFolder scratch;
    write(tuned, scratch.path() / "codes.json", scratch.path() / "tuned.safetensors");
    const StudioFace read =
        studio.read(scratch.path() / "codes.json", scratch.path() / "tuned.safetensors");
    const Tensor again = studio.render(read).image;
    CHECK(peak_signal_to_noise_ratio(studio.render(tuned).image, again) > 60.0);
}
