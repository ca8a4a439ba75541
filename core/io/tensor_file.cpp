#include "core/io/tensor_file.h"

#include <Eigen/Core>
#include <algorithm>
#include <cerrno>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <fstream>
#include <nlohmann/json.hpp>
#include <vector>

#include "core/error.h"
#include "core/io/element_type.h"
#include "core/io/file.h"
#include "core/io/json_check.h"

namespace stymo {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;

/// The limit of the format.
constexpr std::uint64_t maximum_header_length = 100'000'000;
constexpr std::uint64_t length_bytes = 8;

template <class... Parts>
[[noreturn]] void refuse(const fs::path& path, const Parts&... parts) {
    fail<FileError>(path.string(), ": not a readable safetensors file (", parts..., ")");
}

json parse_header(const fs::path& path, std::string_view text) {
    if (const auto fault = json_fault(text)) refuse(path, "its header: ", *fault);
    json header = json::parse(text, nullptr, false);
    if (header.is_discarded()) refuse(path, "the header is not JSON");
    if (!header.is_object()) refuse(path, "the header is not a JSON object");
    return header;
}

struct Entry {
    std::string name;
    const ElementType* type = nullptr;
    Shape shape;
    std::uint64_t begin = 0;
    std::uint64_t end = 0;
};

std::uint64_t natural_number(const fs::path& path, const std::string& name, const json& value) {
    if (!value.is_number_unsigned())
        refuse(path, "tensor \"", name, "\" has an extent or offset that is not a natural number");
    return value.get<std::uint64_t>();
}

/// Extents of `entry` and the bytes they need; throws if these overflow.
Shape checked_shape(const fs::path& path, const Entry& entry, const json& extents) {
    if (extents.size() > Shape::max_rank)
        refuse(path, "tensor \"", entry.name, "\" has more than ", Shape::max_rank, " axes");
    std::vector<std::int64_t> result;
    std::uint64_t bytes = entry.type->bytes;
    for (const json& extent : extents) {
        const std::uint64_t length = natural_number(path, entry.name, extent);
        std::uint64_t product = 0;
        if (length > static_cast<std::uint64_t>(INT64_MAX) ||
            __builtin_mul_overflow(bytes, length, &product)) {
            refuse(path, "tensor \"", entry.name, "\" has extents that overflow");
        }
        bytes = product;
        result.push_back(static_cast<std::int64_t>(length));
    }
    if (bytes != entry.end - entry.begin)
        refuse(path, "tensor \"", entry.name, "\" needs ", bytes, " bytes by its extents but has ",
               entry.end - entry.begin);
    return Shape(result);
}

Entry parse_entry(const fs::path& path, const std::string& name, const json& fields,
                  std::uint64_t data_length) {
    Entry entry{name, nullptr, {}, 0, 0};
    if (!fields.is_object() || fields.size() != 3 || !fields.contains("dtype") ||
        !fields["dtype"].is_string() || !fields.contains("shape") || !fields["shape"].is_array() ||
        !fields.contains("data_offsets") || !fields["data_offsets"].is_array() ||
        fields["data_offsets"].size() != 2)
        refuse(path, "tensor \"", name, "\" needs exactly dtype, shape and data_offsets");
    const auto& type_name = fields["dtype"].get_ref<const std::string&>();
    entry.type = find_element_type(type_name);
    if (entry.type == nullptr)
        refuse(path, "tensor \"", name, "\" has the unknown element type \"", type_name, "\"");
    entry.begin = natural_number(path, name, fields["data_offsets"][0]);
    entry.end = natural_number(path, name, fields["data_offsets"][1]);
    if (entry.begin > entry.end || entry.end > data_length) {
        refuse(path, "tensor \"", name, "\" reaches beyond the file; is it truncated?");
    }
    entry.shape = checked_shape(path, entry, fields["shape"]);
    return entry;
}

std::map<std::string, std::string> parse_metadata(const fs::path& path, const json& fields) {
    if (!fields.is_object() ||
        !std::ranges::all_of(fields, [](const json& value) { return value.is_string(); })) {
        refuse(path, "__metadata__ is not a map of texts");
    }
    return fields.get<std::map<std::string, std::string>>();
}

/// Refuses tensors that share bytes and bytes that belong to no tensor.
void require_tiling(const fs::path& path, std::vector<Entry>& entries, std::uint64_t data_length) {
    std::ranges::sort(entries, {},
                      [](const Entry& entry) { return std::pair(entry.begin, entry.end); });
    std::uint64_t covered = 0;
    for (const Entry& entry : entries) {
        if (entry.begin < covered) {
            refuse(path, "tensor \"", entry.name, "\" overlaps another one");
        }
        if (entry.begin > covered) {
            refuse(path, "there is a hole before tensor \"", entry.name, "\"");
        }
        covered = entry.end;
    }
    if (covered != data_length)
        refuse(path, data_length - covered, " bytes at the end belong to no tensor");
}

/// How the elements of this type are stored.
struct StoredType {
    std::string_view name;
    std::size_t bytes;
};

StoredType stored_type(const Tensor& tensor, StoredElements stored) {
    const DType dtype = tensor.dtype();
    if (stored == StoredElements::float16 && tensor.rank() > 0) return {"F16", sizeof(Eigen::half)};
    return {dtype == DType::float32 ? "F32" : "F64", size_in_bytes(dtype)};
}

std::vector<Eigen::half> rounded_to_half(const std::string& name, const Tensor& tensor) {
    std::vector<Eigen::half> halves;
    halves.reserve(static_cast<std::size_t>(tensor.size()));
    dispatch(tensor.dtype(), [&]<class T>(T) {
        for (const T value : tensor.values<T>()) {
            halves.emplace_back(static_cast<float>(value));
            if (!(Eigen::numext::isfinite)(halves.back()) && std::isfinite(value))
                fail<ValueError>("tensor ", name, ": ", value, " is too large for 16 bits");
        }
    });
    return halves;
}

/// The header with its length before it and spaces behind it, so that the tensors begin at a
/// multiple of 8 bytes.
std::string encoded_header(const TensorFile& contents,
                           const std::vector<const std::pair<const std::string, Tensor>*>& order,
                           StoredElements stored) {
    json header = json::object();
    if (!contents.metadata.empty()) header["__metadata__"] = contents.metadata;
    std::uint64_t begin = 0;
    for (const auto* item : order) {
        const auto& [name, tensor] = *item;
        const StoredType type = stored_type(tensor, stored);
        const std::uint64_t end = begin + static_cast<std::uint64_t>(tensor.size()) * type.bytes;
        header[name] = {
            {"dtype", type.name}, {"shape", json::array()}, {"data_offsets", {begin, end}}};
        for (const std::int64_t extent : tensor.shape().extents()) {
            header[name]["shape"].push_back(extent);
        }
        begin = end;
    }
    std::string text;
    try {
        text = header.dump();
    } catch (const json::exception&) {
        fail<ValueError>("[write_tensor_file] a name or a text of the metadata is not UTF-8");
    }
    text.append((length_bytes - text.size() % length_bytes) % length_bytes, ' ');
    const std::uint64_t length = text.size();
    if (length > maximum_header_length)
        fail<ValueError>("[write_tensor_file] names and metadata need ", length,
                         " bytes, more than the ", maximum_header_length, " of a header");
    std::string encoded(length_bytes, '\0');
    std::memcpy(encoded.data(), &length, length_bytes);
    return encoded + text;
}

}  // namespace

