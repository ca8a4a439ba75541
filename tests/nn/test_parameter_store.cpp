#include <catch2/catch.hpp>
#include <limits>

#include "core/error.h"
#include "nn/models/codes.h"
#include "nn/parameter_store.h"

using namespace stymo;

namespace {

struct Store {
    ParameterStore store;
    Parameter weight = store.create("a.weight", Tensor::full({2, 3}, 1.0));
    Parameter bias = store.create("b.bias", Tensor::full({3}, 2.0));
    Parameter statistics = store.create_constant("a.mean", Tensor::full({4}, 3.0));
};

}  // namespace

TEST_CASE("a store counts, freezes and unfreezes by prefix, and constants stay constants") {
    Store s;
    CHECK(s.store.element_count() == 13);
    CHECK(s.store.element_count("a.") == 10);
    CHECK(s.store.trainable().size() == 2);
    s.store.set_trainable("a.", false);
    CHECK_FALSE(s.weight.trainable());
    CHECK(s.bias.trainable());
    s.store.set_trainable("", true);
    CHECK(s.weight.trainable());
    CHECK_FALSE(s.statistics.trainable());
}

TEST_CASE("a handle sees the value that replaced its own, with the same trainability") {
    Store s;
    s.weight.set_value(Tensor::full({2, 3}, 7.0));
    CHECK(s.store.all()[0].variable().value().values<float>()[5] == 7.0F);
    CHECK(s.weight.trainable());
    s.statistics.set_value(Tensor::full({4}, 1.0));
    CHECK_FALSE(s.statistics.trainable());
    s.store.convert(DType::float64);
    CHECK(s.weight.variable().value().values<double>()[5] == 7.0);
    CHECK(s.weight.trainable());
    CHECK_THROWS_WITH(s.weight.set_value(Tensor({3, 2}, DType::float64)),
                      Catch::Contains("a.weight"));
    CHECK_THROWS_AS(s.weight.set_value(Tensor({2, 3})), TypeError);
}

TEST_CASE("a name can be taken only once") {
    Store s;
    CHECK_THROWS_WITH(s.store.create("b.bias", Tensor({1})), Catch::Contains("b.bias"));
}

TEST_CASE("what a store saves another one loads") {
    Store from, to;
    from.weight.set_value(Tensor::from({2, 3}, std::vector<float>{1, 2, 3, 4, 5, 6}));
    from.statistics.set_value(Tensor::full({4}, 9.0));
    TensorFile file;
    from.store.save(file);
    to.store.load(file, "memory");
    CHECK(to.weight.variable().value().to_vector() == from.weight.variable().value().to_vector());
    CHECK(to.statistics.variable().value().to_vector() ==
          from.statistics.variable().value().to_vector());
    CHECK(to.weight.trainable());
}

TEST_CASE(
    "a file that does not fit is refused with the tensor's name and leaves the store as it was") {
    Store s;
    TensorFile file;
    file.tensors["a.weight"] = Tensor::full({2, 3}, 5.0);
    file.tensors["a.mean"] = Tensor::full({4}, 5.0);
    CHECK_THROWS_WITH(s.store.load(file, "model.safetensors"),
                      "model.safetensors: has no tensor b.bias");
    file.tensors["b.bias"] = Tensor::full({2}, 5.0);
    CHECK_THROWS_WITH(s.store.load(file, "model.safetensors"),
                      Catch::Contains("b.bias has shape (2), the model needs (3)"));
    CHECK(s.weight.variable().value().values<float>()[0] == 1.0F);
    s.store.load(file, "model.safetensors", "a.");
    CHECK(s.weight.variable().value().values<float>()[0] == 5.0F);
    CHECK(s.bias.variable().value().values<float>()[0] == 2.0F);
}

TEST_CASE("the code's groups add up to 306 numbers, and codes are added group by group") {
    std::int64_t total = 0;
    Codes a, b;
    for (std::size_t i = 0; i < 4; ++i) {
        total += code_sizes[i];
        a.groups[i] = Tensor::full({2, code_sizes[i]}, 1.0);
        b.groups[i] = Tensor::full({2, code_sizes[i]}, static_cast<double>(i));
    }
    CHECK(total == code_size);
    const Codes sum = add(a, b);
    for (std::size_t i = 0; i < 4; ++i)
        CHECK(sum.groups[i].value().values<float>()[3] == static_cast<float>(i + 1));
    CHECK(sum.batch() == 2);
}

TEST_CASE(
    "a file with a value that is not finite is refused by the tensor's name, and nothing has "
    "changed") {
    Store s;
    TensorFile file;
    s.store.save(file);
    file.tensors["a.weight"] = Tensor::full({2, 3}, 5.0);
    file.tensors["b.bias"].mutable_values<float>()[1] = std::numeric_limits<float>::infinity();
    CHECK_THROWS_WITH(
        s.store.load(file, "model.safetensors"),
        Catch::Contains("model.safetensors: b.bias holds values that are not finite"));
    CHECK(s.weight.variable().value().to_vector() == std::vector<double>(6, 1.0));
}
