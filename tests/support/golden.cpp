#include "support/golden.h"

#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <cstdlib>
#include <iostream>
#include <limits>

namespace stymo::test {
namespace {

std::vector<double> folded(const std::vector<double>& values, std::size_t count) {
    std::vector<double> sums(count, 0.0);
    for (std::size_t i = 0; i < values.size(); ++i)
        sums[i % count] += values[i] * std::cos(static_cast<double>(i));
    return sums;
}

struct RelativeError {
    double largest = 0.0;  ///< largest difference, in units of the largest magnitude
    double norm = 0.0;     ///< norm of the differences, in units of the norm
};

RelativeError relative_error(const std::vector<double>& actual, const std::vector<double>& expected,
                             double least_magnitude) {
    double difference = 0.0, magnitude = least_magnitude, difference_square = 0.0, square = 0.0;
    for (std::size_t i = 0; i < expected.size(); ++i) {
        const double each = actual[i] - expected[i];
        if (!std::isfinite(each)) return {each, each};
        difference = std::max(difference, std::abs(each));
        magnitude = std::max(magnitude, std::abs(expected[i]));
        difference_square += each * each;
        square += expected[i] * expected[i];
    }
    return {difference / magnitude,
            std::sqrt(difference_square) / std::max(std::sqrt(square), least_magnitude)};
}

}  // namespace

Tensor golden_numbers(const std::string& name, const Shape& shape, const Rng& seed) {
    Tensor values = seed.split(name).uniform(shape, 0.0, 1.0, DType::float64);
    for (double& value : values.mutable_values<double>())
        value = static_cast<float>((value - 0.5) * 3.5);
    return values;
}

void set_golden_parameters(ParameterStore& store, DType dtype, const Rng& seed) {
    store.convert(DType::float64);
    for (const Parameter& parameter : store.all()) {
        const bool bias = parameter.name().ends_with(".bias");
        const double offset = parameter.name().ends_with(".style.bias") ? 1.0 : 0.0;
        Tensor values = golden_numbers(parameter.name(), parameter.variable().shape(), seed);
        for (double& value : values.mutable_values<double>())
            value = static_cast<float>(value * (bias ? 0.25 : 1.0) + offset);
        parameter.set_value(values);
    }
    store.convert(dtype);
}

std::optional<std::filesystem::path> golden_folder() {
    if (const char* folder = std::getenv("STYMO_GOLDEN")) return folder;
    std::cout << "skipped: no golden vectors\n";
    return std::nullopt;
}

GoldenVectors::GoldenVectors(const std::filesystem::path& path, bool folded)
    : file_(read_tensor_file(path)), folded_(folded) {}

void GoldenVectors::check(const std::string& group, const Tensors& actual, bool report,
                          double least_magnitude, double bound) const {
    const DType dtype = actual.begin()->second.dtype();
    RelativeError worst;
    for (const auto& [name, tensor] : actual) {
        INFO(group << "/" << name << ", " << dtype);
        const auto expected = file_.tensors.find(group + "/" + name);
        REQUIRE(expected != file_.tensors.end());
        if (!folded_) REQUIRE(tensor.shape() == expected->second.shape());
        const std::vector<double> golden = expected->second.to_vector();
        const std::vector<double> values = tensor.to_vector();
        const RelativeError error = relative_error(folded_ ? folded(values, golden.size()) : values,
                                                   golden, least_magnitude);
        if (dtype == DType::float64) {
            CHECK(error.largest <= 1e-8);
        } else {
            CHECK(error.norm <= bound);
        }
        worst = {std::max(worst.largest, error.largest), std::max(worst.norm, error.norm)};
    }
    for (const auto& [name, tensor] : file_.tensors) {
        if (!name.starts_with(group + "/")) continue;
        INFO(name << " was not computed");
        CHECK(actual.contains(name.substr(group.size() + 1)));
    }
    if (report) {
        std::cout << "agreement | " << group << " | " << actual.size() << " | " << dtype << " | "
                  << worst.largest << " | " << worst.norm << " |\n";
    }
}

}  // namespace stymo::test
