#include <cstring>

#include "core/io/file.h"
#include "core/io/torch_container.h"

namespace stymo {
namespace {

namespace fs = std::filesystem;

/// The magic number 0x1950a86a20f9469cfc6c as a pickle, after the protocol number.
constexpr std::string_view magic_number("\x8a\x0a\x6c\xfc\x9c\x46\xf9\x20\x6a\xa8\x50\x19.", 13);
/// Later protocols write a frame before it.
constexpr std::size_t magic_number_before = 32;

template <class T>
const T* value_in(const PickleNode& dictionary, std::string_view key) {
    for (std::size_t i = 0; i + 1 < dictionary.items.size(); i += 2) {
        const auto* name = std::get_if<std::shared_ptr<const std::string>>(&dictionary.items[i]);
        if (name != nullptr && **name == key) return std::get_if<T>(&dictionary.items[i + 1]);
    }
    return nullptr;
}

void require_little_endian(const fs::path& path, const PickleValue& machine) {
    const auto* dictionary = std::get_if<const PickleNode*>(&machine);
    if (dictionary == nullptr)
        refuse_torch_file(path, "it does not describe the machine that wrote it");
    const bool* little_endian = value_in<bool>(**dictionary, "little_endian");
    if (little_endian == nullptr || !*little_endian)
        refuse_torch_file(path, "its numbers are not little-endian");
}

const std::string& key_of(const fs::path& path, const PickleNode& reference) {
    const auto* tuple = std::get_if<const PickleNode*>(&reference.items.at(0));
    if (tuple != nullptr && (*tuple)->items.size() >= 5)
        if (const auto* key = std::get_if<std::shared_ptr<const std::string>>(&(*tuple)->items[2]))
            return **key;
    refuse_torch_file(path, "a storage has no key");
}

}  // namespace

bool is_legacy_torch_file(std::string_view beginning) {
    return beginning.substr(0, magic_number_before).find(magic_number) != std::string_view::npos;
}

TorchContainer read_legacy_torch_file(const fs::path& path, const NameFilter& allowed,
                                      const ElementBytes& element_bytes) {
    const std::string bytes = read_file(path);
    std::string_view rest = bytes;
    const auto next_pickle = [&] {
        Pickle pickle(rest, path.string(), allowed);
        rest.remove_prefix(pickle.length());
        return pickle;
    };
    rest.remove_prefix(rest.find(magic_number) + magic_number.size());
    static_cast<void>(next_pickle());  // version of the format, which never changed
    require_little_endian(path, next_pickle().root());
    TorchContainer result{next_pickle()};
    const Pickle keys = next_pickle();

    std::map<std::string, std::uint64_t> bytes_of_element;
    for (const PickleNode& node : result.pickle.nodes())
        if (node.kind == PickleNode::Kind::reference)
            bytes_of_element[key_of(path, node)] = element_bytes(node);
    const auto* list = std::get_if<const PickleNode*>(&keys.root());
    if (list == nullptr) refuse_torch_file(path, "it has no list of storages");
    for (const PickleValue& value : (*list)->items) {
        const auto* key = std::get_if<std::shared_ptr<const std::string>>(&value);
        if (key == nullptr || !bytes_of_element.contains(**key))
            refuse_torch_file(path, "a storage belongs to no tensor");
        std::uint64_t count = 0;
        if (rest.size() < sizeof count) refuse_torch_file(path, "truncated before storage ", **key);
        std::memcpy(&count, rest.data(), sizeof count);
        rest.remove_prefix(sizeof count);
        const std::uint64_t element = bytes_of_element[**key];
        if (count > rest.size() / element)
            refuse_torch_file(path, "truncated within storage ", **key);
        result.storages[**key] = rest.substr(0, count * element);
        rest.remove_prefix(count * element);
    }
    return result;
}

}  // namespace stymo
