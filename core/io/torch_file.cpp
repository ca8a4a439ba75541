#include "core/io/torch_file.h"

#include <algorithm>
#include <array>
#include <optional>
#include <span>
#include <utility>

#include "core/io/element_type.h"
#include "core/io/file.h"
#include "core/io/torch_container.h"

namespace stymo {
namespace {

namespace fs = std::filesystem;
using Kind = PickleNode::Kind;

constexpr std::pair<std::string_view, std::string_view> storage_types[] = {
    {"torch.FloatStorage", "F32"}, {"torch.DoubleStorage", "F64"},
    {"torch.HalfStorage", "F16"},  {"torch.BFloat16Storage", "BF16"},
    {"torch.CharStorage", "I8"},   {"torch.ShortStorage", "I16"},
    {"torch.IntStorage", "I32"},   {"torch.LongStorage", "I64"},
    {"torch.ByteStorage", "U8"},   {"torch.BoolStorage", "BOOL"},
};

constexpr std::string_view ordered_dictionary = "collections.OrderedDict";
constexpr std::string_view plain_tensor = "torch._utils._rebuild_tensor";
constexpr std::string_view tensor_with_gradient = "torch._utils._rebuild_tensor_v2";
constexpr std::string_view parameter = "torch._utils._rebuild_parameter";

/// Names that a checkpoint may contain besides storages. They carry no tensors unless they are
/// listed above: NumPy's are numbers, and the last are options, a device and milestones beside the
/// state dict.
constexpr std::string_view allowed_names[] = {
    ordered_dictionary,
    plain_tensor,
    tensor_with_gradient,
    parameter,
    "builtins.set",
    "__builtin__.set",
    "torch.Size",
    "torch.float32",
    "torch.float64",
    "torch.float16",
    "torch.int8",
    "torch.int16",
    "torch.int32",
    "torch.int64",
    "torch.uint8",
    "torch.bool",
    "torch.bfloat16",
    "numpy.core.multiarray.scalar",
    "numpy._core.multiarray.scalar",
    "numpy.dtype",
    "_codecs.encode",
    "argparse.Namespace",
    "torch.device",
    "collections.Counter",
};

bool is_allowed(const std::string& name) {
    return std::ranges::find(allowed_names, name) != std::end(allowed_names) ||
           std::ranges::find(storage_types, name,
                             &std::pair<std::string_view, std::string_view>::first) !=
               std::end(storage_types);
}

const PickleNode* node_in(const PickleValue& value, Kind kind) {
    const auto* node = std::get_if<const PickleNode*>(&value);
    return node != nullptr && (*node)->kind == kind ? *node : nullptr;
}

/// The memory of a tensor: a storage, or (in old files) a part of one.
struct StorageReference {
    const ElementType* type = nullptr;
    std::string key{};
    std::uint64_t first = 0;
    std::optional<std::uint64_t> count{};  ///< of a part
};

/// ("storage", type, key, device, number of elements) and perhaps (key, first element, number of
/// elements) of a part
StorageReference parse_reference(const fs::path& path, const PickleNode& reference) {
    const PickleNode* fields = node_in(reference.items.at(0), Kind::tuple);
    const auto natural = [&](const PickleValue& value) {
        const auto* number = std::get_if<std::int64_t>(&value);
        if (number == nullptr || *number < 0)
            refuse_torch_file(path, "a storage has no proper extent");
        return static_cast<std::uint64_t>(*number);
    };
    if (fields == nullptr || fields->items.size() < 5)
        refuse_torch_file(path, "a reference to what is no storage");
    const PickleNode* name = node_in(fields->items[1], Kind::name);
    const auto* key = std::get_if<std::shared_ptr<const std::string>>(&fields->items[2]);
    if (name == nullptr || key == nullptr) refuse_torch_file(path, "a storage without type or key");
    const auto* row = std::ranges::find(storage_types, name->name,
                                        &std::pair<std::string_view, std::string_view>::first);
    if (row == std::end(storage_types)) refuse_torch_file(path, "a storage of type ", name->name);
    StorageReference result{.type = find_element_type(row->second), .key = **key};
    if (fields->items.size() > 5) {
        if (const PickleNode* part = node_in(fields->items[5], Kind::tuple)) {
            if (part->items.size() != 3)
                refuse_torch_file(path, "a part of a storage has no proper extent");
            result.first = natural(part->items[1]);
            result.count = natural(part->items[2]);
        }
    }
    return result;
}

/// Elements of a tensor that is a view of `elements`, in row-major order.
std::string gathered(std::string_view elements, std::uint64_t element_bytes,
                     std::span<const std::int64_t> extents, std::span<const std::int64_t> strides,
                     std::int64_t first, std::int64_t count) {
    std::string result;
    result.reserve(static_cast<std::uint64_t>(count) * element_bytes);
    std::array<std::int64_t, Shape::max_rank> index{};
    std::int64_t position = first;
    for (std::int64_t i = 0; i < count; ++i) {
        result.append(
            elements.substr(static_cast<std::uint64_t>(position) * element_bytes, element_bytes));
        for (std::size_t axis = extents.size(); axis-- > 0;) {
            if (extents[axis] == 1) continue;  // its stride may be anything
            position += strides[axis];
            if (++index[axis] < extents[axis]) break;
            position -= extents[axis] * strides[axis];
            index[axis] = 0;
        }
    }
    return result;
}

bool is_contiguous(std::span<const std::int64_t> extents, std::span<const std::int64_t> strides) {
    std::int64_t expected = 1;
    for (std::size_t axis = extents.size(); axis-- > 0;) {
        if (extents[axis] != 1 && strides[axis] != expected) return false;
        expected *= extents[axis];
    }
    return true;
}

/// Collects the tensors of a checkpoint under dotted names.
class TensorCollector {
public:
    TensorCollector(const fs::path& path, const TorchContainer& container)
        : path_(path), container_(container) {
        std::uint64_t bytes = container.pickle.length();
        for (const auto& [key, storage] : container.storages) bytes += storage.size();
        elements_left_ = 4 * static_cast<std::int64_t>(bytes);
        letters_left_ = 16 * static_cast<std::int64_t>(container.pickle.length());
    }

