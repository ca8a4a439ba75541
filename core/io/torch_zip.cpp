#include <zip.h>

#include <algorithm>
#include <memory>
#include <system_error>

#include "core/io/torch_container.h"

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

}  // namespace stymo
