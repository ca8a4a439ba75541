#include <catch2/catch.hpp>
#include <cmath>
#include <filesystem>
#include <limits>

#include "core/error.h"
#include "core/io/tensor_file.h"
#include "nn/optim/adam.h"
#include "nn/optim/ema.h"

using namespace stymo;

namespace {

TensorFile pytorch_values() {
    return read_tensor_file(std::filesystem::path(STYMO_SOURCE_DIR) /
                            "tests/golden/nn_vectors.safetensors");
}

Tensor row(const Tensor& table, std::int64_t index) {
    const auto columns = static_cast<std::size_t>(table.shape(1));
    return Tensor::from({table.shape(1)}, table.values<double>().subspan(
                                              static_cast<std::size_t>(index) * columns, columns));
}

/// Steps from `begin` to `end` along a fixed sequence of gradients.
void run(Adam& adam, const ParameterStore& store, int begin, int end) {
    for (int step = begin; step < end; ++step) {
        std::vector<Variable> gradients;
        for (const Parameter& parameter : store.all()) {
            Tensor gradient(parameter.variable().shape());
            for (float& value : gradient.mutable_values<float>())
                value = std::sin(static_cast<float>(step) + 1.0F);
            gradients.emplace_back(gradient);
        }
        adam.step(store.all(), gradients, 0.01);
    }
}

ParameterStore two_parameters() {
    ParameterStore store;
    store.create("a", Tensor::full({3}, 1.0));
    store.create("b", Tensor::full({2, 2}, -1.0));
    return store;
}

}  // namespace

TEST_CASE("Adam takes PyTorch's steps") {
    const TensorFile file = pytorch_values();
    for (const auto& [name, options] :
         {std::pair{"adam", AdamOptions{}}, std::pair{"adam_gan", AdamOptions{0.0, 0.99, 1e-8}}}) {
        for (const DType dtype : {DType::float64, DType::float32}) {
            ParameterStore store;
            const Parameter parameter =
                store.create("x", file.tensors.at(std::string(name) + ".start").to(dtype));
            Adam adam(options);
            const Tensor& gradients = file.tensors.at(std::string(name) + ".gradients");
            for (std::int64_t step = 0; step < gradients.shape(0); ++step) {
                const std::vector<Variable> gradient{row(gradients, step).to(dtype)};
                adam.step(store.all(), gradient, 0.01);
                const auto expected =
                    row(file.tensors.at(std::string(name) + ".values"), step).to_vector();
                const auto actual = parameter.variable().value().to_vector();
                for (std::size_t i = 0; i < expected.size(); ++i)
                    CHECK(std::abs(actual[i] - expected[i]) <
                          (dtype == DType::float64 ? 1e-14 : 1e-6));
            }
        }
    }
}

TEST_CASE("Adam goes on bit for bit from what it saved") {
    ParameterStore uninterrupted = two_parameters(), resumed = two_parameters();
    Adam one, two, three;
    run(one, uninterrupted, 0, 7);
    run(two, resumed, 0, 3);
    TensorFile file;
    two.save(file, "optimizer.");
    run(two, resumed, 3, 4);  // must not reach into what was saved
    resumed.all()[0].set_value(Tensor::full({3}, 1.0));
    resumed.all()[1].set_value(Tensor::full({2, 2}, -1.0));
    Adam replay;
    run(replay, resumed, 0, 3);
    three.load(file, "memory", "optimizer.");
    run(three, resumed, 3, 7);
    for (std::size_t i = 0; i < 2; ++i)
        CHECK(resumed.all()[i].variable().value().to_vector() ==
              uninterrupted.all()[i].variable().value().to_vector());
    CHECK(resumed.all()[0].trainable());

    file.tensors.erase("optimizer.b.second");
    CHECK_THROWS_WITH(three.load(file, "state.safetensors", "optimizer."),
                      Catch::Contains("state.safetensors") && Catch::Contains("b"));
}

TEST_CASE("Adam refuses gradients that do not fit") {
    const ParameterStore store = two_parameters();
    Adam adam;
    const std::vector<Variable> wrong{Tensor::zeros({3}), Tensor::zeros({4})};
    CHECK_THROWS_WITH(adam.step(store.all(), wrong, 0.1), Catch::Contains("gradient of b"));
    CHECK_THROWS_AS(adam.step(store.all(), std::span(wrong).first(1), 0.1), ValueError);
}

