#include <algorithm>
#include <array>
#include <catch2/catch.hpp>
#include <cmath>
#include <limits>

#include "core/error.h"
#include "core/ops/elementwise.h"
#include "core/rng.h"
#include "core/tensor_eigen.h"
#include "nn/optim/muon.h"
#include "support/check_close.h"
#include "support/tiny_model.h"

using namespace stymo;

namespace {

/// The published polynomial, five times.
double iterated(double x) {
    for (int i = 0; i < 5; ++i) x = 3.4445 * x - 4.7750 * std::pow(x, 3) + 2.0315 * std::pow(x, 5);
    return x;
}

/// Columns of an orthogonal matrix, the product of two reflections.
Eigen::MatrixXd orthogonal_columns(int rows, int columns, std::uint64_t seed) {
    Eigen::MatrixXd result = Eigen::MatrixXd::Identity(rows, columns);
    for (std::uint64_t i = 0; i < 2; ++i) {
        const Eigen::VectorXd normal =
            matrix_map<double>(Rng(seed).split(i).normal({rows, 1}, 0.0, 1.0, DType::float64))
                .col(0)
                .normalized();
        result -= 2.0 * normal * (normal.transpose() * result);
    }
    return result;
}

Eigen::MatrixXd random_matrix(int rows, int columns) {
    return matrix_map<double>(Rng(3).normal({rows, columns}, 0.0, 1.0, DType::float64));
}

void run(Muon& muon, const ParameterStore& store, int begin, int end) {
    for (int step = begin; step < end; ++step) {
        const Tensor gradient =
            Rng(9).split(static_cast<std::uint64_t>(step)).normal({4, 3}, 0.0, 1.0);
        muon.step(store.all(), std::vector<Variable>{gradient}, 0.01);
    }
}

}  // namespace

TEST_CASE("orthogonalising maps each singular value by the iteration and keeps the vectors",
          "[muon]") {
    for (const auto& [rows, columns] :
         {std::array{5, 5}, std::array{3, 7}, std::array{7, 3}, std::array{1, 4}}) {
        const int rank = std::min(rows, columns);
        const Eigen::MatrixXd left = orthogonal_columns(rows, rank, 1);
        const Eigen::MatrixXd right = orthogonal_columns(columns, rank, 2);
        const Eigen::VectorXd values = Eigen::VectorXd::LinSpaced(rank, 0.5, 3.0);
        const Eigen::MatrixXd matrix = left * values.asDiagonal() * right.transpose();
        const Eigen::VectorXd mapped = values.normalized().unaryExpr(&iterated);
        const Eigen::MatrixXd expected = left * mapped.asDiagonal() * right.transpose();
        const Tensor result = orthogonalised(tensor_from(matrix));
        CHECK((matrix_map<double>(result) - expected).norm() < 1e-10);
        // A common factor of any magnitude makes no difference.
        const Tensor scaled = orthogonalised(tensor_from(Eigen::MatrixXd(matrix * 1e-30)));
        CHECK((matrix_map<double>(scaled) - expected).norm() < 1e-10);
        for (const double factor : {1e-37, 1e-25, 1e-19, 1e19, 1e37}) {
            INFO("times " << factor);
            const Tensor single = tensor_from(Eigen::MatrixXd(matrix * factor)).to(DType::float32);
            CHECK(
                (matrix_map<double>(orthogonalised(single).to(DType::float64)) - expected).norm() <
                1e-4);
        }
    }
    CHECK(orthogonalised(Tensor::zeros({2, 3})).to_vector() == std::vector<double>(6, 0.0));
    CHECK_THROWS_AS(orthogonalised(Tensor::zeros({2})), ShapeError);
}

TEST_CASE("Muon's first step is the orthogonalised gradient, with the learning rate as its size",
          "[muon]") {
    ParameterStore store;
    const Parameter parameter = store.create("w", Tensor::zeros({32, 64}, DType::float64));
    const Eigen::MatrixXd gradient = random_matrix(32, 64);
    Muon muon;
    muon.step(store.all(), std::vector<Variable>{tensor_from(gradient)}, 0.25);
    const Eigen::MatrixXd step = matrix_map<double>(parameter.variable().value());
    const Eigen::MatrixXd direction = matrix_map<double>(orthogonalised(tensor_from(gradient)));
    CHECK((step + 0.25 * 8.0 * direction).norm() < 1e-12);
    CHECK(step.norm() / std::sqrt(32.0 * 64.0) == Approx(0.25).epsilon(0.2));
}

