#include "support/golden.h"

#include <catch2/catch.hpp>
#include <cmath>
#include <cstdlib>
#include <iostream>

#include "core/rng.h"
#include "support/check_close.h"

namespace stymo::test {
namespace {

constexpr std::size_t fold = 32;

Tensor folded(const Tensor& tensor) {
    const std::vector<double> values = tensor.to_vector();
    std::vector<double> sums(fold, 0.0);
    for (std::size_t i = 0; i < values.size(); ++i) sums[i % fold] += values[i] * std::cos(static_cast<double>(i));
    return Tensor::from({static_cast<std::int64_t>(fold)}, std::span<const double>(sums));
}

}  // namespace

Tensor golden_numbers(const std::string& name, const Shape& shape) {
    Tensor values = Rng(1).split(name).uniform(shape, 0.0, 1.0, DType::float64);
    for (double& value : values.mutable_values<double>()) value = static_cast<float>((value - 0.5) * 3.5);
    return values;
}

void set_golden_parameters(ParameterStore& store, DType dtype) {
    store.convert(DType::float64);
    for (const Parameter& parameter : store.all()) {
        const bool bias = parameter.name().ends_with(".bias");
        const double offset = parameter.name().ends_with(".style.bias") ? 1.0 : 0.0;
        Tensor values = golden_numbers(parameter.name(), parameter.variable().shape());
        for (double& value : values.mutable_values<double>()) value = static_cast<float>(value * (bias ? 0.25 : 1.0) + offset);
        parameter.set_value(values);
    }
    store.convert(dtype);
}

std::optional<std::filesystem::path> golden_folder() {
    if (const char* folder = std::getenv("STYMO_GOLDEN")) return folder;
    std::cout << "skipped: no golden vectors\n";
    return std::nullopt;
}

GoldenVectors::GoldenVectors(const std::filesystem::path& path, bool folded) : file_(read_tensor_file(path)), folded_(folded) {}

void GoldenVectors::check(const std::string& group, const std::map<std::string, Tensor>& actual, bool report,
                          double least_magnitude) const {
    const DType dtype = actual.begin()->second.dtype();
    const double tolerance = dtype == DType::float64 ? 1e-8 : 1e-4;
    double worst = 0.0;
    std::string worst_name;
    for (const auto& [name, tensor] : actual) {
        const auto expected = file_.tensors.find(group + "/" + name);
        INFO(group << "/" << name);
        REQUIRE(expected != file_.tensors.end());
        const CloseReport close = check_close(folded_ ? folded(tensor) : tensor, expected->second, tolerance, least_magnitude);
        INFO(close.message);
        CHECK(close.passed);
        if (!(close.error <= worst)) {
            worst = close.error;
            worst_name = name;
        }
    }
    for (const auto& [name, tensor] : file_.tensors) {
        if (!name.starts_with(group + "/")) continue;
        INFO(name << " was not computed");
        CHECK(actual.contains(name.substr(group.size() + 1)));
    }
    if (report) {
        std::cout << "agreement | " << group << " | " << dtype << " | " << worst << " | " << worst_name << " | " << actual.size()
                  << " tensors\n";
    }
}

}  // namespace stymo::test
