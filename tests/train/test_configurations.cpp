#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <set>
#include <string>

#include "core/io/file.h"
#include "render/morphable/builtin_head.h"
#include "train/data/synthetic_faces.h"
#include "train/train_config.h"

using namespace stymo;

namespace {

const std::filesystem::path configs = std::filesystem::path(STYMO_SOURCE_DIR) / "configs";

/// The keys of nested objects, "a.b", without comments.
std::set<std::string> keys_of(const nlohmann::json& object, const std::string& prefix = "") {
    std::set<std::string> keys;
    for (const auto& [name, value] : object.items()) {
        if (name.starts_with("$")) continue;
        if (value.is_object())
            keys.merge(keys_of(value, prefix + name + "."));
        else
            keys.insert(prefix + name);
    }
    return keys;
}

}  // namespace

TEST_CASE("paper-512.json states every key") {
    const std::set<std::string> stated =
        keys_of(nlohmann::json::parse(read_file(configs / "paper-512.json")));
    for (const std::string& key : keys_of(nlohmann::json::parse(to_json(TrainConfig{})))) {
        INFO(key << " is missing");
        CHECK(stated.contains(key));
    }
}

TEST_CASE("paper-512.json says the same as the defaults") {
    CHECK(to_json(load_train_config(configs / "paper-512.json", {})) == to_json(TrainConfig{}));
}

TEST_CASE("the planes of demo-64.json enclose the synthetic heads") {
    const RaySampling rays = load_train_config(configs / "demo-64.json", {}).model.decoder.rays;
    const MorphableHead head = builtin_head();
    const Rng rng(1);
    for (std::uint64_t index = 0; index < 20; ++index) {
        const SyntheticFace face = sample_synthetic_face(head, rng.split(index));
        const Camera camera = camera_from_pose(face.pose, Intrinsics{});
        const double distance = std::hypot(camera.center[0], camera.center[1], camera.center[2]);
        const std::vector<double> points =
            head_vertices(head, face.identity, face.expression).to_vector();
        double nearest = -1e9;
        double farthest = 1e9;
        for (std::size_t k = 0; k < points.size(); k += 3) {
            const double towards_camera =
                distance - project(camera, {points[k], points[k + 1], points[k + 2]})[2];
            nearest = std::max(nearest, towards_camera);
            farthest = std::min(farthest, towards_camera);
        }
        CHECK(nearest < rays.near_z);
        CHECK(farthest > rays.far_z);
    }
}
