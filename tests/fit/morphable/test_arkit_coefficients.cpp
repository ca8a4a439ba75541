#include <Eigen/Cholesky>
#include <algorithm>
#include <catch2/catch.hpp>

#include "core/rng.h"
#include "fit/morphable/arkit_coefficients.h"
#include "render/morphable/builtin_head.h"

namespace arkit_coefficients_tests {

namespace {

using stymo::non_negative_solution;

Eigen::MatrixXd random_matrix(std::int64_t rows, std::int64_t columns, std::uint64_t seed) {
    stymo::Rng rng(seed);
    const std::vector<double> values =
        rng.normal({rows, columns}, 0.0, 1.0, stymo::DType::float64).to_vector();
    return Eigen::Map<const Eigen::MatrixXd>(values.data(), rows, columns);
}

}  // namespace

TEST_CASE("Non-negative least squares finds a known solution, and satisfies its conditions",
          "[arkit]") {
    const Eigen::MatrixXd a = random_matrix(30, 12, 1);
    Eigen::VectorXd known = random_matrix(12, 1, 2).cwiseMax(0.0);
    const std::vector<bool> none(12, false);
    const Eigen::MatrixXd gram = a.transpose() * a;
    CHECK((non_negative_solution(gram, gram * known, none) - known).cwiseAbs().maxCoeff() < 1e-6);
    for (std::uint64_t seed = 3; seed < 20; ++seed) {
        const Eigen::VectorXd moment = a.transpose() * random_matrix(30, 1, seed);
        const Eigen::VectorXd x = non_negative_solution(gram, moment, none);
        const Eigen::VectorXd slope = gram * x - moment;
        CHECK(x.minCoeff() >= 0.0);
        CHECK(slope.minCoeff() > -1e-6);
        CHECK(x.dot(slope) == Approx(0.0).margin(1e-6));
    }
    // Without bounds it is the usual solution.
    const Eigen::VectorXd moment = a.transpose() * random_matrix(30, 1, 40);
    const Eigen::VectorXd usual = gram.ldlt().solve(moment);
    REQUIRE(usual.minCoeff() < 0.0);
    CHECK((non_negative_solution(gram, moment, std::vector<bool>(12, true)) - usual).norm() < 1e-6);
}

TEST_CASE("Shapes of the built-in head come back from its codes", "[arkit]") {
    const stymo::ArkitConversion conversion(stymo::builtin_head());
    std::vector<double> wanted(stymo::arkit_names.size(), 0.0);
    const auto number = [](const char* name) {
        return static_cast<std::size_t>(std::ranges::find(stymo::arkit_names, std::string(name)) -
                                        stymo::arkit_names.begin());
    };
    wanted[number("jawOpen")] = 0.5;
    wanted[number("eyeBlinkLeft")] = 0.8;
    wanted[number("mouthSmileRight")] = 0.3;
    const std::vector<float> code = conversion.code(wanted);
    CHECK(code[0] == Approx(2.0).margin(1e-2));
    CHECK(code[2] == Approx(3.6).margin(1e-2));
    CHECK(conversion.difference(code, wanted) < 1e-3 * conversion.size(code));
    const std::vector<double> back = conversion.coefficients(code);
    for (std::size_t k = 0; k < back.size(); ++k) CHECK(back[k] == Approx(wanted[k]).margin(2e-2));
    CHECK_THROWS_WITH(conversion.code(std::vector<double>(3)), Catch::Contains("52 numbers"));
}

}  // namespace arkit_coefficients_tests
