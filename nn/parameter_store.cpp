#include "nn/parameter_store.h"

#include <algorithm>
#include <utility>

#include "core/error.h"
#include "core/work_counts.h"

namespace stymo {

void Parameter::set_value(Tensor value) const {
    const Tensor& present = slot_->variable.value();
    if (!(value.shape() == present.shape()))
        fail<ShapeError>("parameter ", name(), " has shape ", present.shape(), ", the new value ",
                         value.shape());
    if (value.dtype() != present.dtype())
        fail<TypeError>("parameter ", name(), " is ", present.dtype(), ", the new value ",
                        value.dtype());
    slot_->variable = trainable() ? Variable::leaf(std::move(value)) : Variable(std::move(value));
}

std::vector<Variable> variables_of(const std::vector<Parameter>& parameters) {
    std::vector<Variable> variables;
    for (const Parameter& parameter : parameters) variables.push_back(parameter.variable());
    return variables;
}

namespace {

/// The tensor of this name in the file, or FileError.
const Tensor& stored(const TensorFile& file, const std::string& source, const std::string& name,
                     const Shape& wanted) {
    const auto entry = file.tensors.find(name);
    if (entry == file.tensors.end()) fail<FileError>(source, ": has no tensor ", name);
    if (!(entry->second.shape() == wanted))
        fail<FileError>(source, ": ", name, " has shape ", entry->second.shape(),
                        ", the model needs ", wanted);
    return entry->second;
}

}  // namespace

ParameterStore::ParameterStore(const TensorFile& file, std::string source)
    : file_(&file), source_(std::move(source)) {}

Parameter ParameterStore::create(std::string name, Tensor value) {
    const Parameter parameter = create_constant(std::move(name), std::move(value));
    constant_.back() = false;
    parameter.slot_->variable = Variable::leaf(parameter.variable().value());
    return parameter;
}

Parameter ParameterStore::create_constant(std::string name, Tensor value) {
    if (std::ranges::any_of(parameters_,
                            [&](const Parameter& other) { return other.name() == name; }))
        fail<ValueError>("there is already a parameter ", name);
    if (file_ != nullptr) static_cast<void>(stored(*file_, source_, name, value.shape()));
    work::count_parameter();
    work::count_named("networks", std::string_view(name).substr(0, name.find('.')), value.size());
    parameters_.push_back(Parameter(
        std::make_shared<Parameter::Slot>(Parameter::Slot{std::move(name), std::move(value)})));
    constant_.push_back(true);
    return parameters_.back();
}

std::vector<Parameter> ParameterStore::trainable() const {
    std::vector<Parameter> result;
    std::ranges::copy_if(parameters_, std::back_inserter(result), &Parameter::trainable);
    return result;
}

std::int64_t ParameterStore::element_count(std::string_view prefix) const {
    std::int64_t count = 0;
    for (const Parameter& parameter : parameters_) {
        if (parameter.name().starts_with(prefix)) count += parameter.variable().value().size();
    }
    return count;
}

void ParameterStore::set_trainable(std::string_view prefix, bool trainable) {
    for (std::size_t i = 0; i < parameters_.size(); ++i) {
        const Parameter& parameter = parameters_[i];
        if (constant_[i] || parameter.trainable() == trainable ||
            !parameter.name().starts_with(prefix))
            continue;
        const Tensor& value = parameter.variable().value();
        parameter.slot_->variable = trainable ? Variable::leaf(value) : Variable(value);
    }
}

void ParameterStore::convert(DType dtype) {
    for (const Parameter& parameter : parameters_) {
        Tensor value = parameter.variable().value().to(dtype);
        parameter.slot_->variable =
            parameter.trainable() ? Variable::leaf(std::move(value)) : Variable(std::move(value));
    }
}

void ParameterStore::load(const TensorFile& file, const std::string& source,
                          std::string_view prefix) {
    std::vector<std::pair<Parameter, Tensor>> found;
    for (const Parameter& parameter : parameters_) {
        if (!parameter.name().starts_with(prefix)) continue;
        const Tensor& tensor = stored(file, source, parameter.name(), parameter.variable().shape());
        if (!tensor.all_finite())
            fail<FileError>(source, ": ", parameter.name(), " holds values that are not finite");
        found.emplace_back(parameter, tensor.to(parameter.variable().dtype()));
    }
    // Values are set only after all have been checked, so that a bad file leaves the model
    // unchanged.
    for (auto& [parameter, value] : found) parameter.set_value(std::move(value));
    file_ = nullptr;
}

void ParameterStore::save(TensorFile& file, std::string_view prefix) const {
    for (const Parameter& parameter : parameters_) {
        if (parameter.name().starts_with(prefix))
            file.tensors.insert_or_assign(parameter.name(), parameter.variable().value());
    }
}

}  // namespace stymo