bool has_prefix(const TensorFile& file, std::string_view prefix) {
    const auto found = file.tensors.lower_bound(std::string(prefix));
    return found != file.tensors.end() && found->first.starts_with(prefix);
}

TensorFile read_tensor_file(const fs::path& path) {
    const std::string bytes = read_file(path);
    if (bytes.size() < length_bytes) refuse(path, "truncated before the header");
    std::uint64_t header_length = 0;
    std::memcpy(&header_length, bytes.data(), length_bytes);
    if (header_length > maximum_header_length)
        refuse(path, "it does not begin with the length of a header");
    if (header_length > bytes.size() - length_bytes) refuse(path, "truncated within the header");
    const json header =
        parse_header(path, std::string_view(bytes).substr(length_bytes, header_length));
    const char* data = bytes.data() + length_bytes + header_length;
    const std::uint64_t data_length = bytes.size() - length_bytes - header_length;

    TensorFile contents;
    std::vector<Entry> entries;
    for (const auto& [name, fields] : header.items()) {
        if (name == "__metadata__") {
            contents.metadata = parse_metadata(path, fields);
        } else {
            entries.push_back(parse_entry(path, name, fields, data_length));
        }
    }
    require_tiling(path, entries, data_length);
    for (const Entry& entry : entries)
        contents.tensors.emplace(entry.name, entry.type->read(entry.shape, data + entry.begin));
    return contents;
}

Tensor as_read_from_float16(const std::string& name, const Tensor& tensor) {
    if (tensor.rank() == 0) return tensor.to(DType::float32);
    const std::vector<Eigen::half> halves = rounded_to_half(name, tensor);
    Tensor result(tensor.shape());
    std::ranges::transform(halves, result.mutable_values<float>().begin(),
                           [](Eigen::half half) { return static_cast<float>(half); });
    return result;
}

void write_tensor_file(const fs::path& path, const TensorFile& contents, StoredElements stored) {
    // Wide elements first, so that every tensor is aligned to its elements.
    std::vector<const std::pair<const std::string, Tensor>*> order;
    for (const auto& item : contents.tensors) {
        if (!item.second.defined() || item.first == "__metadata__") {
            fail<ValueError>("[write_tensor_file] tensor \"", item.first,
                             "\" is undefined or has a reserved name");
        }
        order.push_back(&item);
    }
    std::ranges::stable_sort(order, std::ranges::greater(), [&](const auto* item) {
        return stored_type(item->second, stored).bytes;
    });

    // Before the file is there: JSON that runs out of memory in its destructor ends the process.
    const std::string header = encoded_header(contents, order, stored);
    write_whole(path, [&](const fs::path& temporary) {
        errno = 0;
        std::ofstream stream(temporary, std::ios::binary);
        stream.write(header.data(), static_cast<std::streamsize>(header.size()));
        for (const auto* item : order) {
            if (stored_type(item->second, stored).bytes == sizeof(Eigen::half)) {
                const std::vector<Eigen::half> halves = rounded_to_half(item->first, item->second);
                stream.write(reinterpret_cast<const char*>(halves.data()),
                             static_cast<std::streamsize>(halves.size() * sizeof(Eigen::half)));
                continue;
            }
            dispatch(item->second.dtype(), [&](auto zero) {
                const auto bytes = std::as_bytes(item->second.values<decltype(zero)>());
                stream.write(reinterpret_cast<const char*>(bytes.data()),
                             static_cast<std::streamsize>(bytes.size()));
            });
        }
        stream.close();
        if (!stream)
            fail<FileError>(path.string(), ": cannot be written (", std::strerror(errno), ")");
    });
}

}  // namespace stymo