    void visit(const PickleValue& value, const std::string& name, int depth = 0) {
        const auto* node = std::get_if<const PickleNode*>(&value);
        if (node == nullptr) return;
        if (depth > 64) refuse_torch_file(path_, "its containers are nested too deeply");
        spend(letters_left_, static_cast<std::int64_t>(name.size()) + 1);
        switch ((*node)->kind) {
            case Kind::list:
            case Kind::tuple:
                for (std::size_t i = 0; i < (*node)->items.size(); ++i)
                    visit((*node)->items[i], joined(name, std::to_string(i)), depth + 1);
                break;
            case Kind::dictionary: visit_pairs((*node)->items, name, depth); break;
            case Kind::call: visit_call(**node, name, depth); break;
            case Kind::set:
            case Kind::name:
            case Kind::reference: break;
        }
    }

    [[nodiscard]] std::map<std::string, Tensor>& tensors() { return tensors_; }

private:
    static std::string joined(const std::string& name, const std::string& key) {
        return name.empty() ? key : name + "." + key;
    }

    /// A small file may refer to the same container or elements so many times that no memory could
    /// hold the result.
    void spend(std::int64_t& budget, std::int64_t amount) const {
        if (amount > budget)
            refuse_torch_file(path_, "it holds the same values too many times over");
        budget -= amount;
    }

    void visit_pairs(const std::vector<PickleValue>& items, const std::string& name, int depth) {
        for (std::size_t i = 0; i + 1 < items.size(); i += 2) {
            if (!std::holds_alternative<const PickleNode*>(items[i + 1])) continue;
            if (const auto* text = std::get_if<std::shared_ptr<const std::string>>(&items[i])) {
                visit(items[i + 1], joined(name, **text), depth + 1);
            } else if (const auto* number = std::get_if<std::int64_t>(&items[i])) {
                visit(items[i + 1], joined(name, std::to_string(*number)), depth + 1);
            } else {
                refuse_torch_file(path_, "a key of \"", name, "\" is neither text nor integer");
            }
        }
    }

    void visit_call(const PickleNode& call, const std::string& name, int depth) {
        if (call.name == ordered_dictionary) {
            // Python 2 passes the pairs to the constructor.
            if (!call.arguments->items.empty())
                if (const PickleNode* pairs = node_in(call.arguments->items[0], Kind::list))
                    for (const PickleValue& value : pairs->items)
                        if (const auto* pair = std::get_if<const PickleNode*>(&value))
                            visit_pairs((*pair)->items, name, depth);
            visit_pairs(call.items, name, depth);
        } else if (call.name == plain_tensor || call.name == tensor_with_gradient ||
                   call.name == parameter) {
            if (name.empty()) refuse_torch_file(path_, "a tensor without a name");
            if (!tensors_.emplace(name, tensor_of(call)).second)
                refuse_torch_file(path_, "two tensors are called \"", name, "\"");
        }
    }

    const Tensor& tensor_of(const PickleNode& call) {
        const auto [known, is_new] = tensor_of_call_.try_emplace(&call);
        if (is_new) known->second = built(call);
        return known->second;
    }

