#pragma once

#include <filesystem>
#include <map>
#include <optional>
#include <string>

#include "core/io/tensor_file.h"
#include "nn/parameter_store.h"

/// Weights and inputs that PyTorch makes as well (tests/golden/torch_model.py), and comparison with what it made of them.
namespace stymo::test {

/// Uniform in +-1.75, of deviation 1, a function of the name alone; float64 that float32 holds exactly.
[[nodiscard]] Tensor golden_numbers(const std::string& name, const Shape& shape);
/// Gives every parameter the numbers of its name: a deviation of 1 for weights, of 0.25 for biases, around 1 for those of styles;
/// then converts the store to `dtype`.
void set_golden_parameters(ParameterStore& store, DType dtype);

/// Folder of the vectors that are made on demand: the environment variable STYMO_GOLDEN. Without it, says so on stdout.
[[nodiscard]] std::optional<std::filesystem::path> golden_folder();

/// A file of PyTorch's numbers, named "<item>/<group>/<name>".
class GoldenVectors {
public:
    /// `folded`: each tensor was reduced to at most 32 sums over elements i times cos(i).
    GoldenVectors(const std::filesystem::path& path, bool folded);

    /// Compares a whole group in both directions: no name may be missing on either side. Differences count relative to the
    /// largest magnitude of their tensor (or to `least_magnitude` if that is larger), at most 1e-4 in float32 and 1e-8 in
    /// float64. Prints the worst one if `report`.
    void check(const std::string& group, const std::map<std::string, Tensor>& actual, bool report,
               double least_magnitude = 0.0) const;

    [[nodiscard]] const Shape& shape(const std::string& name) const { return file_.tensors.at(name).shape(); }

private:
    TensorFile file_;
    bool folded_;
};

}  // namespace stymo::test
