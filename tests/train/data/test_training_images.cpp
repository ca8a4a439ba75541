#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <nlohmann/json.hpp>
#include <set>
#include <sstream>

#include "core/error.h"
#include "core/io/file.h"
#include "nn/models/model.h"
#include "support/check_close.h"
#include "train/data/training_images.h"
#include "train/tiny_training.h"

using namespace stymo;
using namespace stymo::test;

TEST_CASE("each pass shows every face once, in the same order from wherever one looks",
          "[dataset]") {
    const Dataset faces = synthetic_dataset();
    const std::int64_t count = faces.size();
    const Rng rng(3);
    const auto id_of = [](const TrainingImages& images, std::int64_t number) {
        return images.batch(number, 1).ids.front();
    };
    // Another one for each look, so that no order is kept.
    std::vector<std::string> ids;
    for (std::int64_t number = 0; number < 3 * count; ++number)
        ids.push_back(id_of(TrainingImages(faces, {.mirror = true}, rng, 8), number));
    for (std::int64_t pass = 0; pass < 3; ++pass) {
        const auto begin = ids.begin() + pass * count;
        CHECK(std::set<std::string>(begin, begin + count).size() ==
              static_cast<std::size_t>(count));
    }
    CHECK_FALSE(std::equal(ids.begin(), ids.begin() + count, ids.begin() + count));

    // Two orders are kept; here three are wanted in turn, forwards and backwards.
    const TrainingImages images(faces, {.mirror = true}, rng, 8, count + 1);
    CHECK(images.batch(0, 3 * count).ids == ids);
    for (std::int64_t index = 0; index < count; ++index) {
        for (const std::int64_t pass : {2, 0, 1})
            CHECK(id_of(images, pass * count + index) ==
                  ids[static_cast<std::size_t>(pass * count + index)]);
    }
    // All faces are in memory.
    CHECK(images.waiting_seconds() == 0.0);
}

TEST_CASE("a batch has the targets up to the side that is asked for, with the same values",
          "[dataset]") {
    const Dataset faces = synthetic_dataset();
    const TrainingImages images(faces, {.mirror = true}, Rng(3), 8);
    const FaceBatch all = images.batch(0, 2), small = images.batch(0, 2, 16);
    REQUIRE(all.targets.size() == 4);
    REQUIRE(small.targets.size() == 2);
    for (std::size_t i = 0; i < small.targets.size(); ++i)
        CHECK(small.targets[i].to_vector() == all.targets[i].to_vector());
    CHECK(small.input.to_vector() == all.input.to_vector());
    CHECK_THROWS_AS(images.batch(0, 2, 24), ValueError);
}

TEST_CASE("what two photos share is read from the other one", "[dataset]") {
    // Faces 0, 1 and 2 are one person, 0 and 1 of one series; 0 and 2 are one take; 3 is somebody
    // with one photo.
    const ScratchFolder folder;
    std::filesystem::copy(synthetic_folder(), folder / "faces",
                          std::filesystem::copy_options::recursive);
    std::istringstream lines(read_file(folder / "faces/faces.jsonl"));
    std::string named;
    int number = 0;
    for (std::string line; std::getline(lines, line); ++number) {
        nlohmann::json record = nlohmann::json::parse(line);
        record["person"] = number < 3 ? "A" : "B";
        if (number < 2) record["series"] = "day";
        if (number == 0 || number == 2) record["take"] = "noon";
        named += record.dump() + "\n";
    }
    write_file(folder / "faces/faces.jsonl", named);
    const TrainConfig config = tiny_train_config();
    const Dataset faces(folder / "faces", 64, config.data, Split::all);
    CHECK(faces.summary().divided_people == 0);
    const Dataset held_out(folder / "faces", 64, {.test = 2, .validation = 0}, Split::test);
    CHECK_THAT(held_out.summary().text(),
               Catch::Contains("; 1 person has photos in another part of the split too"));
    Rng rng(1);
    const Model model(config.model, rng);
    const auto codes_of = [&](std::int64_t face) {
        return face_codes(model, make_batch(std::vector{faces.load(face)}));
    };

    const TrainingImages images(faces, {.other_photo = 1.0}, Rng(3));
    CHECK(images.photos_with_partner() == 3);
    std::set<std::pair<std::int64_t, std::int64_t>> pairs;
    for (std::int64_t image = 0; image < 40; ++image) {
        const FaceBatch batch = images.batch(image, 1);
        const std::int64_t face =
            std::ranges::find(faces.ids(), batch.ids[0]) - faces.ids().begin();
        CHECK(identical(batch.input, make_batch(std::vector{faces.load(face)}).input));
        CHECK(batch.other_input.defined() == (face != 3));
        if (face == 3) continue;
        std::int64_t other = 0;
        while (!identical(batch.other_input, make_batch(std::vector{faces.load(other)}).input))
            ++other;
        CHECK(other != face);
        CHECK(batch.other_cameras.front().center == faces.load(other).pose.translation);
        pairs.emplace(face, other);
        const bool same_take = face != 1 && other != 1;
        const bool same_light = same_take || (face < 2 && other < 2);
        CHECK(batch.shared == std::vector{same_take    ? Shared::all
                                          : same_light ? Shared::light
                                                       : Shared::person});
        const Codes codes = face_codes(model, batch), own = codes_of(face),
                    theirs = codes_of(other);
        CHECK(identical(codes.identity().value(), theirs.identity().value()));
        CHECK(
            identical(codes.expression().value(), (same_take ? theirs : own).expression().value()));
        CHECK(identical(codes.texture().value(), theirs.texture().value()));
        CHECK(identical(codes.light().value(), (same_light ? theirs : own).light().value()));
    }
    CHECK(pairs.size() == 6);

    // In a larger batch each face has its own.
    const Codes both = face_codes(model, images.batch(0, 2));
    for (std::int64_t i = 0; i < 2; ++i) {
        const Codes alone = face_codes(model, images.batch(i, 1));
        CHECK(check_close(joined(codes_of_face(both, i)).value(), joined(alone).value(), 1e-5)
                  .passed);
    }

    // A turned face keeps the expression of its own photo.
    const TrainingImages all(faces, {.other_photo = 1.0, .turned_photos = 1.0}, Rng(3));
    std::int64_t shared_image = 0;
    while (!images.batch(shared_image, 1).other_input.defined()) ++shared_image;
    const FaceBatch turned = all.batch(shared_image, 1), plain = images.batch(shared_image, 1);
    CHECK_FALSE(identical(turned.targets.back(), plain.targets.back()));
    CHECK(identical(turned.input, plain.input));
    CHECK(identical(turned.other_input, plain.other_input));
    CHECK(turned.shared == plain.shared);

    int with_other = 0;
    const TrainingImages half(faces, {.other_photo = 0.5}, Rng(3));
    for (std::int64_t image = 0; image < 400; ++image)
        if (half.batch(image, 1).other_input.defined()) ++with_other;
    // Three quarters of the images can have one; five standard deviations are 48.
    CHECK(std::abs(with_other - 150) < 48);
}

