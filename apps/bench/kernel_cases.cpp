#include <algorithm>
#include <string>
#include <vector>

#include "apps/bench/case.h"
#include "core/kernels/float16_product.h"
#include "core/kernels/gemm.h"
#include "core/matmul_precision.h"
#include "core/parallel.h"

namespace stymo {

namespace {

// A layer of the field, on the samples of an exact frame.
constexpr std::int64_t all_points = 65536;
/// Points whose numbers stay in a cache.
constexpr std::int64_t few_points = 4096;
constexpr std::int64_t width = 256;
/// Rows that stay in the second-level cache with the weights.
constexpr std::int64_t tile = 256;

std::vector<float> numbers(std::int64_t count, double deviation, Rng& rng) {
    const Tensor drawn = rng.normal({count}, 0.0, deviation);
    const auto values = drawn.values<float>();
    return {values.begin(), values.end()};
}

/// Room for numbers of T, aligned as tensors are.
template <class T>
T* room(Tensor& storage, std::int64_t count) {
    storage = Tensor({chunk_count(count * static_cast<std::int64_t>(sizeof(T)),
                                  static_cast<std::int64_t>(sizeof(float)))});
    return reinterpret_cast<T*>(storage.mutable_values<float>().data());
}

/// T: float, BFloat16 or Float16.
template <class T>
Measurement layer(const BenchRun& run, std::int64_t points, Activation activation, Limit limit) {
    Rng rng = Rng(run.seed).split("layer");
    const std::vector<float> weight = numbers(width * width, 0.1, rng);
    const std::vector<float> bias = numbers(width, 0.1, rng);
    const kernels::PackedMatrix<T> packed(weight.data(), width, width, 1, width);
    Tensor storage_x, storage_y;
    T* const x = room<T>(storage_x, points * width);
    T* const y = room<T>(storage_y, points * width);
    std::fill_n(x, points * width, T());
    if constexpr (std::is_same_v<T, float>) std::ranges::copy(numbers(points * width, 1.0, rng), x);
    const kernels::Epilogue<float> epilogue{.bias = bias.data(), .activation = activation};
    const auto all_tiles = [&] {
        parallel_for(points, tile, [&](std::int64_t begin, std::int64_t end) {
            kernels::multiply_packed(y + begin * width, width, {x + begin * width, width},
                                     end - begin, packed, epilogue);
        });
    };
    return {.timing = time_repeated(run.options.repeats, 0.1 * run.options.repeats, all_tiles),
            .work = static_cast<double>(points) * width * width,
            .limit = limit,
            .peak_memory = peak_memory_mebibytes()};
}

Measurement float_layer(const BenchRun& run, std::int64_t points, Activation activation,
                        MatmulPrecision precision) {
    const MatmulPrecision before = matmul_precision();
    set_matmul_precision(precision);
    const Measurement measurement = layer<float>(run, points, activation, Limit::float32);
    set_matmul_precision(before);
    return measurement;
}

Measurement half_layer(const BenchRun& run) {
    if (kernels::multiplies_float16())
        return layer<kernels::Float16>(run, all_points, Activation::sine, Limit::sixteen_bits);
    return layer<kernels::BFloat16>(run, all_points, Activation::sine, Limit::sixteen_bits);
}

}  // namespace

std::vector<BenchCase> kernel_cases() {
    return {
        {"product", "kernels", "65536 x 256 times 256 x 256, float32",
         [](const BenchRun& run) {
             return float_layer(run, all_points, Activation::none, MatmulPrecision::highest);
         }},
        {"sine-layer", "kernels", "the same with bias and sine",
         [](const BenchRun& run) {
             return float_layer(run, all_points, Activation::sine, MatmulPrecision::highest);
         }},
        {"product-in-cache", "kernels", "4096 x 256 times 256 x 256, float32",
         [](const BenchRun& run) {
             return float_layer(run, few_points, Activation::none, MatmulPrecision::highest);
         }},
        {"product-high", "kernels", "the same on matrix tiles where the processor has them",
         [](const BenchRun& run) {
             return float_layer(run, few_points, Activation::none, MatmulPrecision::high);
         }},
        {"sine-layer-half", "kernels", "the same in the faster type of 16 bits", half_layer},
    };
}

}  // namespace stymo