TEST_CASE("Muon's steps follow Nesterov momentum", "[muon]") {
    const Eigen::MatrixXd first = random_matrix(4, 3), second = random_matrix(4, 3).cwiseAbs();
    for (const double momentum : {0.0, 0.7, 0.95}) {
        ParameterStore store;
        const Parameter parameter = store.create("w", Tensor::zeros({4, 3}, DType::float64));
        Muon muon({.momentum = momentum});
        muon.step(store.all(), std::vector<Variable>{tensor_from(first)}, 0.5);
        const Eigen::MatrixXd before = matrix_map<double>(parameter.variable().value());
        muon.step(store.all(), std::vector<Variable>{tensor_from(second)}, 0.5);
        const Eigen::MatrixXd step = matrix_map<double>(parameter.variable().value()) - before;
        const double now = 1.0 - momentum;
        const Eigen::MatrixXd direction =
            momentum * momentum * now * first + (momentum * now + now) * second;
        const Eigen::MatrixXd expected = matrix_map<double>(orthogonalised(tensor_from(direction)));
        CHECK((step + 0.5 * 2.0 * expected).norm() < 1e-12);
    }
}

TEST_CASE("Muon goes on bit for bit from what it saved", "[muon]") {
    const auto fresh = [] {
        ParameterStore store;
        store.create("w", Tensor::full({4, 3}, 1.0));
        return store;
    };
    const ParameterStore whole = fresh(), resumed = fresh();
    Muon one, two, three;
    run(one, whole, 0, 5);
    run(two, resumed, 0, 2);
    TensorFile file;
    two.save(file, "muon.");
    three.load(file, "muon.");
    run(three, resumed, 2, 5);
    CHECK(whole.all()[0].variable().value().to_vector() ==
          resumed.all()[0].variable().value().to_vector());
}

TEST_CASE("Muon refuses what is no matrix or does not fit", "[muon]") {
    ParameterStore store;
    store.create("w", Tensor::zeros({4}));
    Muon muon;
    CHECK_THROWS_WITH(muon.step(store.all(), std::vector<Variable>{Tensor::zeros({4})}, 0.1),
                      Catch::Contains("gradient of w"));
    CHECK_THROWS_AS(muon.step(store.all(), {}, 0.1), ValueError);
}

TEST_CASE("a step that is refused moves nothing", "[muon]") {
    ParameterStore store;
    store.create("decoder.bias", Tensor::zeros({16}));
    store.create("decoder.hidden", Tensor::zeros({16, 16}));
    const std::vector<Variable> broken{
        Tensor::full({16}, 1.0), Tensor::full({16, 16}, std::numeric_limits<double>::quiet_NaN())};
    HybridOptimizer hybrid({}, MuonScope::decoder);
    CHECK_THROWS_AS(hybrid.step(store.all(), broken, {.learning_rate = 0.1}), NumericError);
    CHECK_THROWS_AS(hybrid.step(store.all(), std::span(broken).first(1), {.learning_rate = 0.1}),
                    ValueError);
    for (const Parameter& parameter : store.all())
        for (const double value : parameter.variable().value().to_vector()) CHECK(value == 0.0);
    Muon muon;
    TensorFile other;
    ParameterStore wide;
    wide.create("decoder.hidden", Tensor::zeros({1, 16}));
    muon.step(wide.all(), std::vector<Variable>{Tensor::full({1, 16}, 1.0)}, 0.1);
    muon.save(other, "");
    Muon resumed;
    resumed.load(other, "");
    CHECK_THROWS_AS(resumed.step(std::span(store.all()).subspan(1),
                                 std::vector<Variable>{Tensor::full({16, 16}, 1.0)}, 0.1),
                    ShapeError);
}