TEST_CASE("a turned face is rendered from the code of its photo", "[dataset]") {
    const TrainConfig config = tiny_train_config();
    const Dataset faces(synthetic_folder(), 64, config.data, Split::all);
    Rng rng(1);
    const Model model(config.model, rng);
    const TrainingImages images(faces, {.turned_photos = 1.0}, Rng(3));
    std::set<double> yaws;
    for (std::int64_t image = 0; image < faces.size(); ++image) {
        const FaceBatch batch = images.batch(image, 1);
        const Face photo =
            faces.load(std::ranges::find(faces.ids(), batch.ids[0]) - faces.ids().begin());
        const FaceBatch own = make_batch(std::vector{photo});
        CHECK(identical(batch.other_input, own.input));
        CHECK(batch.shared == std::vector{Shared::all});
        CHECK(identical(joined(face_codes(model, batch)).value(),
                        joined(face_codes(model, own)).value()));
        REQUIRE(batch.known.defined());
        const double turn = pose_from_camera(batch.cameras[0]).yaw - photo.pose.yaw;
        CHECK(std::abs(turn) < 0.8);
        yaws.insert(turn);
    }
    CHECK(yaws.size() == static_cast<std::size_t>(faces.size()));
    CHECK(images.photos_to_turn() == faces.size());

    // Not to where the model cannot render it.
    const TrainingImages frontal(faces, {.turned_photos = 1.0}, Rng(3), 64, 0,
                                 [](const Pose&, const Intrinsics&) { return "no"; });
    for (std::int64_t image = 0; image < faces.size(); ++image)
        CHECK_FALSE(frontal.batch(image, 1).other_input.defined());

    int turned = 0;
    const TrainingImages some(faces, {.turned_photos = 0.25}, Rng(3));
    for (std::int64_t image = 0; image < 400; ++image)
        if (some.batch(image, 1).other_input.defined()) ++turned;
    // Five standard deviations are 43.
    CHECK(std::abs(turned - 100) < 43);
}

TEST_CASE("in place of a broken photo no other person's identity is read", "[dataset]") {
    const ScratchFolder folder;
    std::filesystem::copy(synthetic_folder(), folder / "faces",
                          std::filesystem::copy_options::recursive);
    std::istringstream lines(read_file(folder / "faces/faces.jsonl"));
    std::string named;
    for (std::string line; std::getline(lines, line);) {
        nlohmann::json record = nlohmann::json::parse(line);
        record["person"] = record["id"] < "00002" ? "A" : "B";
        named += record.dump() + "\n";
    }
    write_file(folder / "faces/faces.jsonl", named);
    DataConfig config = tiny_train_config().data;
    config.cache_megabytes = 0;
    config.mirror = false;
    config.other_photo = 1.0;
    const Dataset faces(folder / "faces", 64, config, Split::all);
    write_file(folder / "faces/images/00001.png", "broken");
    const TrainingImages images(faces, config, Rng(3));
    std::int64_t read_from_another = 0;
    for (std::int64_t image = 0; image < 16; ++image) {
        const FaceBatch batch = images.batch(image, 1);
        if (!batch.other_input.defined()) continue;
        ++read_from_another;
        CHECK(batch.ids[0] >= "00002");
        const std::int64_t other = batch.ids[0] == "00002" ? 3 : 2;
        CHECK(identical(batch.other_input, make_batch(std::vector{faces.load(other)}).input));
    }
    CHECK(read_from_another > 0);
}
