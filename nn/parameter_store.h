#pragma once

#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "core/autograd/variable.h"
#include "core/io/tensor_file.h"

namespace stymo {

/// A handle to one named value of a ParameterStore. Layers hold handles; the store's owner changes
/// the values.
class Parameter {
public:
    Parameter() = default;

    [[nodiscard]] const std::string& name() const { return slot_->name; }
    /// The current value: a leaf while trainable, a constant while frozen.
    [[nodiscard]] const Variable& variable() const { return slot_->variable; }
    [[nodiscard]] bool trainable() const { return slot_->variable.tracked(); }
    [[nodiscard]] bool defined() const { return slot_ != nullptr; }
    /// Replaces the value, keeping trainability. Throws ShapeError or TypeError, which names the
    /// parameter, for another shape or type.
    void set_value(Tensor value) const;

private:
    friend class ParameterStore;
    struct Slot {
        std::string name;
        Variable variable;
    };
    explicit Parameter(std::shared_ptr<Slot> slot) : slot_(std::move(slot)) {}
    std::shared_ptr<Slot> slot_;
};

/// The current values of parameters, to take gradients with respect to them.
[[nodiscard]] std::vector<Variable> variables_of(const std::vector<Parameter>& parameters);

/// Owns every weight of a model, in order of creation, under dotted names
/// ("decoder.field.layer3.weight").
class ParameterStore {
public:
    ParameterStore() = default;
    /// A store for the parameters of this file, which must outlive all calls of `create`. `create`
    /// throws FileError, like `load`, for a parameter that the file does not have. A small file
    /// whose configuration describes a large network is thus rejected at its first layer, before
    /// memory for the whole network is allocated.
    ParameterStore(const TensorFile& file, std::string source);

    /// Creates a trainable parameter. Throws ValueError if the name is taken.
    Parameter create(std::string name, Tensor value);
    /// Creates a value that is saved and loaded but never trained (batch norm statistics).
    Parameter create_constant(std::string name, Tensor value);

    [[nodiscard]] const std::vector<Parameter>& all() const { return parameters_; }
    [[nodiscard]] std::vector<Parameter> trainable() const;
    /// Number of elements of all parameters whose name begins with `prefix`.
    [[nodiscard]] std::int64_t element_count(std::string_view prefix = "") const;

    /// Freezes or unfreezes the parameters whose name begins with `prefix`; constants stay
    /// constants.
    void set_trainable(std::string_view prefix, bool trainable);
    /// Converts every value, for example to run the same model in float64.
    void convert(DType dtype);

    /// Sets each parameter whose name begins with `prefix` from the tensor of that name. Throws
    /// FileError, which names `source` and the first tensor that is missing, has another shape
    /// (with both shapes) or is not finite.
    void load(const TensorFile& file, const std::string& source, std::string_view prefix = "");
    /// Adds every parameter whose name begins with `prefix`.
    void save(TensorFile& file, std::string_view prefix = "") const;

private:
    const TensorFile* file_ = nullptr;
    std::string source_;
    std::vector<Parameter> parameters_;
    std::vector<bool> constant_;
};

}  // namespace stymo