TEST_CASE("Adam changes nothing if one of the gradients does not fit") {
    const ParameterStore store = two_parameters();
    const std::vector<double> before = store.all()[0].variable().value().to_vector();
    Adam adam;
    const std::vector<Variable> other_shape{Tensor::full({3}, 1.0), Tensor::zeros({4})};
    const std::vector<Variable> other_type{Tensor::full({3}, 1.0),
                                           Tensor::zeros({2, 2}, DType::float64)};
    CHECK_THROWS_AS(adam.step(store.all(), other_shape, 0.1), ShapeError);
    CHECK_THROWS_AS(adam.step(store.all(), other_type, 0.1), TypeError);
    CHECK(store.all()[0].variable().value().to_vector() == before);
    TensorFile state;
    adam.save(state, "");
    CHECK(state.tensors.empty());
}

TEST_CASE("Adam reads no state whose number of steps is none") {
    TensorFile state;
    const ParameterStore store = two_parameters();
    Adam adam;
    adam.step(store.all(), std::vector<Variable>{Tensor::full({3}, 1.0), Tensor::full({2, 2}, 1.0)},
              0.1);
    adam.save(state, "");
    const std::string steps = store.all()[0].name() + ".steps";
    for (const double wrong : {-1.0, 0.5, 1e300, std::numeric_limits<double>::quiet_NaN()}) {
        state.tensors.insert_or_assign(steps, Tensor::full({1}, wrong, DType::float64));
        CHECK_THROWS_AS(adam.load(state, "state", ""), FileError);
    }
}

TEST_CASE("Adam refuses a gradient that is not finite by its name, and nothing has changed") {
    const ParameterStore store = two_parameters();
    const std::vector<double> before = store.all()[0].variable().value().to_vector();
    Adam adam;
    for (const double wrong :
         {std::numeric_limits<double>::infinity(), std::numeric_limits<double>::quiet_NaN()}) {
        const std::vector<Variable> gradients{Tensor::full({3}, 1.0), Tensor::full({2, 2}, wrong)};
        CHECK_THROWS_AS(adam.step(store.all(), gradients, 0.1), NumericError);
        CHECK_THROWS_WITH(adam.step(store.all(), gradients, 0.1), Catch::Contains("gradient of b"));
    }
    CHECK(store.all()[0].variable().value().to_vector() == before);
    TensorFile state;
    adam.save(state, "");
    CHECK(state.tensors.empty());
}

TEST_CASE(
    "a gradient whose square float32 does not hold moves a parameter by the learning rate, and "
    "does not stop it for good") {
    ParameterStore store;
    const Parameter x = store.create("x", Tensor::zeros({1}));
    Adam adam({.beta1 = 0.5, .beta2 = 0.5});
    adam.step(store.all(), std::vector<Variable>{Tensor::full({1}, 1e30)}, 0.125);
    CHECK(x.variable().value().item() == Approx(-0.125).epsilon(1e-6));
    for (int step = 0; step < 300; ++step)
        adam.step(store.all(), std::vector<Variable>{Tensor::full({1}, -1.0)}, 0.125);
    CHECK(x.variable().value().item() > 10.0);
}

TEST_CASE("the first gradient that is not finite is named") {
    const ParameterStore store = two_parameters();
    std::vector<Variable> gradients{Tensor::zeros({3}), Tensor::zeros({2, 2})};
    CHECK_FALSE(first_non_finite(store.all(), gradients).has_value());
    gradients[1] = Tensor::full({2, 2}, std::numeric_limits<double>::infinity());
    CHECK(first_non_finite(store.all(), gradients) == "b");
}

TEST_CASE("an average follows its closed form, and swaps with the model and back") {
    ParameterStore store = two_parameters();
    Ema ema(store.all());
    store.all()[0].set_value(Tensor::full({3}, 5.0));
    for (int i = 0; i < 4; ++i) ema.update(0.9);
    ema.swap();
    CHECK(store.all()[0].variable().value().values<float>()[1] ==
          Approx(5.0 - 4.0 * std::pow(0.9, 4)));
    CHECK(store.all()[0].trainable());
    TensorFile file;
    ema.swap();
    CHECK(store.all()[0].variable().value().values<float>()[1] == 5.0F);
    ema.save(file, "ema.");
    CHECK(file.tensors.at("ema.a").values<float>()[1] == Approx(5.0 - 4.0 * std::pow(0.9, 4)));
    Ema other(two_parameters().all());
    other.load(file, "memory", "ema.");
    file.tensors.erase("ema.b");
    CHECK_THROWS_WITH(other.load(file, "state.safetensors", "ema."),
                      "state.safetensors: has no tensor ema.b");
}

TEST_CASE("the EMA of the weights forgets at the rate of StyleGAN2") {
    CHECK(ema_decay(32, 10000.0) == Approx(0.99778).epsilon(1e-5));
    CHECK(ema_decay(12, 10000.0) == Approx(0.99917).epsilon(1e-5));
    CHECK(ema_decay(32, 0.0) == 0.0);
}