    Tensor built(const PickleNode& call) {
        const std::vector<PickleValue>& arguments = call.arguments->items;
        if (call.name == parameter) {
            const PickleNode* data =
                arguments.empty() ? nullptr : node_in(arguments[0], Kind::call);
            if (data == nullptr ||
                (data->name != plain_tensor && data->name != tensor_with_gradient))
                refuse_torch_file(path_, "a parameter is no tensor");
            return tensor_of(*data);
        }
        const PickleNode* reference =
            arguments.size() < 4 ? nullptr : node_in(arguments[0], Kind::reference);
        const auto* first =
            arguments.size() < 4 ? nullptr : std::get_if<std::int64_t>(&arguments[1]);
        if (reference == nullptr || first == nullptr)
            refuse_torch_file(path_, "a tensor lacks storage, offset, shape or strides");
        return view(parse_reference(path_, *reference), *first, integers(arguments[2]),
                    integers(arguments[3]));
    }

    [[nodiscard]] std::vector<std::int64_t> integers(const PickleValue& value) const {
        const PickleNode* tuple = node_in(value, Kind::tuple);
        if (tuple == nullptr) refuse_torch_file(path_, "a shape is no tuple");
        if (tuple->items.size() > Shape::max_rank)
            refuse_torch_file(path_, "a tensor has more than ", Shape::max_rank, " axes");
        std::vector<std::int64_t> result;
        for (const PickleValue& item : tuple->items) {
            const auto* number = std::get_if<std::int64_t>(&item);
            if (number == nullptr || *number < 0)
                refuse_torch_file(path_, "an extent is no natural number");
            result.push_back(*number);
        }
        return result;
    }

    /// The bytes that a tensor may refer to.
    [[nodiscard]] std::string_view elements_of(const StorageReference& reference) const {
        const auto found = container_.storages.find(reference.key);
        if (found == container_.storages.end())
            refuse_torch_file(path_, "storage ", reference.key, " is missing");
        const std::string_view bytes = found->second;
        const std::uint64_t size = reference.type->bytes;
        const std::uint64_t available = bytes.size() / size;
        const std::uint64_t count = reference.count.value_or(available);
        if (reference.first > available || count > available - reference.first)
            refuse_torch_file(path_, "a part reaches beyond storage ", reference.key);
        return bytes.substr(reference.first * size, count * size);
    }

    Tensor view(const StorageReference& reference, std::int64_t first,
                const std::vector<std::int64_t>& extents,
                const std::vector<std::int64_t>& strides) {
        const std::string_view elements = elements_of(reference);
        const auto available = static_cast<std::int64_t>(elements.size() / reference.type->bytes);
        const std::optional<std::int64_t> count = checked_element_count(extents);
        if (!count || extents.size() != strides.size() || first < 0)
            refuse_torch_file(path_, "a tensor has no proper extent");
        if (*count == 0)
            return Tensor(Shape(extents), reference.type->read(Shape{0}, nullptr).dtype());
        std::int64_t last = first;
        for (std::size_t axis = 0; axis < extents.size(); ++axis) {
            std::int64_t step = 0;
            if (__builtin_mul_overflow(extents[axis] - 1, strides[axis], &step) ||
                __builtin_add_overflow(last, step, &last))
                refuse_torch_file(path_, "a tensor has strides that overflow");
        }
        if (last >= available)
            refuse_torch_file(path_, "a tensor reaches beyond storage ", reference.key);
        spend(elements_left_, *count);
        if (is_contiguous(extents, strides))
            return reference.type->read(
                Shape(extents),
                elements.data() + static_cast<std::uint64_t>(first) * reference.type->bytes);
        return reference.type->read(
            Shape(extents),
            gathered(elements, reference.type->bytes, extents, strides, first, *count).data());
    }

    const fs::path& path_;
    const TorchContainer& container_;
    std::int64_t elements_left_ = 0;
    std::int64_t letters_left_ = 0;
    std::map<const PickleNode*, Tensor> tensor_of_call_;
    std::map<std::string, Tensor> tensors_;
};

TorchContainer read_container(const fs::path& path) {
    const std::string beginning = read_beginning(path, torch_file_beginning);
    if (beginning.empty()) refuse_torch_file(path, "zero bytes");
    if (!is_torch_file(beginning))
        refuse_torch_file(path, "neither a zip archive nor the older format");
    if (!is_legacy_torch_file(beginning)) return read_torch_zip(path, is_allowed);
    return read_legacy_torch_file(path, is_allowed, [&](const PickleNode& reference) {
        return parse_reference(path, reference).type->bytes;
    });
}

}  // namespace

bool is_torch_file(std::string_view beginning) {
    return beginning.starts_with("PK\x03\x04") || is_legacy_torch_file(beginning);
}

TensorFile read_torch_file(const fs::path& path) {
    const TorchContainer container = read_container(path);
    TensorCollector collector(path, container);
    collector.visit(container.pickle.root(), "");
    if (collector.tensors().empty()) refuse_torch_file(path, "it holds no tensors");
    return {std::move(collector.tensors()), {}};
}

}  // namespace stymo
