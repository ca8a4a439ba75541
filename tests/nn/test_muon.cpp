#include <Eigen/SVD>
#include <array>
#include <catch2/catch.hpp>
#include <cmath>

#include "core/error.h"
#include "core/ops/elementwise.h"
#include "core/rng.h"
#include "core/tensor_eigen.h"
#include "nn/optim/muon.h"

using namespace stymo;

namespace {

/// The published polynomial, five times.
double iterated(double x) {
    for (int i = 0; i < 5; ++i) x = 3.4445 * x - 4.7750 * std::pow(x, 3) + 2.0315 * std::pow(x, 5);
    return x;
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
        const Eigen::MatrixXd matrix = random_matrix(rows, columns);
        const Eigen::BDCSVD<Eigen::MatrixXd> svd(matrix, Eigen::ComputeThinU | Eigen::ComputeThinV);
        const Eigen::VectorXd values = (svd.singularValues() / matrix.norm()).unaryExpr(&iterated);
        const Eigen::MatrixXd expected =
            svd.matrixU() * values.asDiagonal() * svd.matrixV().transpose();
        const Tensor result = orthogonalised(tensor_from(matrix));
        CHECK((matrix_map<double>(result) - expected).norm() < 1e-10);
        // A common factor of any magnitude makes no difference.
        const Tensor scaled = orthogonalised(tensor_from(Eigen::MatrixXd(matrix * 1e-30)));
        CHECK((matrix_map<double>(scaled) - expected).norm() < 1e-10);
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
