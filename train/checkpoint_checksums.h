#pragma once

#include <filesystem>

namespace stymo {

/// Writes `folder`/checksums.txt: CRC-32C in hexadecimal, size and name of every other file in it.
void write_checksums(const std::filesystem::path& folder);
/// Throws FileError that names the first file whose size or checksum is not that of checksums.txt,
/// or that is missing here or there. A folder without checksums.txt, from before there were any,
/// passes.
void verify_checksums(const std::filesystem::path& folder);

}  // namespace stymo
