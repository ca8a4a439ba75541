#include "nn/models/code_file.h"

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>

#include "core/error.h"
#include "core/exact_text.h"
#include "core/io/checksum.h"
#include "core/io/file.h"
#include "core/io/json_check.h"
#include "core/io/json_writer.h"
#include "core/io/tensor_file.h"
#include "render/pose_json.h"

namespace stymo {

namespace {

using Json = nlohmann::json;

// The networks multiply codes in float32.
constexpr double largest_number = 1e30;

const Json& member(const Json& object, const char* key, const std::string& source) {
    if (!object.is_object() || !object.contains(key))
        fail<FileError>(source, ": not a code file (\"", key, "\" is missing)");
    return object.at(key);
}

double number(const Json& value, const char* key, const std::string& source) {
    if (!value.is_number()) fail<FileError>(source, ": \"", key, "\" is not a number");
    const auto result = value.get<double>();
    if (!(std::abs(result) <= largest_number))
        fail<FileError>(source, ": \"", key, "\" holds ", result, ", which is too large");
    return result;
}

std::vector<double> numbers(const Json& value, std::size_t count, const char* key,
                            const std::string& source) {
    if (!value.is_array() || value.size() != count)
        fail<FileError>(source, ": \"", key, "\" is not an array of ", count, " numbers");
    std::vector<double> result;
    for (const Json& item : value) result.push_back(number(item, key, source));
    return result;
}

JsonValue row(const Tensor& values, std::int64_t index) {
    const auto size = static_cast<std::size_t>(values.shape(1));
    const std::vector<double> all = values.to_vector();
    if (!std::ranges::all_of(all, [](double x) { return std::abs(x) <= largest_number; }))
        fail<NumericError>("codes that no file can hold: they are not finite, or too large");
    return {std::vector<double>(all.begin() + static_cast<std::ptrdiff_t>(size) * index,
                                all.begin() + static_cast<std::ptrdiff_t>(size) * (index + 1))};
}

Json parsed(const std::string& text, const std::string& source) {
    if (const auto fault = json_fault(text)) fail<FileError>(source, ": ", *fault);
    Json json;
    try {
        json = Json::parse(text);
    } catch (const Json::exception& error) {
        const std::string message = plain_message(error);  // "parse error at line 1, column 2: ..."
        const bool has_lines = std::filesystem::path(source).extension() == ".jsonl";
        fail<FileError>(source, ": not JSON: ", message.substr(0, message.find(':')),
                        has_lines ? "; it has a face a line: write one of them to a file" : "");
    }
    return json;
}

Pose pose_of(const Json& json, const std::string& source) {
    const Json& pose = member(json, "pose", source);
    try {
        return parse_pose(pose.dump());
    } catch (const FileError& error) {
        fail<FileError>(source, ": ", error.what());
    }
}

}  // namespace

Pose read_pose(const std::filesystem::path& path) {
    return pose_of(parsed(read_file(path), path.string()), path.string());
}

CodeFile read_code_file(const std::filesystem::path& path) {
    return parse_code_file(read_file(path), path.string());
}

CodeFile parse_code_file(const std::string& text, const std::string& source) {
    const Json json = parsed(text, source);
    CodeFile result;
    const Json& code = member(json, "code", source);
    for (std::size_t group = 0; group < code_names.size(); ++group) {
        const std::vector<double> values =
            numbers(member(code, code_names[group], source),
                    static_cast<std::size_t>(code_sizes[group]), code_names[group], source);
        result.codes.groups[group] =
            Variable(Tensor::from({1, code_sizes[group]}, std::span<const double>(values))
                         .to(DType::float32));
    }
    result.pose = pose_of(json, source);
    if (const auto model = json.find("model"); model != json.end()) {
        if (!model->is_string()) fail<FileError>(source, ": \"model\" is no text");
        result.model = model->get<std::string>();
    }
    return result;
}

std::string model_mark(const std::filesystem::path& model) {
    const TensorFile file = read_tensor_file(model);
    if (const auto mark = file.metadata.find(mark_key); mark != file.metadata.end())
        return mark->second;
    return hexadecimal(crc32c(read_file(model)));
}

void require_mark(const CodeFile& codes, const std::string& mark, const std::string& source) {
    if (!codes.model.empty() && codes.model != mark)
        fail<FileError>(source, ": holds codes of another model; name that one");
}

CodeFile read_code_file(const std::filesystem::path& path, const std::string& mark) {
    CodeFile codes = read_code_file(path);
    require_mark(codes, mark, path.string());
    return codes;
}

JsonValue code_file_json(const Codes& codes, std::int64_t index, const Pose& pose,
                         const std::string& model) {
    JsonValue code = JsonValue::object();
    for (std::size_t group = 0; group < code_names.size(); ++group)
        code.add(code_names[group], row(codes.groups[group].value(), index));
    JsonValue json = JsonValue::object({{"code", code}, {"pose", to_json(pose)}});
    if (!model.empty()) json.add("model", model);
    return json;
}

std::string code_file_text(const Codes& codes, std::int64_t index, const Pose& pose,
                           const std::string& model) {
    return code_file_json(codes, index, pose, model).text() + "\n";
}

void write_code_file(const std::filesystem::path& path, const Codes& codes, std::int64_t index,
                     const Pose& pose, const std::string& model) {
    write_file(path, code_file_text(codes, index, pose, model));
}

}  // namespace stymo
