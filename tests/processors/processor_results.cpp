// What ops, the renderer and a training step compute on this processor, and how far that is from
// float64 and from other processors (tests/tools/other_processors.sh):
//     processor_results make MODEL CONFIGURATION FACES FILE.safetensors
//     processor_results reference MODEL CONFIGURATION FACES FILE.safetensors
//     processor_results compare REFERENCE NAME=FILE...
// A result "image.skip" is compared with the reference's "image", computed in float64 by the ops.
#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <iomanip>
#include <iostream>
#include <map>
#include <sstream>
#include <string>
#include <vector>

#include "apps/common/process_setup.h"
#include "core/error.h"
#include "core/io/tensor_file.h"
#include "core/matmul_precision.h"
#include "core/ops/ops.h"
#include "nn/realtime/face_renderer.h"
#include "nn/realtime/view.h"
#include "train/data/dataset.h"
#include "train/step_gradients.h"
#include "train/schedule.h"

using namespace stymo;

namespace {

using Results = std::map<std::string, Tensor>;

struct Inputs {
    Model model;
    TrainConfig config;
    FaceBatch batch;
};

/// In [-1, 1), of the precision of float32: the same bits on every processor.
Variable numbers(const Shape& shape, std::uint64_t seed, DType dtype) {
    return Variable(Rng(seed).uniform(shape, -1.0, 1.0).to(dtype));
}

void add_ops(Results& results, DType dtype) {
    const Variable x = numbers({64, 96}, 1, dtype), image = numbers({2, 24, 24, 16}, 2, dtype);
    const std::map<std::string, Variable> ops{
        {"multiply and add", x * x + x},
        {"sum", sum(x, {0})},
        {"exp", exp(x)},
        {"sin", sin(x)},
        {"resample", resample(image, bilinear_matrix(37, 24), bilinear_matrix(37, 24))},
        {"matmul", matmul(x, numbers({96, 80}, 3, dtype))},
        {"sine layer", linear(numbers({1, 64, 96}, 1, dtype), numbers({1, 80, 96}, 4, dtype), {},
                              Activation::sine)},
        {"conv2d", conv2d(image, numbers({32, 3, 3, 16}, 5, dtype), {.padding = 1})},
    };
    for (const auto& [name, value] : ops) results[name] = value.value();
}

Codes mean_face(const Model& model) {
    return split_codes(Variable(model.code_statistics()->mean().reshaped({1, code_size})));
}

Camera turned_camera(const Model& model) {
    return model_camera(model, 0.3, 0.1, 0.0);
}

void add_images(Results& results, const Model& model) {
    using enum RenderMode;
    const std::map<std::string, RenderMode> modes{{"exact", exact}, {"skip", skip}};
    for (const auto& [name, mode] : modes) {
        // So small a tolerance leaves out hardly a sample that matters.
        FaceRenderer renderer(model, {.mode = mode, .tolerance = 1e-3});
        renderer.show(mean_face(model));
        results["image." + name] = renderer.render(turned_camera(model)).image;
    }
}

/// Loss and gradients of all weights in the first step.
void add_step(Results& results, const Inputs& inputs, const std::string& suffix) {
    const ReconstructionLoss loss(inputs.config.model.reconstruction);
    const std::vector<Parameter> parameters = inputs.model.parameters().trainable();
    Rng jitter(1);
    const LossAndGradients step = generator_gradients({inputs.model, loss, inputs.config},
                                                      TrainingSchedule(inputs.config).position(0),
                                                      inputs.batch, parameters, jitter);
    std::vector<double> all;
    for (const Variable& gradient : step.gradients)
        for (const double x : gradient.value().to_vector()) all.push_back(x);
    const auto count = static_cast<std::int64_t>(all.size());
    const DType dtype = inputs.batch.input.dtype();
    results["loss" + suffix] = Tensor::scalar(step.losses.total, DType::float64);
    results["gradient" + suffix] = Tensor::from({count}, std::span<const double>(all)).to(dtype);
}

Inputs load(const std::vector<std::string>& arguments) {
    Model model = Model::load(arguments.at(1));
    model.parameters().set_trainable("", true);
    TrainConfig config = load_train_config(
        arguments[2], {"reconstruction.perceptual_weight=0", "optimizer.sample_tolerance=0"});
    const Dataset faces(arguments.at(3), config.model.decoder.resolution, config.data, Split::all);
    FaceBatch batch = make_batch(std::array{faces.load(0), faces.load(1)});
    return {std::move(model), std::move(config), std::move(batch)};
}

Results computed_here(const Inputs& inputs) {
    Results results;
    add_ops(results, DType::float32);
    add_images(results, inputs.model);
    add_step(results, inputs, "");
    set_matmul_precision(MatmulPrecision::medium);
    add_step(results, inputs, ".medium");
    return results;
}

Results reference(Inputs inputs) {
    Results results;
    add_ops(results, DType::float64);
    inputs.model.parameters().convert(DType::float64);
    FaceBatch& batch = inputs.batch;
    std::vector<Tensor*> tensors{&batch.input, &batch.mask, &batch.ray_mask, &batch.code_present};
    for (Tensor& target : batch.targets) tensors.push_back(&target);
    for (Tensor& codes : batch.codes) tensors.push_back(&codes);
    for (Tensor* tensor : tensors)
        if (tensor->defined()) *tensor = tensor->to(DType::float64);
    Codes codes = mean_face(inputs.model);
    for (Variable& group : codes.groups) group = Variable(group.value().to(DType::float64));
    results["image"] = decoded_view(inputs.model, codes, 0, turned_camera(inputs.model), {}).image;
    add_step(results, inputs, "");
    return results;
}

/// The largest difference as a share of the largest element of the reference.
double largest_difference(const Tensor& a, const Tensor& b) {
    const std::vector<double> left = a.to_vector(), right = b.to_vector();
    if (left.size() != right.size()) fail<ShapeError>("results of different sizes");
    double difference = 0.0, size = 0.0;
    for (std::size_t i = 0; i < left.size(); ++i) {
        difference = std::max(difference, std::abs(left[i] - right[i]));
        size = std::max(size, std::abs(right[i]));
    }
    return difference / size;
}

/// A table with a row for each result and a column for each file. Equal letters in a row mean equal
/// bits.
void compare(const std::vector<std::string>& arguments) {
    const Results reference = read_tensor_file(arguments.at(1)).tensors;
    std::vector<Results> files;
    std::cout << "| result |";
    for (std::size_t i = 2; i < arguments.size(); ++i) {
        const std::size_t equal = arguments[i].find('=');
        if (equal == std::string::npos) fail<ValueError>("expected NAME=FILE: ", arguments[i]);
        std::cout << " " << arguments[i].substr(0, equal) << " |";
        files.push_back(read_tensor_file(arguments[i].substr(equal + 1)).tensors);
    }
    std::cout << "\n|---|";
    for (std::size_t i = 0; i < files.size(); ++i) std::cout << "---|";
    std::cout << "\n";
    for (const auto& [name, unused] : files.at(0)) {
        const Tensor& exact = reference.at(name.substr(0, name.find('.')));
        std::vector<std::vector<double>> kinds;
        std::cout << "| " << name << " |";
        for (const Results& results : files) {
            const std::vector<double> values = results.at(name).to_vector();
            const auto kind = std::ranges::find(kinds, values) - kinds.begin();
            if (kind == std::ssize(kinds)) kinds.push_back(values);
            std::cout << " " << std::scientific << std::setprecision(1)
                      << largest_difference(results.at(name), exact) << " "
                      << static_cast<char>('a' + kind) << " |";
        }
        std::cout << "\n";
    }
}

void run(const std::vector<std::string>& arguments) {
    const std::string command = arguments.empty() ? "" : arguments[0];
    if (command == "compare" && arguments.size() > 2) return compare(arguments);
    if ((command != "make" && command != "reference") || arguments.size() != 5)
        fail<ValueError>("see the head of tests/processors/processor_results.cpp");
    flush_subnormals();
    Inputs inputs = load(arguments);
    const Results results =
        command == "make" ? computed_here(inputs) : reference(std::move(inputs));
    write_tensor_file(arguments[4], {results, {}});
}

}  // namespace

int main(int argc, char** argv) {
    try {
        run({argv + 1, argv + argc});
        return 0;
    } catch (const std::exception& error) {
        std::cerr << "processor_results: " << error.what() << "\n";
        return 1;
    }
}
