#include <catch2/catch.hpp>
#include <optional>

#include "core/autograd/grad.h"
#include "core/ops/ops.h"
#include "core/parallel.h"
#include "core/work_counts.h"

using namespace stymo;

TEST_CASE("a meter counts ops, rules, gradients and buffers, and nothing from before", "[work]") {
    const Variable x = Variable::leaf(Tensor::full({4, 8}, 2.0)),
                   y = Variable::leaf(Tensor::full({4, 8}, 3.0));
    const Variable unreached = Variable::leaf(Tensor::full({1}, 1.0));
    const WorkMeter meter;
    CHECK(meter.counts().operations == 0);
    const Variable z = exp(x) * y;
    CHECK(meter.counts().operations == 2);
    CHECK(meter.counts().buffers == 2);
    CHECK(meter.counts().buffer_bytes == 2 * 4 * 8 * 4);
    CHECK(meter.counts().gradient_rules == 0);

    const Variable total = sum(z);
    const std::vector<Variable> wanted{x, unreached};
    static_cast<void>(grad(total, wanted));
    // Sum, product (for exp(x) alone, since nobody asks for y) and exp.
    CHECK(meter.counts().gradient_rules == 3);
    CHECK(meter.counts().gradients == 1);
    CHECK(meter.counts().parameters == 0);
    CHECK(meter.counts().field_points == 0);
}

TEST_CASE("constants are computed by as many ops, and without rules", "[work]") {
    const Tensor value = Tensor::full({3}, 0.5);
    const WorkMeter meter;
    static_cast<void>(sum(exp(Variable(value))));
    CHECK(meter.counts().operations == 2);
    CHECK(meter.counts().gradient_rules == 0);
}

TEST_CASE("the peak is the most that buffers hold at one time", "[work]") {
    constexpr std::int64_t kibibyte = 1024;
    const auto buffer = [] { return Tensor({kibibyte / 4}); };
    const Tensor before = buffer();
    const WorkMeter outer;
    const std::int64_t at_first = outer.counts().peak_bytes;
    CHECK(at_first >= kibibyte);
    {
        const Tensor a = buffer(), b = buffer();
        const Tensor shared = a;
    }
    CHECK(outer.counts().peak_bytes == at_first + 2 * kibibyte);
    {
        const WorkMeter inner;
        const Tensor c = buffer();
        CHECK(inner.counts().peak_bytes == at_first + kibibyte);
        CHECK(inner.counts().buffers == 1);
    }
    CHECK(outer.counts().peak_bytes == at_first + 2 * kibibyte);
    CHECK(outer.counts().buffers == 3);
    CHECK(outer.counts().buffer_bytes == 3 * kibibyte);
}

TEST_CASE("writing to a shared buffer allocates another, to one's own none", "[work]") {
    Tensor own = Tensor::full({16}, 1.0);
    const Tensor copy = own;
    const WorkMeter meter;
    own.mutable_values<float>()[0] = 2.0F;
    CHECK(meter.counts().buffers == 1);
    own.mutable_values<float>()[0] = 3.0F;
    CHECK(meter.counts().buffers == 1);
}

TEST_CASE("what several threads do is counted in full", "[work]") {
    constexpr std::int64_t count = 1000;
    const WorkMeter meter;
    parallel_for(count, 1, [](std::int64_t begin, std::int64_t end) {
        for (; begin < end; ++begin) {
            const Tensor buffer({2});
            work::count_field_points(3);
        }
    });
    CHECK(meter.counts().buffers == count);
    CHECK(meter.counts().field_points == 3 * count);
}
