// Photos that are fitted by stymo-view, on the tiny run's model.
#include <algorithm>
#include <catch2/catch.hpp>
#include <chrono>
#include <thread>

#include "apps/tiny_run.h"
#include "apps/view_client.h"
#include "core/io/jpeg.h"
#include "core/rng.h"
#include "fit/photo/face_detector.h"
#include "nn/realtime/view.h"
#include "render/morphable/builtin_head.h"
#include "train/data/synthetic_faces.h"

using namespace stymo;
using nlohmann::json;

namespace {

/// A photo of rendered heads beside each other, as a JPEG file.
std::string photo_of_heads(std::int64_t heads) {
    constexpr std::int64_t side = 320, height = 480;
    const std::int64_t width = 500 * heads;
    Tensor photo = Tensor::zeros({height, width, 3});
    for (std::int64_t number = 0; number < heads; ++number) {
        const SyntheticFace face =
            sample_synthetic_face(builtin_head(), Rng(static_cast<std::uint64_t>(5 + number)));
        const Tensor head = render_synthetic_face(builtin_head(), face, {}, side).color;
        for (std::int64_t row = 0; row < side; ++row)
            std::copy_n(head.values<float>().begin() + row * side * 3, side * 3,
                        photo.mutable_values<float>().begin() +
                            ((row + 80) * width + 90 + 500 * number) * 3);
    }
    return jpeg_bytes(photo, 95);
}

}  // namespace

TEST_CASE("a photo without a face ends the job with a reason and leaves no face", "[view]") {
    ViewClient client;
    CHECK(client.ask("photo").status == 400);
    CHECK(client.send("photo", "no image").status == 200);
    json job = client.ended_job();
    CHECK(job["state"] == "failed");
    CHECK(job["error"] == "the photo: not an image");
    CHECK(client.send("photo", "photocover", {{"cover", "10"}}).status == 400);
    CHECK(client.send("photo", "photocover", {{"cover", "5"}}).status == 200);
    CHECK(client.ended_job()["error"] == "the cover: not an image");
    client.send("photo", jpeg_bytes(Tensor::full({64, 64, 3}, 0.5), 90));
    job = client.ended_job();
    CHECK(job["state"] == "failed");
    CHECK(job["error"].get<std::string>().starts_with("the photo: "));
    CHECK(client.json("faces")["faces"].size() == client.opened()["faces"].size());
}

TEST_CASE("a face that is removed while it is fitted cancels its job", "[view]") {
    if (!FaceDetector::available()) return;
    ViewClient client([](view::ViewerOptions& options) { options.fit_steps = 100'000; });
    REQUIRE(client.send("photo", photo_of_heads(1)).status == 200);
    std::string face;
    for (int i = 0; i < 600 && face.empty(); ++i) {
        const json job = client.json("job");
        INFO(job.dump());
        REQUIRE(job["state"] == "running");
        face = job["face"].get<std::string>();
        std::this_thread::sleep_for(std::chrono::milliseconds(50));
    }
    CHECK(client.send("remove", "", {{"face", face}}).status == 200);
    CHECK(client.ended_job()["state"] == "cancelled");
    CHECK(client.json("faces")["faces"].size() == client.opened()["faces"].size());
}

TEST_CASE("of a photo with several faces another one is fitted", "[view]") {
    if (!FaceDetector::available()) return;
    ViewClient client;
    const std::string bytes = photo_of_heads(2);
    const auto fitted = [&](const std::map<std::string, std::string>& query) {
        REQUIRE(client.send("photo", bytes, query).status == 200);
        return client.ended_job();
    };
    const auto codes_of = [&](const json& job) {
        INFO(job.dump());
        REQUIRE(job["state"] == "done");
        const json listed = client.json("faces");
        for (const json& face : listed["faces"])
            if (face["face"] == job["face"]) return face["codes"].get<std::string>();
        return std::string();
    };
    const json largest = fitted({});
    CHECK(largest["faces"] == 2);
    CHECK_THAT(largest["note"].get<std::string>(), Catch::Contains("Face in the viewer"));
    // Seen from where its photo shows the whole head, or farther.
    for (const json& face : client.json("faces")["faces"])
        CHECK(face["distance"].get<double>() >= whole_head_distance);
    const json left = fitted({{"face", "1"}}), right = fitted({{"face", "2"}});
    CHECK(left["faces"] == 1);
    CHECK(codes_of(left) != codes_of(right));
    CHECK((codes_of(largest) == codes_of(left) || codes_of(largest) == codes_of(right)));
    CHECK(fitted({{"face", "3"}})["error"] == "the photo: has 2 faces, no face 3 from the left");
    CHECK(client.send("photo", bytes, {{"face", "-1"}}).status == 400);
}

TEST_CASE("photos of phones are small enough; a refusal says how larger ones are read", "[view]") {
    constexpr std::int64_t of_64_megapixels = 9280 * 6944;
    CHECK(view::ViewerOptions{}.most_photo_pixels >= of_64_megapixels);
    ViewClient client([](view::ViewerOptions& options) { options.most_photo_pixels = 4095; });
    client.send("photo", jpeg_bytes(Tensor::full({64, 64, 3}, 0.5), 90));
    CHECK(client.ended_job()["error"] ==
          "the photo: cannot be read (image too large: 64 x 64 pixels; at most 4095 are allowed, "
          "see --max-pixels)");
}
