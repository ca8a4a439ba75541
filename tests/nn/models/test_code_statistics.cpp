#include <catch2/catch.hpp>
#include <cmath>

#include "core/io/scratch_folder.h"
#include "core/ops/ops.h"
#include "nn/models/code_statistics.h"
#include "nn/models/model.h"
#include "support/check_close.h"
#include "support/error_message.h"
#include "support/tiny_model.h"

using namespace stymo;
using namespace stymo::test;

namespace {

/// L L^T
Tensor covariance_of(const CodeStatistics& statistics) {
    return matmul(Variable(statistics.factor()), Variable(statistics.factor()),
                  {.transpose_b = true})
        .value();
}

/// Codes in which three numbers of different groups hold these values, face by face, and the rest
/// 0.
Codes three_numbers(const std::vector<std::array<double, 3>>& faces) {
    Tensor rows = Tensor::zeros({static_cast<std::int64_t>(faces.size()), code_size});
    const std::span<float> values = rows.mutable_values<float>();
    for (std::size_t face = 0; face < faces.size(); ++face) {
        for (std::size_t i = 0; i < 3; ++i)
            values[face * code_size + 100 * (i + 1) - 1] = static_cast<float>(faces[face][i]);
    }
    return split_codes(rows);
}

}  // namespace

TEST_CASE("joined codes split into what they were, in the order of the groups",
          "[code_statistics]") {
    const Codes codes = random_codes(3, 1);
    const Variable rows = joined(codes);
    CHECK(rows.shape() == Shape{3, code_size});
    CHECK(rows.value().values<float>()[100] == codes.expression().value().values<float>()[0]);
    const Codes again = split_codes(rows);
    for (std::size_t group = 0; group < code_names.size(); ++group)
        CHECK(identical(again.groups[group].value(), codes.groups[group].value()));
    CHECK_THROWS_AS(split_codes(Variable(Tensor::zeros({3, 305}))), ShapeError);
}

TEST_CASE("statistics of codes are the mean and the covariance computed by hand",
          "[code_statistics]") {
    // x, y and 2 x + y: the third number depends on the others.
    const CodeStatistics statistics = CodeStatistics::of(
        three_numbers({{1.0, 2.0, 4.0}, {3.0, 0.0, 6.0}, {5.0, 4.0, 14.0}, {3.0, 6.0, 12.0}}));
    CHECK(statistics.faces() == 4);
    const std::vector<double> mean = statistics.mean().to_vector();
    const std::vector<double> covariance = covariance_of(statistics).to_vector();
    const std::array<std::size_t, 3> indices{99, 199, 299};
    const std::array<double, 3> means{3.0, 3.0, 9.0};
    const std::array<std::array<double, 3>, 3> covariances{{{8.0 / 3.0, 4.0 / 3.0, 20.0 / 3.0},
                                                            {4.0 / 3.0, 20.0 / 3.0, 28.0 / 3.0},
                                                            {20.0 / 3.0, 28.0 / 3.0, 68.0 / 3.0}}};
    for (std::size_t i = 0; i < 3; ++i) {
        CHECK(mean[indices[i]] == Approx(means[i]));
        for (std::size_t k = 0; k < 3; ++k)
            CHECK(covariance[indices[i] * code_size + indices[k]] == Approx(covariances[i][k]));
    }
    double total = 0.0;
    for (const double value : covariance) total += std::abs(value);
    CHECK(total == Approx(32.0 + 2.0 * (52.0 / 3.0)));
    for (std::int64_t i = 0; i < code_size; ++i) {
        for (std::int64_t k = i + 1; k < code_size; ++k)
            REQUIRE(
                statistics.factor().values<float>()[static_cast<std::size_t>(i * code_size + k)] ==
                0.0F);
    }
}

TEST_CASE("fewer faces than numbers of a code, or more, give a factor of their covariance",
          "[code_statistics]") {
    for (const std::int64_t faces : {2, 40, 700}) {
        const Codes codes = random_codes(faces, 5);
        const Variable rows = joined(codes).value().to(DType::float64);
        const Variable difference = rows - mean(rows, {0});
        const Variable expected =
            matmul(difference, difference, {.transpose_a = true}) / static_cast<double>(faces - 1);
        const CloseReport report = check_close(covariance_of(CodeStatistics::of(codes)),
                                               expected.value().to(DType::float32), 1e-5);
        INFO(faces << " faces: " << report.message);
        CHECK(report.passed);
    }
}

