#include "core/io/torch_container.h"

#include <zip.h>

#include <algorithm>
#include <cstring>
#include <memory>
#include <system_error>

#include "core/io/file.h"

namespace stymo {

namespace {

namespace fs = std::filesystem;

struct Discard {
    void operator()(zip_t* archive) const { zip_discard(archive); }
    void operator()(zip_file_t* file) const { zip_fclose(file); }
};
using Archive = std::unique_ptr<zip_t, Discard>;
using ArchiveFile = std::unique_ptr<zip_file_t, Discard>;

Archive open_archive(const fs::path& path) {
    int code = 0;
    Archive archive(zip_open(path.c_str(), ZIP_RDONLY, &code));
    if (!archive) {
        zip_error_t error;
        zip_error_init_with_code(&error, code);
        const std::string reason = zip_error_strerror(&error);
        zip_error_fini(&error);
        refuse_torch_file(path, reason, "; is it truncated?");
    }
    return archive;
}

struct ZipEntry {
    std::string name;
    zip_uint64_t index = 0;
    zip_uint64_t size = 0;
};

/// All files in the archive. Their sizes are bounded before anything is allocated: PyTorch
/// compresses nothing.
std::vector<ZipEntry> entries_of(const fs::path& path, zip_t* archive) {
    std::error_code error;
    zip_uint64_t left = fs::file_size(path, error);
    if (error) refuse_torch_file(path, error.message());
    std::vector<ZipEntry> entries;
    const zip_int64_t count = zip_get_num_entries(archive, 0);
    for (zip_int64_t i = 0; i < count; ++i) {
        zip_stat_t stat;
        const auto index = static_cast<zip_uint64_t>(i);
        constexpr zip_uint64_t needed = ZIP_STAT_NAME | ZIP_STAT_SIZE | ZIP_STAT_COMP_METHOD;
        if (zip_stat_index(archive, index, 0, &stat) != 0 || (stat.valid & needed) != needed)
            refuse_torch_file(path, "entry ", i, " of its archive is broken");
        if (stat.comp_method != ZIP_CM_STORE)
            refuse_torch_file(path, "entry ", stat.name, " is compressed");
        if (stat.size > left)
            refuse_torch_file(path, "entry ", stat.name,
                              " reaches beyond the file; is it truncated?");
        left -= stat.size;
        entries.push_back({stat.name, index, stat.size});
    }
    return entries;
}

std::string contents_of(const fs::path& path, zip_t* archive, const ZipEntry& entry) {
    const ArchiveFile file(zip_fopen_index(archive, entry.index, 0));
    if (!file) refuse_torch_file(path, "entry ", entry.name, ": ", zip_strerror(archive));
    std::string bytes(entry.size, '\0');
    const zip_int64_t read = zip_fread(file.get(), bytes.data(), entry.size);
    // libzip compares the checksum when it reaches the end.
    char beyond = 0;
    if (read != static_cast<zip_int64_t>(entry.size) || zip_fread(file.get(), &beyond, 1) != 0)
        refuse_torch_file(path, "entry ", entry.name, ": ", zip_file_strerror(file.get()));
    return bytes;
}

}  // namespace

TorchContainer read_torch_zip(const fs::path& path, const NameFilter& allowed) {
    const Archive archive = open_archive(path);
    const std::vector<ZipEntry> entries = entries_of(path, archive.get());
    // All files are in one folder, which has the name that the archive had when it was saved.
    constexpr std::string_view pickle_name = "data.pkl";
    const auto described = std::ranges::find_if(entries, [&](const ZipEntry& entry) {
        return entry.name == pickle_name || entry.name.ends_with("/" + std::string(pickle_name));
    });
    if (described == entries.end()) refuse_torch_file(path, "a zip archive without ", pickle_name);
    const std::string folder =
        described->name.substr(0, described->name.size() - pickle_name.size());

    TorchContainer result{
        Pickle(contents_of(path, archive.get(), *described), path.string(), allowed)};
    const std::string storage_prefix = folder + "data/";
    for (const ZipEntry& entry : entries) {
        if (entry.name == folder + "byteorder" &&
            contents_of(path, archive.get(), entry) != "little")
            refuse_torch_file(path, "its numbers are not little-endian");
        if (entry.name.starts_with(storage_prefix))
            result.storages[entry.name.substr(storage_prefix.size())] =
                contents_of(path, archive.get(), entry);
    }
    return result;
}

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
