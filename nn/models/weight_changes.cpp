#include "nn/models/weight_changes.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <iterator>
#include <span>
#include <vector>

#include "core/error.h"
#include "core/exact_text.h"
#include "core/io/checksum.h"
#include "core/io/tensor_file.h"
#include "core/ops/elementwise.h"

namespace stymo {

namespace {

constexpr const char* decoder_prefix = "decoder.";
constexpr const char* format_key = "format";
constexpr const char* format_name = "stymo-weight-changes-1";
constexpr const char* model_key = "model";
constexpr const char* identity_key = "identity";

std::string_view bytes_of(const Tensor& tensor) {
    return dispatch(tensor.dtype(), [&]<class T>(T) {
        const std::span<const T> values = tensor.values<T>();
        return std::string_view(reinterpret_cast<const char*>(values.data()), values.size_bytes());
    });
}

std::vector<Parameter> decoder_parameters(const Model& model) {
    std::vector<Parameter> parameters;
    std::ranges::copy_if(
        model.parameters().all(), std::back_inserter(parameters),
        [](const Parameter& parameter) { return parameter.name().starts_with(decoder_prefix); });
    return parameters;
}

std::vector<float> identity_in(const std::string& text, const std::filesystem::path& path) {
    std::vector<float> numbers;
    for (const char *at = text.data(), *const end = at + text.size(); at != end; ++at) {
        const auto [last, error] = std::from_chars(at, end, numbers.emplace_back());
        if (error != std::errc() || last == end || *last != ' ') break;
        at = last;
    }
    if (std::ssize(numbers) != code_sizes[0])
        fail<FileError>(path.string(), ": \"", identity_key, "\" is not the code of a face");
    return numbers;
}

}  // namespace

std::string decoder_fingerprint(const Model& model) {
    std::string sums;
    for (const Parameter& parameter : decoder_parameters(model))
        sums += parameter.name() + ' ' +
                exact_text(crc32c(bytes_of(parameter.variable().value()))) + '\n';
    return hexadecimal(crc32c(sums));
}

WeightChanges WeightChanges::between(const Model& before, const Model& after) {
    const std::vector<Parameter> old_ones = decoder_parameters(before);
    const std::vector<Parameter> new_ones = decoder_parameters(after);
    if (old_ones.size() != new_ones.size())
        fail<ValueError>("changes of weights are between decoders of the same shape");
    WeightChanges changes;
    changes.model_ = decoder_fingerprint(before);
    for (std::size_t i = 0; i < old_ones.size(); ++i) {
        const std::string& name = old_ones[i].name();
        const Variable &from = old_ones[i].variable(), &to = new_ones[i].variable();
        if (name != new_ones[i].name() || !(from.shape() == to.shape()))
            fail<ValueError>("changes of weights are between decoders of the same shape, not ",
                             name, ' ', from.shape(), " and ", new_ones[i].name(), ' ', to.shape());
        if (bytes_of(from.value()) != bytes_of(to.value()))
            changes.differences_.emplace(
                name, as_read_from_float16(name, (Variable(to.value()) - from).value()));
    }
    return changes;
}

WeightChanges WeightChanges::load(const std::filesystem::path& path) {
    TensorFile file = read_tensor_file(path);
    const auto format = file.metadata.find(format_key);
    const auto model = file.metadata.find(model_key);
    if (format == file.metadata.end() || format->second != format_name ||
        model == file.metadata.end())
        fail<FileError>(path.string(),
                        ": not the weight changes of a tuned face (its metadata lack ",
                        "\"format\": \"", format_name, "\" or \"model\")");
    WeightChanges changes;
    changes.model_ = model->second;
    if (const auto identity = file.metadata.find(identity_key); identity != file.metadata.end())
        changes.identity_ = identity_in(identity->second, path);
    changes.differences_ = std::move(file.tensors);
    return changes;
}

void WeightChanges::save(const std::filesystem::path& path) const {
    TensorFile file;
    file.metadata[format_key] = format_name;
    file.metadata[model_key] = model_;
    for (const float number : identity_) file.metadata[identity_key] += exact_text(number) + ' ';
    file.tensors = differences_;
    write_tensor_file(path, file, StoredElements::float16);
}

void WeightChanges::name_face(const Codes& codes) {
    const std::span<const float> rows = codes.identity().value().values<float>();
    identity_.assign(rows.begin(), rows.begin() + code_sizes[0]);
}

bool WeightChanges::are_of(const Codes& codes) const {
    const std::span<const float> other = codes.identity().value().values<float>();
    double difference = 0.0, whole = 0.0;
    for (std::size_t i = 0; i < identity_.size(); ++i) {
        difference += std::pow(double{other[i]} - double{identity_[i]}, 2);
        whole += std::pow(double{identity_[i]}, 2);
    }
    constexpr double largest_share = 0.1;  // of the square; other faces differ by about 1
    return difference <= largest_share * whole;
}

void WeightChanges::apply(Model& model) const {
    const std::string fingerprint = decoder_fingerprint(model);
    if (fingerprint != model_)
        fail<ValueError>("these weight changes were made for another model (", model_, ", not ",
                         fingerprint, "); name the model that the face was tuned with");
    std::size_t applied = 0;
    for (const Parameter& parameter : model.parameters().all()) {
        const auto found = differences_.find(parameter.name());
        if (found == differences_.end()) continue;
        const Tensor& value = parameter.variable().value();
        if (!(found->second.shape() == value.shape()) || !found->second.all_finite())
            fail<ValueError>("the weight changes of ", parameter.name(), " have shape ",
                             found->second.shape(), ", not ", value.shape(), ", or are not finite");
        parameter.set_value((Variable(value) + Variable(found->second.to(value.dtype()))).value());
        ++applied;
    }
    if (applied != differences_.size())
        fail<ValueError>("the weight changes name parameters that the model does not have");
}

Model WeightChanges::applied_to(const Model& model) const {
    Model changed = model.copy(ModelParts::decoder);
    apply(changed);
    return changed;
}

}  // namespace stymo
