#include <algorithm>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <string>
#include <string_view>
#include <vector>

#include "core/autograd/grad.h"
#include "core/error.h"
#include "core/op_cases.h"
#include "core/parallel.h"

/// Times each row of the table of ops in float32: the op alone, and the op with the gradients of
/// all inputs.
namespace stymo::test {
namespace {

struct Arguments {
    std::string filter;
    int threads = 0;
    int repeats = 9;
};

Arguments parse(const std::vector<std::string_view>& words) {
    Arguments arguments;
    for (std::size_t i = 0; i < words.size(); i += 2) {
        if (i + 1 == words.size()) fail<ValueError>(words[i], " needs a value");
        const std::string value(words[i + 1]);
        if (words[i] == "--filter") {
            arguments.filter = value;
        } else if (words[i] == "--threads") {
            arguments.threads = std::atoi(value.c_str());
        } else if (words[i] == "--repeats") {
            arguments.repeats = std::max(1, std::atoi(value.c_str()));
        } else {
            fail<ValueError>("unknown option ", words[i],
                             "; there are --filter TEXT, --threads N, --repeats N");
        }
    }
    return arguments;
}

template <class Function>
double median_milliseconds(int repeats, Function function) {
    function();
    std::vector<double> times;
    for (int i = 0; i < repeats; ++i) {
        const auto start = std::chrono::steady_clock::now();
        function();
        times.push_back(
            std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - start)
                .count());
    }
    std::ranges::nth_element(times, times.begin() + static_cast<std::ptrdiff_t>(times.size() / 2));
    return times[times.size() / 2];
}

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
        const double forward = median_milliseconds(
            arguments.repeats, [&] { static_cast<void>(row.function(constants)); });
        const double both = median_milliseconds(arguments.repeats, [&] {
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
    try {
        stymo::test::run(stymo::test::parse({arguments + 1, arguments + argument_count}));
        return 0;
    } catch (const std::exception& error) {
        std::fprintf(stderr, "bench_ops: %s\n", error.what());
        return 1;
    }
}
