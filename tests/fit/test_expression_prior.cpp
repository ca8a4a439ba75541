// Changes of expressions that the model's faces show.
#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <catch2/catch.hpp>

#include "core/tensor_eigen.h"
#include "fit/expression_prior.h"
#include "fit/shipped_files.h"
#include "render/morphable/builtin_head.h"
#include "support/tiny_model.h"

using namespace stymo;

namespace expression_prior_tests {

namespace {

const Model& shipped_model() {
    static const Model model = Model::load(named_model({}), ModelParts::decoder);
    return model;
}

Tensor change_of(const Eigen::RowVectorXd& values) {
    return tensor_from(Eigen::MatrixXd(values)).to(DType::float32);
}

Eigen::RowVectorXd row_of(const Tensor& change) {
    return matrix_map<float>(change).cast<double>();
}

}  // namespace

TEST_CASE("directions of expressions have the covariance among faces of one identity",
          "[expression_prior]") {
    const Eigen::MatrixXd factor =
        matrix_map<float>(shipped_model().code_statistics()->factor()).cast<double>();
    const Eigen::MatrixXd covariance = factor * factor.transpose();
    const auto id = code_sizes[0], expression = code_sizes[1];
    const Eigen::MatrixXd within = covariance.block(0, 0, id, id);
    const Eigen::MatrixXd across = covariance.block(0, id, id, expression);
    const Eigen::MatrixXd wanted = covariance.block(id, id, expression, expression) -
                                   across.transpose() * within.ldlt().solve(across);
    const Eigen::MatrixXd c =
        matrix_map<float>(expression_directions(shipped_model())).cast<double>();
    CHECK((c.transpose() * c - wanted).norm() < 1e-3 * wanted.norm());
    CHECK_FALSE(expression_directions(test::tiny_model()).defined());
}

TEST_CASE("a plausible change goes as the wanted one, and never far beyond the model's faces",
          "[expression_prior]") {
    const MorphableHead& head = builtin_head();
    const PlausibleChanges plausible(shipped_model(), head);
    const Tensor rows = head.expression.reshaped({79, 3 * head.vertex_count()});
    const Eigen::MatrixXd moved = matrix_map<float>(rows).cast<double>();
    const Eigen::MatrixXd products = moved * moved.transpose();  // of the vertices' movements
    const Eigen::MatrixXd c =
        matrix_map<float>(expression_directions(shipped_model())).cast<double>();
    const Eigen::MatrixXd inverse = c.inverse();
    int shown = 0;
    for (int axis = 0; axis < 79; ++axis) {
        INFO(axis);
        const Eigen::RowVectorXd wanted = Eigen::RowVectorXd::Unit(79, axis);
        const Eigen::RowVectorXd small = row_of(plausible(change_of(0.01 * wanted)));
        const Eigen::RowVectorXd large = row_of(plausible(change_of(100.0 * wanted)));
        // The part of the movement that goes the wanted way.
        const double part = small.dot(products.row(axis)) / (0.01 * products(axis, axis));
        CHECK(part >= 0.0);
        CHECK(part <= 1.0 + 1e-3);
        shown += part > 0.3 ? 1 : 0;
        CHECK((large * inverse).norm() <= PlausibleChanges::most_unusual * 1.01);
        CHECK(small.dot(large) >= 0.99 * small.norm() * large.norm());
    }
    CHECK(shown >= 5);
    CHECK(row_of(plausible(Tensor::zeros({1, 79}))).norm() == 0.0);
}

TEST_CASE("a model without statistics changes no expression", "[expression_prior]") {
    const PlausibleChanges plausible(test::tiny_model(), builtin_head());
    const Tensor change = Tensor::full({1, 79}, 0.25);
    CHECK(plausible(change).to_vector() == change.to_vector());
}

}  // namespace expression_prior_tests
