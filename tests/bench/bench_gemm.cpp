#include <algorithm>
#include <cstdio>
#include <functional>
#include <span>
#include <string>
#include <vector>

#include "apps/bench/peak.h"
#include "bench/arguments.h"
#include "bench/gemm_libraries.h"
#include "core/kernels/gemm.h"
#include "core/kernels/matmul.h"
#include "core/matmul_precision.h"
#include "core/parallel.h"
#include "core/rng.h"

/// Products as layers, their gradients and convolutions use them, relative to what the machine can
/// do at best, and next to what other libraries take for the same product in the same run.
namespace stymo::test {
namespace {

using kernels::PackedMatrix;

class Table {
public:
    explicit Table(const Arguments& arguments)
        : arguments_(arguments), peak_(kernels::measure_machine_peak()) {
        std::printf(
            "{\"threads\": %d, \"repeats\": %d, \"peak_gflops\": %.1f, \"peak_bfloat16_gflops\": "
            "%.1f,\n \"products\": [",
            thread_count(), arguments.repeats, 1e-9 * peak_.multiply_adds,
            1e-9 * peak_.bfloat16_multiply_adds);
    }

    /// The same product by another library; `times` is how much longer it takes.
    struct Other {
        std::string name;
        std::function<void()> function;
    };

    /// `multiply_adds`: of one call. Relative to float32. All functions are timed by turns.
    template <class Function>
    void row(const std::string& name, double multiply_adds, Function function,
             const std::vector<Other>& others = {}) {
        if (name.find(arguments_.filter) == std::string::npos) return;
        std::vector<std::function<void()>> functions{function};
        for (const Other& other : others) functions.push_back(other.function);
        const std::vector<double> seconds = median_seconds(arguments_.repeats, functions);
        const double own = seconds.front();
        const double rate = 2.0 * multiply_adds / own;
        std::printf("%s\n  {\"name\": \"%s\", \"ms\": %.4f, \"gflops\": %.1f, \"of_peak\": %.3f",
                    separator_, name.c_str(), 1e3 * own, 1e-9 * rate, rate / peak_.multiply_adds);
        for (std::size_t k = 0; k < others.size(); ++k) {
            const double other = seconds[k + 1];
            std::printf(", \"%s\": {\"ms\": %.4f, \"times\": %.2f}", others[k].name.c_str(),
                        1e3 * other, other / own);
        }
        std::printf("}");
        std::fflush(stdout);
        separator_ = ",";
    }

