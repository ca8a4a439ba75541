#include <catch2/catch.hpp>
#include <vector>

#include "core/error.h"
#include "core/io/image.h"
#include "core/io/scratch_folder.h"
#include "core/io/tensor_file.h"
#include "nn/pretrained/landmark_network.h"

using namespace stymo;
using Catch::Matchers::Contains;

namespace {

Tensor random_images(std::int64_t count) {
    Rng rng(3);
    return rng.uniform({count, LandmarkNetwork::input_side, LandmarkNetwork::input_side, 3}, 0.0,
                       1.0);
}

}  // namespace

TEST_CASE("The landmark network has 1.3 million parameters and answers with 136 numbers") {
    const LandmarkModel model = make_landmark_model(Rng(1));
    CHECK(model.store->element_count() == 1'307'032);
    const Variable answer = model.network(random_images(2));
    CHECK(answer.shape() == Shape{2, 136});
}

TEST_CASE("Contrast and brightness have no effect on the landmark network") {
    const LandmarkModel model = make_landmark_model(Rng(1));
    const Tensor images = random_images(1);
    Tensor dim = images;
    for (float& value : dim.mutable_values<float>()) value = 0.5F * value + 0.2F;
    const std::vector<double> a = model.network(images).value().to_vector();
    const std::vector<double> b = model.network(dim).value().to_vector();
    for (std::size_t k = 0; k < a.size(); ++k) CHECK(a[k] == Approx(b[k]).margin(0.02));
}

TEST_CASE("A landmark network is the same after writing and reading") {
    const ScratchFolder folder;
    const LandmarkModel model = make_landmark_model(Rng(1));
    write_landmark_model(folder / "a.safetensors", model);
    const LandmarkModel read = read_landmark_model(folder / "a.safetensors");
    const Tensor images = random_images(1);
    CHECK(model.network(images).value().to_vector() == read.network(images).value().to_vector());
    CHECK(read.store->trainable().empty());

    TensorFile other;
    other.tensors["a"] = Tensor::zeros({1});
    write_tensor_file(folder / "b.safetensors", other);
    CHECK_THROWS_WITH(read_landmark_model(folder / "b.safetensors"),
                      Contains("not a landmark network of stymo"));
    TensorFile part = read_tensor_file(folder / "a.safetensors");
    part.tensors.erase(part.tensors.begin());
    write_tensor_file(folder / "c.safetensors", part);
    CHECK_THROWS_AS(read_landmark_model(folder / "c.safetensors"), FileError);
}

TEST_CASE("Covers are linear in the features, the same in the mirror image, and read from a file") {
    const ScratchFolder folder;
    write_landmark_model(folder / "a.safetensors", make_landmark_model(Rng(1)));
    Rng rng(2);
    const Tensor photo = rng.uniform({60, 60, 3}, 0.0, 1.0);
    const auto covers_of = [&](const Tensor& image, double center) {
        FaceCovers covers{7.0, 7.0};
        static_cast<void>(find_points(read_landmark_model(folder / "a.safetensors"), image,
                                      {{center, 29.0}, {20.0, 0.0}}, &covers));
        return covers;
    };
    CHECK(covers_of(photo, 31.0).mouth == 0.0);
    TensorFile file;
    file.tensors["covers.weight"] = rng.normal({2, LandmarkNetwork::feature_count}, 0.0, 0.1);
    file.tensors["covers.bias"] =
        Tensor::from({2}, std::vector<double>{0.5, -1.5}).to(DType::float32);
    write_tensor_file(folder / "covers.safetensors", file);
    const FaceCovers found = covers_of(photo, 31.0);
    const FaceCovers mirrored = covers_of(mirror_image(photo), 29.0);
    CHECK(found.mouth != found.eyes);
    CHECK(found.mouth == Approx(mirrored.mouth).margin(1e-3));
    CHECK(found.eyes == Approx(mirrored.eyes).margin(1e-3));
    file.tensors["covers.weight"] = Tensor::zeros({2, LandmarkNetwork::feature_count});
    write_tensor_file(folder / "covers.safetensors", file);
    CHECK(covers_of(photo, 31.0).mouth == Approx(0.5));
    CHECK(covers_of(photo, 31.0).eyes == Approx(-1.5));
    file.tensors.erase("covers.bias");
    write_tensor_file(folder / "covers.safetensors", file);
    CHECK_THROWS_WITH(read_landmark_model(folder / "a.safetensors"),
                      Contains("not the covers of a landmark network"));
}

TEST_CASE("The mirror image of a photo has the mirror image of its landmarks") {
    const LandmarkModel model = make_landmark_model(Rng(1));
    Rng rng(2);
    const Tensor photo = rng.uniform({60, 60, 3}, 0.0, 1.0);
    const FaceSquare square{{31.0, 29.0}, {20.0, 0.0}};
    const FaceSquare opposite{{29.0, 29.0}, {20.0, 0.0}};
    const FacePoints found = points_in_squares(model, photo, {square});
    const FacePoints in_mirror = points_in_squares(model, mirror_image(photo), {opposite});
    for (std::size_t k = 0; k < found.size(); ++k) {
        const Eigen::Vector2d& other = in_mirror[mirrored_point(k)];
        CHECK((found[k] - Eigen::Vector2d(60.0 - other.x(), other.y())).norm() < 1e-3);
    }
}