TEST_CASE("samples have the mean and the covariance of the faces, narrowed by the truncation",
          "[code_statistics]") {
    const CodeStatistics statistics = CodeStatistics::of(
        three_numbers({{1.0, 2.0, 4.0}, {3.0, 0.0, 6.0}, {5.0, 4.0, 14.0}, {3.0, 6.0, 12.0}}));
    constexpr int draws = 4000;
    for (const double truncation : {1.0, 0.5}) {
        Rng rng(3);
        double sum = 0.0, square_sum = 0.0, product_sum = 0.0;
        for (int i = 0; i < draws; ++i) {
            const std::vector<double> face =
                joined(statistics.sample(rng, truncation)).value().to_vector();
            sum += face[99];
            square_sum += (face[99] - 3.0) * (face[99] - 3.0);
            product_sum += (face[99] - 3.0) * (face[299] - 9.0);
            REQUIRE(face[299] == Approx(2.0 * face[99] + face[199]).margin(1e-5));
            REQUIRE(face[0] == 0.0);
        }
        const double variance = truncation * truncation * 8.0 / 3.0;
        CHECK(sum / draws == Approx(3.0).margin(4.0 * std::sqrt(variance / draws)));
        CHECK(square_sum / draws == Approx(variance).epsilon(4.0 * std::sqrt(2.0 / draws)));
        CHECK(product_sum / draws == Approx(2.5 * variance).epsilon(0.12));
    }
    Rng rng(4);
    CHECK(identical(joined(statistics.sample(rng, 0.0)).value(),
                    statistics.mean().reshaped({1, code_size})));
    CHECK(joined(statistics.sample(rng, 1.0)).value().to_vector() !=
          joined(statistics.sample(rng, 1.0)).value().to_vector());
}

TEST_CASE("statistics of one face or of codes that are not finite are refused",
          "[code_statistics]") {
    CHECK_THROWS_AS(CodeStatistics::of(random_codes(1, 1)), ValueError);
    const double infinity = std::numeric_limits<double>::infinity();
    CHECK_THROWS_AS(CodeStatistics::of(three_numbers({{1.0, 2.0, 4.0}, {3.0, infinity, 6.0}})),
                    NumericError);
}

TEST_CASE("a model keeps its statistics of codes in its file, and does without them",
          "[code_statistics][model]") {
    const ScratchFolder folder;
    tiny_model(3).save(folder / "without.safetensors");
    CHECK_FALSE(Model::load(folder / "without.safetensors").code_statistics());
    TensorFile good = read_tensor_file(folder / "without.safetensors");
    const CodeStatistics statistics = CodeStatistics::of(random_codes(5, 1));
    statistics.save(good);
    write_tensor_file(folder / "with.safetensors", good);
    Model::load(folder / "with.safetensors").save(folder / "again.safetensors");
    const Model loaded = Model::load(folder / "again.safetensors");
    REQUIRE(loaded.code_statistics());
    CHECK(loaded.code_statistics()->faces() == 5);
    CHECK(identical(loaded.code_statistics()->mean(), statistics.mean()));
    CHECK(identical(loaded.code_statistics()->factor(), statistics.factor()));

    const auto refusal = [&](const TensorFile& file) {
        write_tensor_file(folder / "bad.safetensors", file);
        const std::string message = error_message<FileError>(
            [&] { static_cast<void>(Model::load(folder / "bad.safetensors")); });
        CHECK(is_one_line(message));
        return message;
    };
    TensorFile bad = good;
    bad.tensors.erase("codes.factor");
    CHECK_THAT(refusal(bad), Catch::Contains("no tensor codes.factor"));
    bad = good;
    bad.tensors["codes.mean"] = Tensor::zeros({305});
    CHECK_THAT(refusal(bad), Catch::Contains("codes.mean has shape"));
    bad = good;
    bad.tensors["codes.mean"] = Tensor::full({code_size}, std::numeric_limits<double>::quiet_NaN());
    CHECK_THAT(refusal(bad), Catch::Contains("codes.mean holds values that are not finite"));
}
