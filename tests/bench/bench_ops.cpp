#include <cstdio>
#include <functional>
#include <vector>

#include "bench/arguments.h"
#include "core/autograd/grad.h"
#include "core/op_cases.h"
#include "core/parallel.h"

/// Times each row of the table of ops in float32: the op alone, and the op with the gradients of
/// all inputs.
namespace stymo::test {
namespace {

void run(const Arguments& arguments) {
    set_thread_count(arguments.threads);
    std::printf("{\"threads\": %d, \"repeats\": %d, \"ops\": [", thread_count(), arguments.repeats);
    const char* separator = "\n";
    for (const OpCase& row : op_cases()) {
        if (row.speed_shapes.empty() || row.name().find(arguments.filter) == std::string::npos)
            continue;
        const std::vector<Tensor> inputs = draw_speed_inputs(row, DType::float32, 1);
        const std::vector<Variable> constants = as_constants(inputs);
        const std::vector<Variable> leaves = as_leaves(inputs);
        const Variable dL_dy = Tensor::full(row.function(constants).shape(), 1.0);
        const auto median_milliseconds = [&](const std::function<void()>& function) {
            return 1e3 * median_seconds(arguments.repeats, {function}).front();
        };
        const double forward =
            median_milliseconds([&] { static_cast<void>(row.function(constants)); });
        const double both = median_milliseconds([&] {
            static_cast<void>(
                grad(row.function(leaves), leaves, {.create_graph = false, .dL_dy = dL_dy}));
        });
        std::printf(
            "%s  {\"name\": \"%s\", \"forward_ms\": %.4f, \"forward_and_gradients_ms\": %.4f}",
            separator, row.name().c_str(), forward, both);
        std::fflush(stdout);
        separator = ",\n";
    }
    std::printf("\n]}\n");
}

}  // namespace
}  // namespace stymo::test

int main(int argument_count, char** arguments) {
    return stymo::test::run_program("bench_ops", argument_count, arguments, stymo::test::run);
}
