#include <catch2/catch.hpp>

#include "core/rng.h"
#include "train/stage.h"

using namespace stymo;

TEST_CASE("the mean of any number of micro-batches keeps the precision of float32") {
    for (const std::size_t count :
         {std::size_t{1}, std::size_t{8}, std::size_t{64}, std::size_t{100000}}) {
        GradientMean mean(count);
        const Tensor gradient = Rng(1).uniform({4}, 0.5, 1.5);
        for (std::size_t i = 0; i < count; ++i) mean.add({gradient});
        INFO(count << " micro-batches");
        for (std::size_t i = 0; i < 4; ++i)
            CHECK(mean.gradients().front().value().to_vector()[i] ==
                  Approx(gradient.to_vector()[i]).epsilon(2e-6));
    }
}