TEST_CASE("the hybrid optimizer moves the decoder's hidden matrices by Muon, all else by Adam",
          "[muon]") {
    struct Row {
        std::string name;
        Shape shape;
        bool muon;
        double rate;
    };
    const std::vector<Row> rows{{"decoder.hidden", {16, 20}, true, 0.01},
                                {"decoder.field.hidden", {20, 16}, true, 0.005},
                                {"decoder.to_rgb", {3, 20}, false, 0.004},
                                {"encoder.hidden", {16, 20}, false, 0.004},
                                {"decoder.field.bias", {16}, false, 0.002}};
    const MuonOptions options{.momentum = 0.7};
    const OptimizerRates rates{0.01, "decoder.field.", 0.5, 0.4};
    ParameterStore store;
    std::vector<Variable> gradients;
    for (const Row& row : rows) {
        store.create(row.name, Tensor::zeros(row.shape));
        gradients.emplace_back(Rng(gradients.size()).normal(row.shape, 0.0, 1.0));
    }
    const auto value = [&](std::size_t i) { return store.all()[i].variable().value(); };
    HybridOptimizer hybrid({}, MuonScope::decoder, options);
    // The second step depends on the momentum.
    for (int step = 0; step < 2; ++step) {
        hybrid.step(store.all(), gradients, rates);
        for (Variable& gradient : gradients) gradient = square(gradient);
    }
    for (std::size_t i = 0; i < rows.size(); ++i) {
        ParameterStore one;
        one.create(rows[i].name, Tensor::zeros(rows[i].shape));
        Muon muon(options);
        Adam adam;
        Variable gradient = Rng(i).normal(rows[i].shape, 0.0, 1.0);
        for (int step = 0; step < 2; ++step) {
            const std::vector<Variable> own{gradient};
            if (rows[i].muon)
                muon.step(one.all(), own, rows[i].rate);
            else
                adam.step(one.all(), own, rows[i].rate);
            gradient = square(gradient);
        }
        INFO(rows[i].name);
        CHECK(test::identical(value(i), one.all()[0].variable().value()));
    }

    TensorFile file;
    hybrid.save(file, "x.");
    std::vector<Tensor> before, after;
    for (std::size_t i = 0; i < rows.size(); ++i) before.push_back(value(i));
    hybrid.step(store.all(), gradients, rates);
    for (std::size_t i = 0; i < rows.size(); ++i) {
        after.push_back(value(i));
        store.all()[i].set_value(before[i]);
    }
    HybridOptimizer resumed({}, MuonScope::decoder, options);
    resumed.load(file, "memory", "x.");
    resumed.step(store.all(), gradients, rates);
    for (std::size_t i = 0; i < rows.size(); ++i) CHECK(test::identical(value(i), after[i]));
}

TEST_CASE("Muon moves the encoder's convolutions as matrices where that is asked", "[muon]") {
    const Shape kernel{16, 3, 3, 20};
    const Variable gradient = Rng(1).normal(kernel, 0.0, 1.0);
    ParameterStore as_kernel, as_matrix, plain, table, plain_table;
    as_kernel.create("encoder.conv.weight", Tensor::zeros(kernel));
    as_kernel.create("encoder.first.weight", Tensor::zeros({16, 3, 3, 3}));
    as_matrix.create("encoder.conv.weight", Tensor::zeros({16, 180}));
    plain.create("encoder.first.weight", Tensor::zeros({16, 3, 3, 3}));
    const Variable few = Rng(2).normal({16, 3, 3, 3}, 0.0, 1.0);
    HybridOptimizer hybrid({}, MuonScope::encoder_and_decoder);
    hybrid.step(as_kernel.all(), std::vector<Variable>{gradient, few}, {.learning_rate = 0.01});
    Muon().step(as_matrix.all(), std::vector<Variable>{reshape(gradient, {16, 180})}, 0.01);
    Adam().step(plain.all(), std::vector<Variable>{few}, 0.01);
    const std::vector<Variable> rows{Rng(3).normal({20, 16}, 0.0, 1.0)};
    table.create("codes.offset.id", Tensor::zeros({20, 16}));
    plain_table.create("codes.offset.id", Tensor::zeros({20, 16}));
    hybrid.step(table.all(), rows, {.learning_rate = 0.01});
    Adam().step(plain_table.all(), rows, 0.01);
    CHECK(test::identical(table.all()[0].variable().value(),
                          plain_table.all()[0].variable().value()));
    CHECK(as_kernel.all()[0].variable().value().to_vector() ==
          as_matrix.all()[0].variable().value().to_vector());
    CHECK(
        test::identical(as_kernel.all()[1].variable().value(), plain.all()[0].variable().value()));
}

TEST_CASE("a falloff scales the first weights of each frequency, and nothing else", "[muon]") {
    ModelConfig config = test::tiny_model_config();
    config.decoder.frequency_falloff = 1.5;
    Rng rng(1);
    const Model scaled(config, rng), plain = test::tiny_model(1);
    for (std::size_t i = 0; i < plain.parameters().all().size(); ++i) {
        const Parameter& parameter = plain.parameters().all()[i];
        const std::vector<double> a = parameter.variable().value().to_vector(),
                                  b = scaled.parameters().all()[i].variable().value().to_vector();
        const bool first = parameter.name() == "decoder.field.layer0.weight";
        const auto columns = static_cast<std::size_t>(3 + 6 * config.decoder.frequencies);
        for (std::size_t k = 0; k < a.size(); ++k) {
            const std::size_t column = k % columns;
            const double power = first && column >= 3 ? static_cast<double>((column - 3) / 6) : 0.0;
            REQUIRE(b[k] == Approx(a[k] * std::exp2(-1.5 * power)).epsilon(1e-6));
        }
    }
}
