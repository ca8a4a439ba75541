#include <algorithm>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <ctime>
#include <string>
#include <string_view>
#include <vector>

#include "apps/common/process_setup.h"
#include "core/autograd/grad.h"
#include "core/error.h"
#include "core/ops/ops.h"
#include "core/parallel.h"
#include "core/rng.h"
#include "nn/losses.h"
#include "nn/models/discriminator.h"
#include "nn/optim/adam.h"
#include "nn/pretrained/perceptual/lpips.h"

/// Times the convolutional networks on random weights and images: bench_networks [vgg|disc|r1]
/// [threads] [repeats].
namespace stymo::test {
namespace {

template <class Function>
void report(const char* name, int repeats, Function function) {
    function();
    std::vector<double> times;
    const std::clock_t before = std::clock();
    for (int i = 0; i < repeats; ++i) {
        const auto start = std::chrono::steady_clock::now();
        function();
        times.push_back(
            std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - start)
                .count());
    }
    const double processor =
        1e3 * static_cast<double>(std::clock() - before) / CLOCKS_PER_SEC / repeats;
    std::ranges::sort(times);
    std::printf("%s: %.1f ms (%.1f to %.1f), %d threads, processor time %.1f ms\n", name,
                times[times.size() / 2], times.front(), times.back(), thread_count(), processor);
    std::fflush(stdout);
}

/// LPIPS of an image and its gradient, with the target's features at hand, as a step of the fitter
/// takes them.
void vgg(int repeats) {
    LpipsConfig config;
    config.network = "vgg16";
    config.trunk = "random";
    config.heads = "random";
    const Lpips lpips(config, "");
    Rng rng(1);
    const Lpips::Features target = lpips.features(rng.uniform({1, 512, 512, 3}, -1.0, 1.0));
    const Tensor image = rng.uniform({1, 512, 512, 3}, -1.0, 1.0);
    report("VGG-16 features at 512", repeats, [&] { static_cast<void>(lpips.features(image)); });
    report("VGG-16 features and gradient at 512", repeats, [&] {
        const Variable leaf = Variable::leaf(image);
        static_cast<void>(grad(sum(lpips.distance(lpips.features(leaf), target)), leaf));
    });
}

/// One update at 256x256 with batch 4.
void discriminator(int repeats, bool regularised) {
    ParameterStore store;
    Rng rng(1);
    const Discriminator network({}, 256, store, "discriminator", rng);
    const Tensor images = rng.uniform({4, 256, 256, 3}, -1.0, 1.0);
    Adam adam({.beta1 = 0.0, .beta2 = 0.99});
    report(regularised ? "R1 update at 256, batch 4" : "discriminator update at 256, batch 4",
           repeats, [&] {
               std::vector<Variable> leaves;
               for (const Parameter& parameter : store.all())
                   leaves.push_back(parameter.variable());
               const auto discriminator = [&](const Variable& x) { return network(x); };
               const Variable loss = regularised ? r1_penalty(discriminator, images)
                                                 : real_loss(discriminator(images));
               adam.step(store.all(), grad(loss, leaves), 1e-4);
           });
}

void run(const std::vector<std::string>& words) {
    tune_allocator();
    if (words.empty())
        fail<ValueError>(
            "give vgg, disc or r1, then perhaps the numbers of threads and of repeats");
    set_thread_count(words.size() > 1 ? std::atoi(words[1].c_str()) : 0);
    const int repeats = words.size() > 2 ? std::max(1, std::atoi(words[2].c_str())) : 3;
    if (words[0] == "vgg") return vgg(repeats);
    if (words[0] == "disc" || words[0] == "r1") return discriminator(repeats, words[0] == "r1");
    fail<ValueError>("unknown network ", words[0]);
}

}  // namespace
}  // namespace stymo::test

int main(int argument_count, char** arguments) {
    try {
        stymo::test::run({arguments + 1, arguments + argument_count});
        return 0;
    } catch (const std::exception& error) {
        std::fprintf(stderr, "bench_networks: %s\n", error.what());
        return 1;
    }
}
