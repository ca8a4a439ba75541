#pragma once

#include <filesystem>
#include <map>
#include <optional>
#include <string>

#include "core/io/tensor_file.h"
#include "core/rng.h"
#include "nn/parameter_store.h"

/// Weights and inputs that PyTorch makes as well (tests/golden/torch_model.py), and comparison with
/// what it made of them.
namespace stymo::test {

/// Uniform in +-1.75, of deviation 1, a function of seed and name; float64 that float32 holds
/// exactly.
[[nodiscard]] Tensor golden_numbers(const std::string& name, const Shape& shape,
                                    const Rng& seed = Rng(1));
/// Gives every parameter the numbers of its name, of deviation 1 for weights and 0.25 for biases
/// (those of styles around 1), and converts the store to `dtype`.
void set_golden_parameters(ParameterStore& store, DType dtype, const Rng& seed = Rng(1));

/// Folder of the vectors that are made on demand: the environment variable STYMO_GOLDEN. Without
/// it, says so on stdout.
[[nodiscard]] std::optional<std::filesystem::path> golden_folder();

using Tensors = std::map<std::string, Tensor>;

/// A file of PyTorch's numbers, computed in float64 and named "<case>/<group>/<name>".
class GoldenVectors {
public:
    /// `folded`: each tensor was reduced to a few sums, the n-th over elements i = n modulo their
    /// number, times cos(i).
    GoldenVectors(const std::filesystem::path& path, bool folded);

    /// Compares a group; no name may be missing on either side. In float64 the largest difference
    /// may be 1e-8 of the largest magnitude of its tensor. In float32 the norm of the differences
    /// may be `bound` of the norm of the tensor: where a leaky ReLU sees a number that is zero
    /// within rounding, either slope is right, and single elements of a gradient differ by more.
    /// Magnitudes and norms count as `least_magnitude` if they are smaller: where a sum cancels,
    /// its rounding errors are left. Prints both errors if `report`.
    void check(const std::string& group, const Tensors& actual, bool report,
               double least_magnitude = 1e-6, double bound = 1e-4) const;

    [[nodiscard]] const Shape& shape(const std::string& name) const {
        return file_.tensors.at(name).shape();
    }

private:
    TensorFile file_;
    bool folded_;
};

}  // namespace stymo::test
