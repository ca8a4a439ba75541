#include "core/io/onnx_source.h"

#include <array>
#include <charconv>
#include <system_error>

#include "core/io/file.h"
#include "core/io/protobuf.h"

namespace stymo {
namespace {

namespace fs = std::filesystem;

/// Appends the values of a repeated field of fixed size, packed or not.
void append_fixed(const OnnxField& field, std::size_t size, std::string& bytes) {
    if (field.has_bytes) {
        bytes += field.bytes;
    } else {
        bytes.append(reinterpret_cast<const char*>(&field.number), size);
    }
}

/// Whether a path stays in the folder that it begins in.
bool stays_inside(const fs::path& path) {
    if (path.empty() || path.is_absolute()) return false;
    for (const fs::path& part : path)
        if (part == "..") return false;
    return true;
}

}  // namespace

std::string_view OnnxSource::take(std::string_view& rest, std::uint64_t length) const {
    if (length > rest.size()) refuse("truncated");
    const std::string_view taken = rest.substr(0, length);
    rest.remove_prefix(length);
    return taken;
}

std::uint64_t OnnxSource::take_varint(std::string_view& rest) const {
    std::uint64_t value = 0;
    for (unsigned shift = 0; shift < 64; shift += 7) {
        const auto byte = static_cast<unsigned char>(take(rest, 1).front());
        value |= std::uint64_t{byte & 0x7FU} << shift;
        if (byte < 0x80U) return value;
    }
    refuse("malformed");
}

std::uint64_t OnnxSource::take_fixed(std::string_view& rest, std::size_t length) const {
    std::uint64_t value = 0;
    std::memcpy(&value, take(rest, length).data(), length);
    return value;
}

OnnxField OnnxSource::take_field(std::string_view& message) const {
    const std::string_view start = message;
    const std::uint64_t key = take_varint(message);
    OnnxField field{.tag = key >> 3};
    switch (key & 7U) {
        case 0: field.number = take_varint(message); break;
        case 1: field.number = take_fixed(message, 8); break;
        case 2:
            field.bytes = take(message, take_varint(message));
            field.has_bytes = true;
            break;
        case 5: field.number = take_fixed(message, 4); break;
        default: refuse("malformed");
    }
    field.whole = start.substr(0, start.size() - message.size());
    return field;
}

void OnnxSource::append_integers(const OnnxField& field,
                                 std::vector<std::int64_t>& integers) const {
    if (!field.has_bytes) {
        integers.push_back(static_cast<std::int64_t>(field.number));
        return;
    }
    for (std::string_view rest = field.bytes; !rest.empty();)
        integers.push_back(static_cast<std::int64_t>(take_varint(rest)));
}

const ElementType& OnnxSource::element_type(const OnnxStoredTensor& tensor) const {
    constexpr std::array<std::string_view, 17> names{"",    "F32", "U8", "I8",   "U16", "I16",
                                                     "I32", "I64", "",   "BOOL", "F16", "F64",
                                                     "U32", "U64", "",   "",     "BF16"};
    const ElementType* type =
        tensor.type < names.size() ? find_element_type(names[tensor.type]) : nullptr;
    if (type == nullptr)
        refuse("tensor \"", tensor.name, "\" has the unsupported element type ", tensor.type);
    return *type;
}

void OnnxSource::read_entry(std::string_view entry,
                            std::map<std::string, std::string>& entries) const {
    std::string key;
    std::string value;
    each_field(entry, [&](const OnnxField& field) {
        if (field.tag == 1) key = field.bytes;
        if (field.tag == 2) value = field.bytes;
    });
    entries[key] = value;
}

OnnxStoredTensor OnnxSource::stored_tensor(std::string_view message) const {
    OnnxStoredTensor tensor;
    each_field(message, [&](const OnnxField& field) {
        switch (field.tag) {
            case 1: append_integers(field, tensor.extents); break;
            case 2: tensor.type = field.number; break;
            case 4: append_fixed(field, sizeof(float), tensor.fixed); break;
            case 5:
            case 7:
            case 11: append_integers(field, tensor.integers); break;
            case 8: tensor.name = field.bytes; break;
            case 9: tensor.raw = field.bytes; break;
            case 10: append_fixed(field, sizeof(double), tensor.fixed); break;
            case 13:
                read_entry(field.bytes, tensor.external);
                tensor.is_external = true;
                break;
            case 14: tensor.is_external = tensor.is_external || field.number == 1; break;
            default: break;
        }
    });
    return tensor;
}

std::string OnnxSource::listed_constant(std::string_view attribute) const {
    std::vector<std::int64_t> integers;
    std::string floats, name;
    each_field(attribute, [&](const OnnxField& field) {
        if (field.tag == 1) name = field.bytes;
        if (field.tag == 2 || field.tag == 7) append_fixed(field, sizeof(float), floats);
        if (field.tag == 3 || field.tag == 8) append_integers(field, integers);
    });
    const bool whole = name.starts_with("value_int");
    const std::size_t count = whole ? integers.size() : floats.size() / sizeof(float);
    std::string result;
    if (name.ends_with('s')) result += protobuf::integer_field(1, static_cast<std::int64_t>(count));
    constexpr std::int64_t type_float = 1, type_int64 = 7;
    const std::string_view bytes(reinterpret_cast<const char*>(integers.data()),
                                 integers.size() * sizeof(std::int64_t));
    return result + protobuf::integer_field(2, whole ? type_int64 : type_float) +
           protobuf::bytes_field(9, whole ? bytes : floats);
}

std::string_view OnnxSource::external_bytes(const OnnxStoredTensor& tensor) {
    const auto entry = [&](const char* key) {
        const auto found = tensor.external.find(key);
        return found == tensor.external.end() ? std::string() : found->second;
    };
    const auto number = [&](const char* key, std::uint64_t otherwise) {
        const std::string text = entry(key);
        const char* end = text.data() + text.size();
        std::uint64_t value = otherwise;
        if (!text.empty() &&
            std::from_chars(text.data(), end, value) != std::from_chars_result{end, std::errc()})
            refuse("tensor \"", tensor.name, "\" has an improper ", key);
        return value;
    };
    const std::string location = entry("location");
    // A link may lead to another file, as in a cache, but not out of the folders of the model.
    std::error_code error;
    const fs::path file = fs::canonical(path_.parent_path() / location, error);
    const auto lies_in = [&](const fs::path& folder) {
        std::error_code unknown;
        return stays_inside(file.lexically_relative(fs::canonical(folder, unknown)));
    };
    const bool is_beside = !error && (lies_in(fs::absolute(path_).parent_path()) ||
                                      lies_in(fs::canonical(path_, error).parent_path()));
    if (!stays_inside(location) || !is_beside || !fs::is_regular_file(file, error))
        fail<FileError>(path_.string(), ": tensor \"", tensor.name,
                        "\" is kept in another file, \"", location,
                        "\"; put that file beside the model, or save the model with its weights "
                        "inside");
    const auto [known, is_new] = files_.try_emplace(file.string());
    if (is_new) known->second.bytes = read_file(file);
    const std::string_view all = known->second.bytes;
    const std::uint64_t offset = number("offset", 0);
    if (offset > all.size()) refuse("tensor \"", tensor.name, "\" lies behind ", location);
    const std::uint64_t length = number("length", all.size() - offset);
    if (length > all.size() - offset)
        refuse("tensor \"", tensor.name, "\" reaches beyond ", location, "; is it truncated?");
    // A small file may refer to the same bytes so often that no memory could hold the tensors.
    constexpr std::uint64_t most_readings = 16;
    known->second.taken += length;
    if (known->second.taken > most_readings * all.size())
        refuse("its tensors repeat the bytes of ", location, " too many times");
    return all.substr(offset, length);
}

Tensor OnnxSource::tensor_of(const OnnxStoredTensor& tensor) {
    const ElementType& type = element_type(tensor);
    if (tensor.extents.size() > Shape::max_rank)
        refuse("tensor \"", tensor.name, "\" has more than ", Shape::max_rank, " axes");
    const auto count = checked_element_count(tensor.extents);
    if (!count) refuse("tensor \"", tensor.name, "\" has no proper extents");
    std::string listed = tensor.fixed;
    for (const std::int64_t value : tensor.integers)
        listed.append(reinterpret_cast<const char*>(&value), type.bytes);
    const std::string_view data = tensor.is_external   ? external_bytes(tensor)
                                  : tensor.raw.empty() ? std::string_view(listed)
                                                       : tensor.raw;
    const std::uint64_t needed = static_cast<std::uint64_t>(*count) * type.bytes;
    if (data.size() != needed)
        refuse("tensor \"", tensor.name, "\" needs ", needed, " bytes by its extents but has ",
               data.size());
    return type.read(Shape(tensor.extents), data.data());
}

}  // namespace stymo