    void close() const { std::printf("\n]}\n"); }

private:
    Arguments arguments_;
    kernels::MachinePeak peak_;
    const char* separator_ = "";
};

constexpr std::int64_t points = 65536;
constexpr std::int64_t width = 256;
constexpr std::int64_t tile = 384;

Tensor draw(const Shape& shape) {
    Rng rng(1);
    return rng.uniform(shape, -0.1, 0.1, DType::float32);
}

/// One layer from memory to memory, and eight of them on tiles that stay in the second-level cache.
void bench_layers(Table& table, MatmulPrecision precision) {
    const PrecisionScope of_products(precision);
    const std::string type = name_of(precision);
    const Tensor weight = draw({width, width});
    const Tensor bias = draw({width});
    const Tensor inputs = draw({points, width});
    const std::span<const float> x = inputs.values<float>();
    std::vector<float> y(x.size());
    const PackedMatrix<float> packed(weight.values<float>().data(), width, width, 1, width);
    for (const Activation activation :
         {Activation::none, Activation::sine, Activation::leaky_relu}) {
        const char* const name = activation == Activation::none   ? ""
                                 : activation == Activation::sine ? " sine"
                                                                  : " leaky ReLU";
        const kernels::Epilogue<float> epilogue{.bias = bias.values<float>().data(),
                                                .activation = activation};
        const auto layer = [&](float* to, const float* from, std::int64_t rows) {
            kernels::multiply_packed(to, width, kernels::LeftMatrix<float>{from, width}, rows,
                                     packed, epilogue);
        };
        table.row(type + " 65536x256x256" + name, double(points * width * width), [&] {
            parallel_for(points, tile, [&](std::int64_t begin, std::int64_t end) {
                layer(y.data() + begin * width, x.data() + begin * width, end - begin);
            });
        });
        // The same work on tiles that never leave the cache: eight layers there and back, or one
        // tile again and again.
        const std::int64_t share = chunk_count(points, thread_count());
        std::vector<float> buffers(static_cast<std::size_t>(thread_count() * tile * width));
        const auto by_tiles = [&](auto body) {
            parallel_for(points, share, [&](std::int64_t begin, std::int64_t end) {
                float* const buffer = buffers.data() + begin / share * tile * width;
                for (std::int64_t first = begin; first < end; first += tile)
                    body(buffer, y.data() + first * width, x.data() + first * width,
                         std::min(tile, end - first));
            });
        };
        table.row(type + " 65536x256x256 eight layers by tiles" + name,
                  8.0 * double(points * width * width), [&] {
                      by_tiles([&](float* buffer, float* to, const float* from, std::int64_t rows) {
                          layer(buffer, from, rows);
                          for (int i = 0; i < 3; ++i) {
                              layer(to, buffer, rows);
                              layer(buffer, to, rows);
                          }
                          layer(to, buffer, rows);
                      });
                  });
        table.row(type + " 65536x256x256 one tile again" + name, double(points * width * width),
                  [&] {
                      by_tiles([&](float* buffer, float*, const float*, std::int64_t rows) {
                          layer(buffer, x.data(), rows);
                      });
                  });
    }
}

struct MatmulShape {
    const char* use;
    std::int64_t batch, m, k, n;
    MatmulOptions options;
};

/// As training, fitting and the discriminator call them.
void bench_matmul(Table& table) {
    constexpr MatmulOptions plain{};
    constexpr MatmulOptions transposed_left{.transpose_a = true};
    constexpr MatmulOptions transposed_right{.transpose_b = true};
    for (const MatmulShape& s :
         {MatmulShape{"layer", 1, points, 256, 256, transposed_right},
          MatmulShape{"gradient of a layer's input", 1, points, 256, 256, plain},
          MatmulShape{"gradient of its weight", 1, 256, points, 256, transposed_left},
          MatmulShape{"first layer", 1, points, 63, 256, transposed_right},
          MatmulShape{"density", 1, points, 256, 1, transposed_right},
          MatmulShape{"gradient of its input", 1, points, 1, 256, plain},
          MatmulShape{"gradient of its weight", 1, 1, points, 256, transposed_left},
          MatmulShape{"colour", 1, 262144, 32, 3, transposed_right},
          MatmulShape{"gradient of its input", 1, 262144, 3, 32, plain},
          MatmulShape{"gradient of its weight", 1, 3, 262144, 32, transposed_left},
          MatmulShape{"block of 64 channels", 1, 65536, 64, 64, transposed_right},
          MatmulShape{"gradient of its weight", 1, 64, 65536, 64, transposed_left},
          MatmulShape{"modulated, four images", 4, 16384, 128, 64, transposed_right},
          MatmulShape{"gradient of its weight", 4, 64, 16384, 128, transposed_left},
          MatmulShape{"style, one code", 1, 1, 256, 512, transposed_right},
          MatmulShape{"style, four codes", 1, 4, 256, 512, transposed_right},
          MatmulShape{"gradient of its weight", 1, 512, 4, 256, transposed_left},
          MatmulShape{"gradient of its input", 1, 4, 512, 256, plain},
          MatmulShape{"last layer of an encoder", 1, 4, 25088, 512, transposed_right},
          MatmulShape{"gradient of its input", 1, 4, 512, 25088, plain},
          MatmulShape{"many small", 1024, 16, 16, 16, plain},
          MatmulShape{"square", 1, 512, 512, 512, plain},
          MatmulShape{"square", 1, 1024, 1024, 1024, plain}}) {
        const Tensor a =
            draw(s.options.transpose_a ? Shape{s.batch, s.k, s.m} : Shape{s.batch, s.m, s.k});
        const Tensor b =
            draw(s.options.transpose_b ? Shape{s.batch, s.n, s.k} : Shape{s.batch, s.k, s.n});
        const std::string name = std::string("matmul ") + std::to_string(s.batch) + "x" +
                                 std::to_string(s.m) + "x" + std::to_string(s.k) + "x" +
                                 std::to_string(s.n) + " " + s.use;
        std::vector<Table::Other> others{{"medium", [&a, &b, &s] {
                                              const PrecisionScope lowered(MatmulPrecision::medium);
                                              static_cast<void>(kernels::matmul(a, b, s.options));
                                          }}};
        for (const GemmLibrary& library : gemm_libraries(thread_count())) {
            if (library.multiply(a, b, s.options).defined())
                others.push_back({library.name, [&a, &b, &s, library] {
                                      static_cast<void>(library.multiply(a, b, s.options));
                                  }});
        }
        table.row(
            name, double(s.batch * s.m * s.k * s.n),
            [&] { static_cast<void>(kernels::matmul(a, b, s.options)); }, others);
    }
}

void run(const Arguments& arguments) {
    set_thread_count(arguments.threads);
    Table table(arguments);
    for (const MatmulPrecision precision : {MatmulPrecision::highest, MatmulPrecision::medium})
        bench_layers(table, precision);
    bench_matmul(table);
    table.close();
}

}  // namespace
}  // namespace stymo::test

int main(int argument_count, char** arguments) {
    return stymo::test::run_program("bench_gemm", argument_count, arguments, stymo::test::run);
}
